"""`python -m fatigue_runner` is the command `fatigue-runner`."""

from fatigue_runner.cli import main

main()
