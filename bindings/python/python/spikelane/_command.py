"""The `spikelane` command that comes with the package."""

from __future__ import annotations

import sys

from . import _native


def main() -> int:
    """Runs the program with this process's arguments and returns its exit code."""
    return _native.command(["spikelane", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
