"""Train a network on each preset, and test the networks on real recordings.

    python studies/src/networks/main.py --real FOLDER [--steps 1500] [--seeds 3] [--workers 14] [--markdown docs/why/networks.md]

Needs the package `spikelane`, torch, and a folder with `static_400x250x300.dat` and `lowlight_250x250x120.npz`. All presets
use the same light. In every epoch, each clip has a new fixed pattern and new noise.
"""

from __future__ import annotations

import argparse
import re
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.utils.data import DataLoader

import spikelane as sl
from spikelane.torch import SpikeClips

READOUTS, CROP, BATCH = 41, 64, 16
HEIGHT, WIDTH = 160, 256
DISTRIBUTION = "distribution"
"""Name of the training data in which each clip has a camera of `spikelane.CameraDistribution()`."""

TEACHERS = ("ideal", "neuspike", "physical", "scsim-code", "vidar-measured", "vidar-lowlight", DISTRIBUTION)
START, END = "<!-- networks: begin -->", "<!-- networks: end -->"


def scene(seed: int) -> NDArray[np.float32]:
    """Renders light (2, 5, H, W) of a drive through a random city from two instants on, at 2000 frames per second."""
    made = sl.Scene(seed, HEIGHT, WIDTH, lighting="noon", duration_s=1.0)
    return np.stack([np.minimum(made.clip(t, 5, 2000), 1.0) for t in (0.2, 0.8)])


def light(scenes: int) -> NDArray[np.float32]:
    """Returns clips (2 * scenes, 5, H, W) whose mean is log-uniform from 0.03 to 0.6 thresholds per readout."""
    with ProcessPoolExecutor() as pool:
        clips = np.concatenate(list(pool.map(scene, range(scenes))))
    bright = 0.03 * 20.0 ** np.random.default_rng(5).random(len(clips))
    mean = clips.mean(axis=(1, 2, 3))
    # Scales the mean of each clip. Light above full scale is clamped, because real recordings avoid overexposure.
    return np.minimum(clips * (bright / mean)[:, None, None, None], 1.0).astype(np.float32)


def span(spikes: Tensor) -> Tensor:
    """Returns the rate from the first to the last spike, (B, 1, H, W), or the mean rate for fewer than two spikes."""
    count = spikes.sum(dim=1, keepdim=True)
    times = torch.arange(spikes.shape[1], device=spikes.device)[None, :, None, None]
    fired = spikes > 0
    last = torch.where(fired, times, -1).amax(dim=1, keepdim=True)
    first = torch.where(fired, times, spikes.shape[1]).amin(dim=1, keepdim=True)
    return torch.where(count > 1, (count - 1) / (last - first).clamp(min=1), count / spikes.shape[1])


class Net(nn.Module):
    """A network of five layers that computes a correction of the span rate."""

    def __init__(self, channels: int = 24) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(READOUTS + 1, channels, 3, padding=1), nn.ReLU()]
        for _ in range(3):
            layers += [nn.Conv2d(channels, channels, 3, padding=1), nn.ReLU()]
        self.body = nn.Sequential(*layers, nn.Conv2d(channels, 1, 3, padding=1))

    def forward(self, spikes: Tensor) -> Tensor:
        start = span(spikes)
        scale = start.mean(dim=(2, 3), keepdim=True).clamp(min=1e-3)
        return start + scale * self.body(torch.cat([spikes, start / scale], dim=1))


def loader(clips: NDArray[np.float32], preset: str, seed: int, workers: int) -> tuple[SpikeClips, DataLoader[Any]]:
    if preset == DISTRIBUTION:
        # The clips already vary in brightness, equally for all training data, so the exposure of the cameras is constant.
        text = sl.CameraDistribution().to_toml()
        cameras = sl.CameraDistribution(re.sub("thresholds_at_full_scale = .*", "thresholds_at_full_scale = 1", text))
    else:
        # A distribution without ranges draws the same camera for every item, but each item has a new fixed pattern.
        cameras = sl.CameraDistribution(sl.Camera.preset(preset).to_toml().partition("[maps]")[0])
    data = SpikeClips(clips, cameras, 10, interpolation="linear", crop=(CROP, CROP), seed=seed, readouts=READOUTS)
    lasting = workers > 0
    return data, DataLoader(
        data, BATCH, shuffle=True, num_workers=workers, drop_last=True, persistent_workers=lasting, pin_memory=True
    )


