"""Trains the network of `learned_method.py` on simulated streams, and writes its weights.

    pip install . torch
    python bindings/python/examples/learned_train.py --clips clips.npy --output bindings/python/examples/learned_weights.npz

The program renders clips of light from random drives, or reads the clips if the file exists. Each training item is a new
stream of a clip with new noise. The light of a camera varies over two decades. The file `learned_weights.json` beside the
weights contains the settings and the digests of clips and weights.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import re
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from learned_method import BINS, CHANNELS, network_input, start_image
from numpy.typing import NDArray
from torch import Tensor, nn

import spikelane as sl
from spikelane.torch import SpikeClips

FIRST_SCENE, INSTANTS, FRAMES, FPS = 50_000, (0.4, 1.4, 2.4), 5, 2000
CROP, BATCH = 48, 8
SAMPLERS = (
    # share of the items, camera, range of thresholds per readout at full scale, readouts per bin
    (0.5, "physical", (0.004, 0.7), 1),
    (0.2, "physical", (0.0008, 0.12), 4),
    (0.3, "distribution", (0.015, 0.7), 1),
)


def render_clips(scenes: int) -> NDArray[np.uint16]:
    """Renders light (3 * scenes, 5, 250, 400) of random drives at 2000 frames per second; 65535 is white."""
    clips = []
    for seed in range(FIRST_SCENE, FIRST_SCENE + scenes):
        scene = sl.Scene(seed, duration_s=3.0)
        clips += [np.rint(65535 * np.clip(scene.clip(t, FRAMES, FPS), 0, 1)).astype(np.uint16) for t in INSTANTS]
        print(f"scene {seed - FIRST_SCENE + 1} of {scenes}: {scene.lighting}", flush=True)
    return np.stack(clips)


def camera_distribution(name: str, thresholds: tuple[float, float]) -> sl.CameraDistribution:
    """Returns cameras of a preset, or of all training cameras, whose light is log-uniform in a range."""
    if name == "distribution":
        text = sl.CameraDistribution().to_toml()
    else:
        text = sl.Camera.preset(name).to_toml().partition("[maps]")[0]
    light = f"thresholds_at_full_scale = {{ log_uniform = [{thresholds[0]}, {thresholds[1]}] }}"
    text, count = re.subn("thresholds_at_full_scale = .*", light, text)
    if count == 0:
        text = text.replace("[sensor]", f"[sensor]\n{light}")
    return sl.CameraDistribution(text)


class Items:
    """Batches of network inputs and light, determined by the seed and the step."""

    def __init__(self, clips: NDArray[np.uint16], seed: int) -> None:
        self.seed, self.length = seed, len(clips)
        self.data = [
            # The middle readout is the third frame.
            SpikeClips(
                clips,
                camera_distribution(name, thresholds),
                10 if bin_readouts == 1 else 41,
                crop=(CROP, CROP),
                seed=seed + index,
                readouts=BINS * bin_readouts,
                target_readouts=[BINS * bin_readouts // 2],
            )
            for index, (_, name, thresholds, bin_readouts) in enumerate(SAMPLERS)
        ]

    def batch(self, step: int) -> tuple[Tensor, Tensor, Tensor]:
        """Returns inputs (8, 43, 48, 48), and the images to correct and the light (8, 1, 48, 48)."""
        random = np.random.default_rng((self.seed, step))
        inputs, light = [], []
        for _ in range(BATCH):
            choice = random.choice(len(SAMPLERS), p=[share for share, *_ in SAMPLERS])
            self.data[choice].set_epoch(int(random.integers(1 << 30)))
            item: dict[str, Any] = self.data[choice][int(random.integers(self.length))]
            inputs.append(network_input(item["spikes"].numpy(), item["thresholds_at_full_scale"]))
            light.append(item["light"])
        starts = np.stack([start_image(x)[None] for x in inputs])
        return torch.from_numpy(np.stack(inputs)), torch.from_numpy(starts), torch.stack(light)


def make_network() -> nn.Sequential:
    """Returns five 3x3 convolutions, with a ReLU after each but the last. The output corrects `start_image`."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(CHANNELS):
        layers += [nn.Conv2d(inputs, outputs, 3, padding=1), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


def train(clips: NDArray[np.uint16], steps: int, schedule: int, seed: int, output: Path) -> dict[str, Any]:
    """Trains a network and writes its weights every 200 steps. Returns the mean error of the last 200 steps.

    `schedule` is the number of steps over which the learning rate rises and falls.
    """
    torch.manual_seed(seed)
    items, network = Items(clips, seed), make_network()
    last = network[-1]
    assert isinstance(last, nn.Conv2d) and last.bias is not None
    # The training starts with `start_image`.
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    rate = torch.optim.lr_scheduler.OneCycleLR(optimizer, 2e-3, total_steps=schedule, pct_start=0.1)
    errors: list[float] = []
    start = time.monotonic()
    for step in range(steps):
        inputs, starts, light = items.batch(step)
        square = ((starts + network(inputs) - light) ** 2).mean(dim=(1, 2, 3))
        # The mean of roots gives dark and bright items similar weights.
        loss = (square + 1e-6).sqrt().mean()
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call, unused-ignore]
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        rate.step()
        errors.append(loss.item())
        if (step + 1) % 200 == 0 or step + 1 == steps:
            recent = float(np.mean(errors[-200:]))
            print(f"step {step + 1}: RMS error {recent:.4f}, {time.monotonic() - start:.0f} s", flush=True)
            save(network, output)
    return {"rms_error": round(float(np.mean(errors[-200:])), 5), "seconds": round(time.monotonic() - start)}


def save(network: nn.Sequential, path: Path) -> None:
    """Writes the weights as float16 arrays `weight0`, `bias0` and so on."""
    layers = [layer for layer in network if isinstance(layer, nn.Conv2d)]
    arrays = {}
    for index, layer in enumerate(layers):
        assert layer.bias is not None
        arrays[f"weight{index}"] = layer.weight.detach().numpy().astype(np.float16)
        arrays[f"bias{index}"] = layer.bias.detach().numpy().astype(np.float16)
    with path.open("wb") as file:
        np.savez(file, **arrays)


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--clips", type=Path, required=True, help="read the clips from this file, or render and write it"
    )
    parser.add_argument("--output", type=Path, required=True, help="write the weights to this file (.npz)")
    parser.add_argument("--scenes", type=int, default=24, help="number of rendered scenes (default: 24)")
    parser.add_argument("--steps", type=int, default=1000, help="number of training steps (default: 1000)")
    parser.add_argument(
        "--schedule", type=int, help="steps of the learning rate (default: the number of training steps)"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of weights, crops and noise (default: 1)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    schedule = arguments.schedule or arguments.steps
    if not arguments.clips.exists():
        np.save(arguments.clips, render_clips(arguments.scenes))
    clips = np.load(arguments.clips, mmap_mode="r")
    result = train(clips, arguments.steps, schedule, arguments.seed, arguments.output)
    recipe = {
        "program": "learned_train.py",
        "seed": arguments.seed,
        "steps": arguments.steps,
        "schedule": schedule,
        "clips": len(clips),
        "clips_sha256": sha256(arguments.clips),
        "weights_sha256": sha256(arguments.output),
        "parameters": sum(a.size for a in np.load(arguments.output).values()),
        "spikelane": sl.__version__,
        "torch": torch.__version__,
        "system": platform.platform(terse=True),
        **result,
    }
    arguments.output.with_suffix(".json").write_text(json.dumps(recipe, indent=1) + "\n")


if __name__ == "__main__":
    main()
