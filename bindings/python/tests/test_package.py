"""The whole package: help, stubs, the command and development mode."""

from __future__ import annotations

import importlib.util
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import spikelane as sl

PACKAGE = Path(sl.__file__).parent


def members() -> list[tuple[str, object]]:
    named = [(name, getattr(sl, name)) for name in sl.__all__ if name != "__version__"]
    for cls in (sl.Camera, sl.CameraDistribution, sl.Simulator, sl.SpikeFrames, sl.Stream, sl.Scene, sl.ClipSampler):
        own = [n for n in vars(cls) if not n.startswith("_")]
        named += [(f"{cls.__name__}.{n}", getattr(cls, n)) for n in own]
    return named


@pytest.mark.parametrize(("name", "thing"), members(), ids=lambda x: x if isinstance(x, str) else "")
def test_everything_has_help(name, thing):
    text = inspect.getdoc(thing)
    assert text and len(text) > 8, name


def test_docstrings_of_functions_name_shapes_dtypes_and_errors():
    run = (sl.Simulator.run, sl.SpikeFrames.from_packed, sl.SpikeFrames.from_dense)
    for function in (*run, sl.simulate_batch, sl.unpack, sl.pack, sl.write_stream):
        text = inspect.getdoc(function) or ""
        assert "uint8" in text and "Raises" in text, function


def test_package_and_program_have_the_same_version(program):
    done = subprocess.run([*program, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.split()[1] == sl.__version__


def test_the_package_contains_the_command(tmp_path):
    command = [sys.executable, "-m", "spikelane"]
    assert subprocess.run([*command, "effects", "prnu"], capture_output=True, check=False).returncode == 0
    assert subprocess.run([*command, "efects"], capture_output=True, check=False).returncode == 2
    missing = subprocess.run([*command, "inspect", tmp_path / "no.dat"], capture_output=True, check=False)
    assert missing.returncode == 5


def test_stubs_match_the_module():
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed: pip install mypy")
    command = [sys.executable, "-m", "mypy.stubtest", "spikelane._native"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_development_mode_reports_nothing(tmp_path):
    code = """
import gc, numpy as np, pickle, spikelane as sl
camera = pickle.loads(pickle.dumps(sl.Camera.preset("physical").with_shape(12, 20)))
simulator = sl.Simulator(camera, threads=2)
light = np.full((3, 12, 20), 90, np.uint8)
spikes = simulator.run(light, readouts_per_frame=10)
for wrong in (None, light.astype(float), light[:, :3], light[0, 0], light):
    try:
        simulator.run(wrong, 10)
    except sl.SpikelaneError:
        pass
    else:
        raise SystemExit("no error")
sl.write_stream("a.dat", spikes)
with sl.open_stream("a.dat") as stream:
    assert (stream.read_dense() == spikes.to_dense()).all()
assert pickle.loads(pickle.dumps(spikes)) == spikes
sl.simulate_batch(camera, [light] * 4, sequences=range(4), threads=2)
gc.collect()
"""
    command = [sys.executable, "-X", "dev", "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
