"""Fixtures for several tests: cameras, light, the program and the golden table."""

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
    """Sets the default Ctrl-C handler. Background jobs ignore Ctrl-C, so tests of Ctrl-C would never end."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def camera() -> sl.Camera:
    return sl.Camera.preset("physical").with_shape(12, 20)


@pytest.fixture
def clip() -> np.ndarray:
    """Returns five frames of 12 x 20 pixels with a moving pattern."""
    row, col = np.mgrid[0:12, 0:20]
    return np.stack([(row * 9 + col * 7 + 31 * k) % 256 for k in range(5)]).astype(np.uint8)


@pytest.fixture(scope="session")
def golden() -> list[dict]:
    if not GOLDEN.is_file():
        pytest.skip(f"{GOLDEN} is missing: only the repository contains the table")
    return json.loads(GOLDEN.read_text())


@pytest.fixture(scope="session")
def program() -> list[str]:
    """Returns the command `spikelane`, or the program in SPIKELANE. CI sets SPIKELANE to the program that cargo built."""
    named = os.environ.get("SPIKELANE")
    if named:
        return [named]
    installed = shutil.which("spikelane", path=str(Path(sys.executable).parent))
    return [installed] if installed else [sys.executable, "-m", "spikelane"]
