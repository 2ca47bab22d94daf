"""Tests of the example methods for benchmarks: the learned network and the methods of Spike-Zoo."""

from __future__ import annotations

import hashlib
import importlib
import json
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import spikelane as sl
from spikelane import benchmark

EXAMPLES = Path(__file__).parents[1] / "examples"

SUITE = """
format_version = 1
name = "dim"
version = "0.1.0"
description = "Small dim images for tests"
scene_version = 3
release = "0.1.0"
task = "reconstruction"
metrics = ["psnr/1", "psnr_as_spike_zoo/1"]
dataset.scenes = { images_per_scene = 41, label_every = 0, samples = 4, vehicles = 0 }
dataset.images = { every = 20, format = "f32" }
[dataset.camera]
preset = "physical"
sensor = { width = 64, height = 40, thresholds_at_full_scale = 0.018 }
[[splits]]
name = "test"
seed = 21
sequences = 2
"""


@pytest.fixture
def example(monkeypatch):
    """Returns a function that imports an example."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module


def tfp(sequence: benchmark.BenchmarkSequence) -> np.ndarray:
    return sl.tfp(sequence.read(), *sequence.shape, at=sequence.readout, half_window=20) / sequence.white_rate


@pytest.fixture(scope="module")
def dim(tmp_path_factory):
    """Returns the folder of a generated dim suite, and the scores of the mean of 41 readouts."""
    folder = tmp_path_factory.mktemp("dim")
    (folder / "dim.toml").write_text(SUITE)
    return folder / "data", benchmark.evaluate(tfp, folder / "dim.toml", data=folder / "data", output=folder / "tfp")


def run_server(data: Path, output: Path, *command: str | Path) -> benchmark.BenchmarkScores:
    program = [sys.executable, "-m", "spikelane", "benchmark", "run", str(data), "-o", str(output), "--server"]
    subprocess.run([*program, shlex.join(map(str, command))], check=True, capture_output=True)
    return benchmark.BenchmarkScores.read(output / "score.json")


def test_the_weights_are_those_of_the_recipe():
    path = EXAMPLES / "learned_weights.npz"
    recipe = json.loads(path.with_suffix(".json").read_text())
    assert hashlib.sha256(path.read_bytes()).hexdigest() == recipe["weights_sha256"]
    assert path.stat().st_size < 1_000_000


def test_the_convolution_equals_a_plain_loop(example):
    random = np.random.default_rng(1)
    x = random.normal(size=(3, 5, 6)).astype(np.float32)
    weight, bias = random.normal(size=(2, 3, 3, 3)).astype(np.float32), np.array([0.5, -1], np.float32)
    padded = np.pad(x, ((0, 0), (1, 1), (1, 1)))
    expected = np.zeros((2, 5, 6))
    for out, row, col in np.ndindex(expected.shape):
        expected[out, row, col] = bias[out] + np.sum(weight[out] * padded[:, row : row + 3, col : col + 3])
    # Sums of 27 products of numbers below 10 in single precision.
    found = example("learned_method").convolution(x, weight, bias)
    np.testing.assert_allclose(found, expected, atol=27 * 100 * 2.0**-24)


def test_the_blur_keeps_the_mean_and_has_the_stated_noise(example):
    # A blur of s pixels divides the variance of white noise by 4 pi s^2. The 10,000 values have about 10,000 / (4 pi s^2)
    # independent parts, whose variance is known to 1 / sqrt(2 * 10,000 / (4 pi s^2)), here 7 %. The limit is five times this.
    noise = np.random.default_rng(3).normal(size=(100, 100)).astype(np.float32)
    blurred = example("learned_method").gaussian_blur(noise, 2.0)[10:-10, 10:-10]
    assert blurred.var() == pytest.approx(1 / (16 * np.pi), rel=0.35)
    flat = np.full((9, 30), 0.25, np.float32)
    np.testing.assert_allclose(example("learned_method").gaussian_blur(flat, 5.0), flat, rtol=1e-6)


def test_the_learned_method_exceeds_the_spike_count_in_dim_light(dim, tmp_path):
    data, counted = dim
    learned = run_server(data, tmp_path / "learned", sys.executable, EXAMPLES / "learned_method.py")
    assert not learned.faults
    assert learned.overall["psnr"].value > counted.overall["psnr"].value


def test_the_trained_network_equals_the_numpy_network(example):
    torch = pytest.importorskip("torch", reason="torch trains the network")
    method, train = example("learned_method"), example("learned_train")
    network = method.Network(EXAMPLES / "learned_weights.npz")
    spikes = (np.random.default_rng(2).random((41, 24, 32)) < 0.1).astype(np.uint8)
    trained = train.make_network()
    layers = [layer for layer in trained if isinstance(layer, torch.nn.Conv2d)]
    with torch.no_grad():
        for layer, (weight, bias) in zip(layers, network.layers, strict=True):
            layer.weight.copy_(torch.from_numpy(weight))
            layer.bias.copy_(torch.from_numpy(bias))
        inputs = method.network_input(spikes, 0.5)
        expected = method.start_image(inputs) + trained(torch.from_numpy(inputs)[None])[0, 0].numpy()
    # Both programs compute in single precision: five layers with sums of up to 1152 products.
    np.testing.assert_allclose(network.image(spikes, 20, 0.5), expected, atol=1e-4)


def test_the_scores_of_spike_zoo_equal_a_direct_computation(dim, tmp_path):
    pytest.importorskip("spikezoo", reason="pip install spikezoo")
    data, counted = dim
    zoo = run_server(data, tmp_path / "zoo", sys.executable, EXAMPLES / "spikezoo_method.py", "tfp")
    assert not zoo.faults
    # Both images are the mean of the same 41 readouts, rounded to single precision.
    assert zoo.overall["psnr"].value == pytest.approx(counted.overall["psnr"].value, abs=1e-5)
    errors = []
    for output in sorted((tmp_path / "zoo" / "outputs" / "test").glob("*.npy")):
        reference = np.load(data / "groups" / "test" / "sequences" / output.stem / "images" / "000020.npy")
        errors.append(np.mean((np.load(output).clip(0, 1).astype(float) - reference.clip(0, 1)) ** 2))
    assert zoo.overall["psnr"].value == pytest.approx(np.mean(-10 * np.log10(errors)), abs=1e-4)
