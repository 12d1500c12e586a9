"""`python -m fatigue_runner` is the command `fatigue-runner`; from its first line on Ctrl-C is one sentence, not a traceback."""

import sys
from contextlib import suppress

from fatigue_runner.interruption import ended_by_signals, exit_code_of


def main() -> None:
    """Entry point."""
    try:
        with ended_by_signals(to_the_end=True):
            from fatigue_runner import cli

            try:
                cli.main()
            finally:
                with suppress(OSError, ValueError):  # a pipe that somebody closed
                    sys.stdout.flush()  # what was told is told, whatever ends the process now
    except KeyboardInterrupt as interrupt:
        print("error: interrupted", file=sys.stderr)
        sys.exit(exit_code_of(interrupt))


if __name__ == "__main__":
    main()
