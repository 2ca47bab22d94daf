"""SpikeCV and Spike-Zoo read files of this package, and this package reads their files, bit by bit.

The tests run functions of both tools. SPIKECV is the folder of a checkout of SpikeCV. SPIKEZOO is the folder of an unpacked
wheel of Spike-Zoo; without it, the tests use the installed package. SCSIM is the folder of a checkout of SCSim. The tools
import packages that these functions do not need, so the tests load each function from its file without these imports.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import spikelane as sl

SHAPES = [(6, 16, 24), (4, 250, 400)]


def load_names(path: Path, *names: str) -> SimpleNamespace:
    """Loads the functions and classes `names` of a file, without the imports of the file."""
    tree = ast.parse(path.read_text())
    tree.body = [node for node in tree.body if getattr(node, "name", None) in names]
    space: dict[str, Any] = {
        "np": np,
        "os": os,
        "osp": os.path,
        "warnings": warnings,
        "platform": __import__("platform"),
        "Literal": __import__("typing").Literal,
        "_platform_check_done": True,
        "torch": SimpleNamespace(from_numpy=lambda x: x),
    }
    exec(compile(tree, str(path), "exec"), space)
    return SimpleNamespace(**{name: space[name] for name in names})


@pytest.fixture
def zoo() -> SimpleNamespace:
    root = os.environ.get("SPIKEZOO")
    if root is None:
        found = importlib.util.find_spec("spikezoo")
        if found is None or found.origin is None:
            pytest.skip("Spike-Zoo is not installed: pip install spikezoo, or SPIKEZOO=folder of its package")
        root = str(Path(found.origin).parent)
    return load_names(Path(root) / "utils" / "spike_utils.py", "load_vidar_dat", "save_vidar_dat")


@pytest.fixture
def cv() -> SimpleNamespace:
    root = os.environ.get("SPIKECV")
    if root is None:
        pytest.skip("SpikeCV is missing: SPIKECV=folder of a checkout")
    data = Path(root) / "SpikeCV" / "spkData"
    space = load_names(data / "load_dat.py", "SpikeStream")
    space.SpikeToRaw = load_names(data / "save_dat.py", "SpikeToRaw").SpikeToRaw
    return space


@pytest.mark.parametrize("shape", SHAPES)
def test_spike_zoo_and_python_read_each_other(zoo, tmp_path, shape):
    bits = np.random.default_rng(3).integers(0, 2, shape, np.uint8)
    sl.write_stream(tmp_path / "a.dat", bits)
    np.testing.assert_array_equal(zoo.load_vidar_dat(tmp_path / "a.dat", shape[1], shape[2]), bits)
    zoo.save_vidar_dat(str(tmp_path / "b.dat"), bits)
    np.testing.assert_array_equal(
        sl.open_stream(tmp_path / "b.dat", height=shape[1], width=shape[2]).read_dense(), bits
    )
    assert (tmp_path / "a.dat").read_bytes() == (tmp_path / "b.dat").read_bytes()


@pytest.mark.parametrize("shape", SHAPES)
def test_spikecv_and_python_read_each_other(cv, tmp_path, shape):
    bits = np.random.default_rng(4).integers(0, 2, shape, np.uint8)
    sl.write_stream(tmp_path / "a.dat", bits)
    stream = cv.SpikeStream(
        filepath=str(tmp_path / "a.dat"), spike_h=shape[1], spike_w=shape[2], print_dat_detail=False
    )
    np.testing.assert_array_equal(stream.get_spike_matrix(), bits)
    block = stream.get_block_spikes(begin_idx=1, block_len=2)
    np.testing.assert_array_equal(block, bits[1:3])
    try:
        cv.SpikeToRaw(str(tmp_path / "b.dat"), bits)
    except ValueError as error:
        # If a frame fills whole bytes, the writer of SpikeCV appends eight zeros, and its reshape fails.
        assert "reshape" in str(error)
        return
    np.testing.assert_array_equal(
        sl.open_stream(tmp_path / "b.dat", height=shape[1], width=shape[2]).read_dense(), bits
    )


def test_examples_run(tmp_path):
    sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
    try:
        import spikecv_stream
    finally:
        sys.path.pop(0)
    spikes = spikecv_stream.write(tmp_path)
    np.testing.assert_array_equal(sl.open_stream(tmp_path / "light.dat").read_dense(), spikes)
    raw = np.fromfile(tmp_path / "light.dat", np.uint8).reshape(spikes.shape[0], -1)
    frames = np.unpackbits(raw, axis=1, bitorder="little").reshape(spikes.shape)
    np.testing.assert_array_equal(frames[:, ::-1], spikes.to_dense())


def photo(folder: Path) -> Path:
    image = pytest.importorskip("PIL.Image", reason="Pillow writes the image")
    rows, columns = np.mgrid[0:48, 0:80]
    waves = [128 + 127 * np.sin(columns / 9 + k) * np.cos(rows / (7 + k)) for k in range(3)]
    image.fromarray(np.stack(waves, axis=-1).astype(np.uint8)).save(folder / "photo.png")
    return folder / "photo.png"


@pytest.mark.parametrize("simulator", ["spikezoo", "spikecv", "spikecv-image", "scsim"])
def test_presets_agree_with_the_published_code(simulator, tmp_path):
    variable = simulator.removesuffix("-image").upper()
    if variable not in os.environ:
        pytest.skip(f"{variable}=folder of a checkout is not set")
    pytest.importorskip("cv2", reason="the published code needs OpenCV")
    command = [sys.executable, "-m", "spikelane", "check", simulator, str(photo(tmp_path)), "--python", sys.executable]
    command += ["--code", os.environ[variable], "--readouts", "120", "--json"]
    command += ["--crop", "32x24", "--runs", "2"] if simulator == "scsim" else []
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert json.loads(ran.stdout.splitlines()[-1])["agrees"]
