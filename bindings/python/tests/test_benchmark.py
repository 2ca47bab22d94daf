"""Tests of `spikelane.benchmark`."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import spikelane as sl
from spikelane import benchmark

SUITE = """
format_version = 1
name = "tiny"
version = "0.1.0"
description = "Small images for tests"
scene_version = 3
release = "0.1.0"
task = "reconstruction"
metrics = ["psnr/1", "ssim/1"]
dataset.scenes = { images_per_scene = 9, label_every = 0, samples = 4, vehicles = 0 }
dataset.images = { every = 4, format = "f32" }
[dataset.camera]
preset = "physical"
sensor = { width = 48, height = 32, thresholds_at_full_scale = 0.6 }
[[splits]]
name = "test"
seed = 5
sequences = 4
"""


@pytest.fixture
def suite(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(SUITE)
    return path


def tfp(sequence: benchmark.BenchmarkSequence) -> np.ndarray:
    assert sequence.read_dense().shape == (sequence.readouts, *sequence.shape)
    image = sl.tfp(sequence.read(), *sequence.shape, at=sequence.readout, half_window=4)
    return image / sequence.white_rate


def test_the_psnr_of_a_function_equals_a_direct_computation(suite, tmp_path):
    data = tmp_path / "data"
    images = []

    def method(sequence):
        assert sorted(path.name for path in sequence.path.parent.iterdir()) == ["stream.dat", "stream.json"]
        images.append(tfp(sequence))
        return images[-1]

    scores = benchmark.evaluate(method, suite, data=data, output=tmp_path / "run")
    assert not scores.faults
    paths = sorted(data.glob("groups/test/sequences/*/images/000004.npy"))
    pairs = zip(images, map(np.load, paths), strict=True)
    errors = [np.mean((image.clip(0, 1).astype(float) - reference.clip(0, 1)) ** 2) for image, reference in pairs]
    assert scores.overall["psnr"].value == pytest.approx(np.mean(-10 * np.log10(errors)), abs=1e-4)
    program = [sys.executable, "-m", "spikelane", "benchmark", "verify", str(scores.path), "--suite", str(data)]
    subprocess.run(program, check=True, capture_output=True)


def test_the_order_of_an_array_in_memory_does_not_matter(suite, tmp_path):
    arguments = {"suite": suite, "data": tmp_path / "data"}
    rows = benchmark.evaluate(tfp, output=tmp_path / "rows", **arguments)
    columns = benchmark.evaluate(lambda s: np.asfortranarray(tfp(s)), output=tmp_path / "columns", **arguments)
    assert not columns.faults
    assert columns.overall == rows.overall


def test_a_faulty_answer_costs_only_its_own_sequence(suite, tmp_path):
    calls = []

    def method(sequence):
        calls.append(sequence.path)
        if len(calls) == 1:
            raise ZeroDivisionError("two\nlines")
        if len(calls) == 2:
            return np.full((sequence.height, sequence.width), np.nan)
        if len(calls) == 3:
            return np.zeros((3, 3))
        return tfp(sequence)

    scores = benchmark.evaluate(method, suite, data=tmp_path / "data", output=tmp_path / "run")
    assert sorted(scores.faults) == [f"test/scene-000{i}" for i in range(3)]
    assert "ZeroDivisionError: two lines" in scores.faults["test/scene-0000"]
    assert len(calls) == 4


def test_an_interrupted_run_continues_after_the_last_finished_sequence(suite, tmp_path):
    calls = []

    def method(sequence):
        calls.append(sequence.path)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return tfp(sequence)

    arguments = {"data": tmp_path / "data", "output": tmp_path / "run", "name": "interrupted"}
    with pytest.raises(KeyboardInterrupt):
        benchmark.evaluate(method, suite, **arguments)
    assert not (tmp_path / "run" / "score.json").exists()
    with pytest.raises(sl.SpikelaneFileExistsError, match="resume"):
        benchmark.evaluate(method, suite, **arguments)
    scores = benchmark.evaluate(method, suite, resume=True, **arguments)
    assert not scores.faults
    assert len(calls) == 5


def test_another_suite_in_the_folder_is_refused(suite, tmp_path):
    benchmark.evaluate(tfp, suite, data=tmp_path / "data", output=tmp_path / "run")
    with pytest.raises(sl.SpikelaneError, match="tiny"):
        benchmark.evaluate(tfp, "quick", data=tmp_path / "data", output=tmp_path / "other")
    other = tmp_path / "other.toml"
    other.write_text(SUITE.replace("seed = 5", "seed = 6"))
    with pytest.raises(sl.SpikelaneError, match=r"other\.toml"):
        benchmark.evaluate(tfp, other, data=tmp_path / "data", output=tmp_path / "other")
