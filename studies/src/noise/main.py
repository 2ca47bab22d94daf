"""Compare the blind noise of images from a real recording with images from simulated recordings of the same scene.

    python studies/src/noise/main.py --real FOLDER [--page docs/why/networks.md] [--program spikelane]

FOLDER contains `static_400x250x300.dat`, a recording of a static scene with 300 readouts. The mean of all its readouts is the
light of the simulated recordings, so the cameras differ only in their noise. `spikelane evaluate` prints the scores.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import subprocess
import tempfile
from pathlib import Path

CAMERAS = ("ideal", "physical", "vidar-measured", "neuspike", "scsim-code", "spikecv", "spike-zoo")
METHODS = ("tfp 41", "span 41")
SCORES = ("patch_noise", "weak_texture_noise", "snr_db", "detail_slope", "aligned_psnr_db")
DEFAULT_FULL_SCALE = 1.0
"""Thresholds per readout of light 1.0 of a preset that states no value."""

SEEDS, READOUTS = range(3), 300
START, END = "<!-- noise: begin -->", "<!-- noise: end -->"


def run(*command: object) -> str:
    return subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout


def scores(program: str, stream: Path, *layout: object) -> dict[str, dict[str, float]]:
    """Returns the scores of each method on the middle readout of a static recording."""
    text = run(program, "evaluate", stream, "--static-scene", "--window", 41, "--json", *layout)
    return {picture["method"]: picture["scores"] for picture in json.loads(text)["pictures"]}


def simulated(program: str, camera: str, light: Path, folder: Path, seed: int) -> dict[str, dict[str, float]]:
    """Returns the scores of a recording of `light`, whose values are thresholds per readout."""
    shown = run(program, "preset", "show", camera)
    found = re.search(r"^thresholds_at_full_scale = ([\d.e+-]+)", shown, re.MULTILINE)
    full_scale = found[1] if found else DEFAULT_FULL_SCALE
    stem = folder / f"{camera}-{seed}"
    # Input values are divided by the full scale.
    options = ("--full-scale", full_scale, "--width", 400, "--height", 250, "--readouts", READOUTS)
    seeds = ("--seed", seed, "--camera-seed", seed)
    run(program, "simulate", light, "-o", stem, "--camera", camera, *options, *seeds)
    return scores(program, stem.with_suffix(".dat"))


def row(name: str, runs: list[dict[str, float]]) -> str:
    """Returns a row of means. Two or more runs also have their standard deviation."""

    def cell(score: str) -> str:
        values = [run[score] * (1e3 if score.endswith("noise") else 1) for run in runs]
        digits = 2 if score in ("patch_noise", "weak_texture_noise", "detail_slope") else 1
        spread = f" +- {statistics.stdev(values):.{digits}f}" if len(values) > 1 else ""
        return f"{statistics.mean(values):.{digits}f}{spread}"

    return f"| {name} | " + " | ".join(cell(score) for score in SCORES) + " |"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--real", type=Path, required=True, help="folder with static_400x250x300.dat")
    arguments.add_argument("--page", type=Path, help="page whose table is replaced")
    arguments.add_argument("--program", default="spikelane")
    given = arguments.parse_args()
    program, recording = given.program, given.real / "static_400x250x300.dat"
    layout = ("--width", 400, "--height", 250, "--layout", "dat")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        light = folder / "light.npy"
        run(program, "reconstruct", recording, "--method", "tfp", "--window", READOUTS, "-o", light, *layout)
        real = scores(program, recording, *layout)
        cameras = {c: [simulated(program, c, light, folder, s) for s in SEEDS] for c in CAMERAS}
    lines = [f"{run(program, '--version').strip()}, {len(SEEDS)} seeds, window of 41 readouts:"]
    for method in METHODS:
        title = "TFP" if method.startswith("tfp") else "Span rate"
        lines += [
            "",
            f"| {title} of | Chen e-3 | Liu e-3 | SNR, dB | detail | static, dB |",
            "|---|--:|--:|--:|--:|--:|",
            row("real recording", [real[method]]),
        ]
        lines += [row(f"`{camera}`", [run[method] for run in runs]) for camera, runs in cameras.items()]
    table = "\n".join(lines)
    print(table)
    if given.page:
        page = given.page.read_text()
        head, rest = page.split(START)
        given.page.write_text(f"{head}{START}\n{table}\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
