"""What several tests share: cameras, light, the program, the golden table."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import spikelane as sl

ROOT = Path(__file__).resolve().parents[3]
GOLDEN = ROOT / "tests" / "golden.json"


@pytest.fixture(autouse=True, scope="session")
def ctrl_c() -> Iterator[None]:
    """A job in the background ignores Ctrl-C, and tests of it would never end."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def camera() -> sl.Camera:
    return sl.Camera.preset("physical").with_shape(12, 20)


@pytest.fixture
def clip() -> np.ndarray:
    """Five frames of 12 x 20 that move."""
    row, col = np.mgrid[0:12, 0:20]
    return np.stack([(row * 9 + col * 7 + 31 * k) % 256 for k in range(5)]).astype(np.uint8)


@pytest.fixture(scope="session")
def golden() -> list[dict]:
    if not GOLDEN.is_file():
        pytest.skip(f"{GOLDEN} is not here: the table lies in the repository")
    return json.loads(GOLDEN.read_text())


@pytest.fixture(scope="session")
def program() -> list[str]:
    """The command `spikelane`: SPIKELANE names another, which CI sets to the one that cargo built."""
    named = os.environ.get("SPIKELANE")
    if named:
        return [named]
    installed = shutil.which("spikelane", path=str(Path(sys.executable).parent))
    return [installed] if installed else [sys.executable, "-m", "spikelane"]
