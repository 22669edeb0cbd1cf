"""The command `variational`."""

import os
import signal
import sys

from ._core import cli


def main() -> int:
    """Runs the command with the arguments of the process; returns its exit code."""
    # The program has its own signal handlers. Python's would raise KeyboardInterrupt after it has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # `variational view`, `picture` and `movie` draw with this Python.
    os.environ["VARIATIONAL_PYTHON"] = sys.executable
    return cli(["variational", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
