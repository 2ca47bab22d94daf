"""Train a small network that reconstructs images from spikes, on random cameras with new noise.

    python train.py [--seconds 120] [--threads 2]

Every epoch simulates new recordings. After training, the program compares the network with counting (TFP) on new cameras
and scenes.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch
from torch import nn

import spikelane as sl
from spikelane.torch import SpikeClips, SpikeLoader

READOUTS, CROP = 41, 48


def clips(seeds: range, height: int = 80, width: int = 128) -> np.ndarray:
    """Renders drives through random cities: float32 (B, 5, H, W) at 2000 frames per second."""
    made = []
    for seed in seeds:
        scene = sl.Scene(seed, height, width, lighting="noon", duration_s=1.0)
        made += [scene.clip(t, 5, 2000) for t in (0.2, 0.8)]
    return np.minimum(np.stack(made), 1.0)


class Net(nn.Module):
    """Computes spikes per readout (B, 1, H, W) from spikes (B, T, H, W), as a correction of the spike count."""

    def __init__(self, channels: int = 32) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(READOUTS + 1, channels, 3, padding=1), nn.ReLU()]
        for _ in range(2):
            layers += [nn.Conv2d(channels, channels, 3, padding=1), nn.ReLU()]
        self.body = nn.Sequential(*layers, nn.Conv2d(channels, 1, 3, padding=1))

    def forward(self, spikes: torch.Tensor) -> torch.Tensor:
        count = spikes.mean(dim=1, keepdim=True)
        return count + self.body(torch.cat([spikes, count], dim=1))


def batch_of(batch: dict) -> tuple[torch.Tensor, torch.Tensor]:
    """Returns the spikes, and the rate of an ideal camera with the same exposure."""
    exposure = batch["thresholds_at_full_scale"].float()[:, None, None, None]
    return batch["spikes"].float(), batch["light"] * exposure


def loader(seeds: range, seed: int, threads: int | None) -> tuple[SpikeClips, SpikeLoader]:
    data = SpikeClips(
        clips(seeds),
        sl.CameraDistribution(),
        10,
        interpolation="linear",
        crop=(CROP, CROP),
        seed=seed,
        readouts=READOUTS,
        target_readouts=[READOUTS // 2],
        camera_count=32,
    )
    return data, SpikeLoader(data, 8, threads=threads)


@torch.no_grad()
def error(net: nn.Module | None, batches: SpikeLoader) -> float:
    """Returns the RMS of the relative error of `net` over all batches, or of counting if `net` is None."""
    squares = []
    for batch in batches:
        spikes, rate = batch_of(batch)
        found = spikes.mean(dim=1, keepdim=True) if net is None else net(spikes)
        scale = rate.mean(dim=(1, 2, 3), keepdim=True)
        squares.append((((found - rate) / scale) ** 2).mean())
    return float(torch.stack(squares).mean().sqrt())


def train(seconds: float, threads: int | None = None) -> tuple[float, float]:
    """Trains for `seconds` and returns the errors of counting and of the network."""
    torch.manual_seed(1)
    data, batches = loader(range(6), 1, threads)
    _, unseen = loader(range(100, 102), 2, threads)
    net = Net()
    optimizer = torch.optim.Adam(net.parameters(), lr=2e-3)
    start, epoch, steps = time.monotonic(), 0, 0
    while time.monotonic() - start < seconds:
        data.set_epoch(epoch)
        for batch in batches:
            spikes, rate = batch_of(batch)
            scale = rate.mean(dim=(1, 2, 3), keepdim=True)
            loss = ((net(spikes) - rate) / scale).abs().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            steps += 1
        epoch += 1
    print(f"{epoch} epochs, {steps} steps")
    return error(None, unseen), error(net, unseen)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--threads", type=int, help="threads that simulate (default: all processors)")
    arguments = parser.parse_args()
    counting, network = train(arguments.seconds, arguments.threads)
    print(f"relative error on new cameras and scenes: counting {counting:.3f}, network {network:.3f}")
