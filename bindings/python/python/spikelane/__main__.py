"""Runs `python -m spikelane` as the command `spikelane`."""

import sys

from ._command import main

sys.exit(main())
