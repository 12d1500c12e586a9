"""`python -m fatigue_runner` is the command `fatigue-runner`; from its first line on Ctrl-C is one sentence, not a traceback."""

import sys

from fatigue_runner.interruption import ended_by_signals, exit_code_of


def main() -> None:
    """Entry point."""
    try:
        with ended_by_signals():
            from fatigue_runner import cli

            cli.main()
    except KeyboardInterrupt as interrupt:
        print("error: interrupted", file=sys.stderr)
        sys.exit(exit_code_of(interrupt))


if __name__ == "__main__":
    main()
