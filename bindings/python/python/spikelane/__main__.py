"""`python -m spikelane`: the same as the command `spikelane`."""

import sys

from ._command import main

sys.exit(main())
