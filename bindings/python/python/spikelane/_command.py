"""The `spikelane` command of the package."""

from __future__ import annotations

import signal
import sys

from . import _native


def main() -> int:
    """Runs the program with this process's arguments and returns its exit code."""
    # The program has its own Ctrl-C handler. After the program ends, Python's handler would print a traceback.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.command(["spikelane", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