def train(clips: NDArray[np.float32], preset: str, seed: int, steps: int, workers: int, device: str) -> tuple[Net, float]:
    """Returns a network after `steps` training steps, and the number of clips per second."""
    torch.manual_seed(seed)
    data, batches = loader(clips, preset, seed, workers)
    net = Net().to(device)
    optimizer = torch.optim.Adam(net.parameters(), lr=2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    done, epoch, start = 0, 0, time.monotonic()
    while done < steps:
        data.set_epoch(epoch)
        epoch += 1
        for batch in batches:
            spikes = batch["spikes"].to(device, non_blocking=True).float()
            rate = batch["light"].to(device, non_blocking=True)
            scale = rate.mean(dim=(1, 2, 3), keepdim=True).clamp(min=1e-3)
            loss = (((net(spikes) - rate) / scale) ** 2).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            done += 1
            if done == steps:
                break
    return net.eval(), steps * BATCH / (time.monotonic() - start)


def high(picture: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the difference between an image and its 5x5 mean, without a border of two pixels."""
    window = np.lib.stride_tricks.sliding_window_view(picture, (5, 5))
    return picture[2:-2, 2:-2] - window.mean(axis=(2, 3))


def score(found: NDArray[np.float64], truth: NDArray[np.float64]) -> tuple[float, float, float]:
    """Returns the PSNR after the best gain and offset, the preserved share of detail, and the relative noise."""
    gain, offset = np.polyfit(found.ravel(), truth.ravel(), 1)
    aligned = gain * found + offset
    peak = np.percentile(truth, 99.9)
    error = np.mean((aligned - truth) ** 2)
    fine, wanted = high(aligned).ravel(), high(truth).ravel()
    kept = float(fine @ wanted / (wanted @ wanted))
    return 10 * np.log10(peak**2 / error), kept, float(np.std(fine - kept * wanted) / truth.mean())


class Real:
    """A recording, divided into windows, with the mean of all readouts as ground truth."""

    def __init__(self, spikes: NDArray[np.uint8], rows: slice) -> None:
        starts = range(0, len(spikes) - READOUTS + 1, READOUTS)
        self.windows = torch.from_numpy(np.stack([spikes[s : s + READOUTS] for s in starts]))
        self.truth, self.rows = spikes.mean(axis=0, dtype=np.float64), rows

    @torch.no_grad()
    def mean_score(self, reconstruct: Any, device: str) -> NDArray[np.float64]:
        """Returns the mean score over all windows of the images that `reconstruct` computes."""
        pictures = [reconstruct(w[None].to(device).float())[0, 0].double().cpu().numpy() for w in self.windows]
        return np.mean([score(p[self.rows], self.truth[self.rows]) for p in pictures], axis=0)


def recordings(folder: Path) -> dict[str, Real]:
    static = sl.open_stream(folder / "static_400x250x300.dat", width=400, height=250)
    static = static.read_dense()
    dim = np.load(folder / "lowlight_250x250x120.npz")["spk"].astype(np.uint8)
    return {"still rows": Real(static, slice(100, 180)), "static": Real(static, slice(0, 250)), "low light": Real(dim, slice(0, 250))}


def pace(clips: NDArray[np.float32], workers: int, device: str) -> list[str]:
    """Returns a table row per network size, with the speed on one stored batch and on new streams."""
    rows = []
    for channels in (24, 96, 256):
        data, batches = loader(clips, "physical", 1, workers)
        net = Net(channels).to(device)
        optimizer = torch.optim.Adam(net.parameters())

        def step(batch: dict[str, Tensor]) -> None:
            spikes, rate = batch["spikes"].to(device).float(), batch["light"].to(device)
            loss = ((net(spikes) - rate) ** 2).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()

        def timed(source: Any) -> float:
            start, n = time.monotonic(), 0
            for batch in source:
                step(batch)
                n += 1
            if device == "cuda":
                torch.cuda.synchronize()
            return n / (time.monotonic() - start)

        kept = next(iter(batches))
        timed([kept] * 10)
        alone = timed([kept] * 200)
        fresh = 0.0
        for epoch in range(1, 6):
            data.set_epoch(epoch)
            fresh = max(fresh, timed(batches))
        rows.append(f"| {channels} | {alone:.0f} | {fresh:.0f} | {fresh / alone:.2f} | {fresh * BATCH:.0f} |")
    return rows


def table(arguments: argparse.Namespace) -> list[str]:
    device = "cuda" if torch.cuda.is_available() else "cpu"
    real, clips = recordings(arguments.real), light(arguments.scenes)
    where = torch.cuda.get_device_name() if device == "cuda" else "the CPU"
    words = f"{time.strftime('%Y-%m-%d')}, {where}, spikelane {sl.__version__}: {len(clips)} clips of {HEIGHT}x{WIDTH}, crops"
    lines = [f"{words} of {CROP}x{CROP}, {arguments.steps} steps of {BATCH}, {arguments.seeds} seeds.", ""]
    paces = pace(clips, arguments.workers, device)
    print("\n".join(paces), flush=True)
    lines.append("| trained on | " + " | ".join(f"{name}, dB | detail | noise e-3" for name in real) + " |")
    lines.append("|---|" + "--:|" * (3 * len(real)))

    def cells(all_scores: list[NDArray[np.float64]]) -> str:
        mean, sd = np.mean(all_scores, axis=0), np.std(all_scores, axis=0, ddof=1 if len(all_scores) > 1 else 0)
        return f"{mean[0]:.1f} +- {sd[0]:.1f} | {mean[1]:.2f} | {1e3 * mean[2]:.1f}"

    for preset in arguments.presets:
        found: dict[str, list[NDArray[np.float64]]] = {name: [] for name in real}
        for seed in range(1, arguments.seeds + 1):
            net, speed = train(clips, preset, seed, arguments.steps, arguments.workers, device)
            for name, recording in real.items():
                found[name].append(recording.mean_score(net, device))
            last_scores = ", ".join(f"{s[-1][0]:.2f} dB {s[-1][1]:.3f} {1e3 * s[-1][2]:.2f}" for s in found.values())
            print(f"{preset}, seed {seed}: {speed:.0f} clips/s, {last_scores}", flush=True)
        lines.append(f"| `{preset}` | " + " | ".join(cells(s) for s in found.values()) + " |")
    for name, of in (("span rate, no network", span), ("TFP", lambda s: s.mean(dim=1, keepdim=True))):
        lines.append(f"| {name} | " + " | ".join(cells([r.mean_score(of, device)]) for r in real.values()) + " |")
    lines += ["", f"Steps a second of {BATCH} crops, `physical`, {arguments.workers} workers:", ""]
    lines += ["| channels | the same batch again | fresh streams | share | clips/s |", "|--:|--:|--:|--:|--:|"]
    return lines + paces


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=144)
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=14)
    parser.add_argument("--presets", nargs="*", default=TEACHERS)
    parser.add_argument("--markdown", type=Path)
    arguments = parser.parse_args()
    lines = table(arguments)
    print("\n".join(lines))
    if arguments.markdown:
        text = arguments.markdown.read_text()
        before, after = text.partition(START)[0], text.partition(END)[2]
        arguments.markdown.write_text("\n".join([before + START, *lines, END]) + after)


if __name__ == "__main__":
    main()
