"""Measure the speed of the Python package, the program and other tools, and print a table.

    python bindings/python/bench.py [--spikezoo FOLDER] [--spikecv FOLDER] [--markdown docs/why/performance.md]

The FOLDER of Spike-Zoo is an unpacked package (default: the installed package). The FOLDER of SpikeCV is a checkout.
`--markdown` replaces the table between the markers in a file. SPIKELANE is the program (default: that of this package).
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import spikelane as sl

BEGIN, END = "<!-- python: begin -->", "<!-- python: end -->"


def best(work: Callable[[], object], seconds: float = 1.5, min_runs: int = 3) -> float:
    """Returns the duration of the fastest of several runs, because other processes slow single runs down."""
    times: list[float] = []
    start = time.perf_counter()
    while len(times) < min_runs or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        work()
        times.append(time.perf_counter() - before)
    return min(times)


def load_function(path: Path, name: str, **space: Any) -> Callable[..., Any]:
    """Loads a function from a file without the imports of the file."""
    tree = ast.parse(path.read_text())
    tree.body = [node for node in tree.body if getattr(node, "name", None) == name]
    exec(compile(tree, str(path), "exec"), space)
    return space[name]


def replace_between_markers(page: Path, begin: str, end: str, text: str) -> None:
    """Replaces the text between two markers of a page."""
    before, rest = page.read_text().split(begin)
    page.write_text(f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}")


class Table:
    def __init__(self) -> None:
        self.rows: list[tuple[str, str, str]] = []

    def row(self, what: str, value: str, beside: str = "") -> None:
        self.rows.append((what, value, beside))

    def text(self) -> str:
        lines = ["| work | speed | compared with |", "|---|--:|---|"]
        lines += [f"| {' | '.join(row)} |" for row in self.rows]
        return "\n".join(lines)


def one_stream(table: Table) -> None:
    """Measures one call with 4000 readouts of 400x250 pixels, constant light and the camera of the `speed` command."""
    program = os.environ.get("SPIKELANE")
    command = [program] if program else [sys.executable, "-m", "spikelane"]
    typical = {
        "start_phase": {},
        "saturation_clamp": {},
        "prnu": {},
        "dark_current": {},
        "bias_voltage": {},
        "shot_noise": {},
        "thermal_noise": {"noise_sampling": "every-readout"},
    }
    camera = sl.Camera.ideal(250, 400, 40_000)
    for name, own in typical.items():
        known = sl.effects()[name]["parameters"]
        camera = camera.with_effect(name, **{**{key: p["typical"] for key, p in known.items()}, **own})
    light = (60 + np.arange(100_000) * 7 % 40).astype(np.uint8).reshape(250, 400)
    out = np.empty((4000, 12_500), np.uint8)
    simulator = sl.Simulator(camera)
    seconds = best(lambda: simulator.fill(light, out), 3)
    with tempfile.TemporaryDirectory() as folder:
        command += ["--json", "speed", "--quick", "--work-dir", folder]
        finished = subprocess.run(command, capture_output=True, text=True, check=True)
    # The load of the machine changes, so the work runs again after the program and the faster result counts.
    seconds = min(seconds, best(lambda: simulator.fill(light, out), 3))
    python = 4000 * 100_000 / seconds / 1e9
    rows = json.loads(finished.stdout.splitlines()[-1])["speeds"]

    def speed(work: str) -> float:
        same = [r for r in rows if (r["work"], r["noise"], r["light"], r["threads"]) == (work, "full noise", "held", 1)]
        return max(r["gpixel_readouts_per_s"] for r in same)

    kernel, frames = speed("kernel"), speed("frames in memory")
    table.row(
        "400x250 x 4000 readouts, full noise, held, one call",
        f"{python:.2f} Gpixel-readouts/s",
        f"{python / kernel:.2f} of the kernel, {python / frames:.2f} of frames in memory",
    )


def ratio_words(packed: float, unpacked: float) -> str:
    """Returns the speed ratio of this package to another tool as text."""
    return f"packed {packed:.1f}, bytes {unpacked:.1f} times faster"


def crops(table: Table, spikezoo: Path | None, spikecv: Path | None) -> None:
    """Measures 64 crops of 96x96x41 with a new frame at every readout, one plan of `physical` and new seeds per crop."""
    camera = sl.Camera.preset("physical").with_shape(96, 96)
    clips = np.random.default_rng(2).integers(0, 200, (64, 41, 96, 96), np.uint8)
    turn = [0]

    def run(dense: bool, out: np.ndarray) -> None:
        turn[0] += 64
        sl.simulate_batch(camera, clips, sequences=range(turn[0], turn[0] + 64), dense=dense, out=out)

    packed, bits = np.empty((64, 41, 1152), np.uint8), np.empty((64, 41, 96, 96), np.uint8)
    times = {"packed": best(lambda: run(False, packed)), "one byte per pixel": best(lambda: run(True, bits))}
    for name, seconds in times.items():
        table.row(f"64 crops of 96x96x41, `physical`, new seeds, {name}", f"{64 / seconds:.0f} crops/s")
    clean, twins = camera.clean_twin(), np.empty_like(bits)

    def with_truth() -> list[np.ndarray]:
        run(True, bits)
        sl.simulate_batch(clean, clips, sequences=range(turn[0], turn[0] + 64), out=twins)
        return [sl.light_at(clip, [20]) for clip in clips]

    pairs = 64 / best(with_truth)
    table.row("the same as bytes, with the noise-free twin and the light of the middle readout", f"{pairs:.0f} crops/s")
    full = clips[:16].astype(np.float64) / 255

    def peer(name: str, work: Callable[[np.ndarray], object]) -> None:
        seconds = best(lambda: [work(clip) for clip in full]) * 4
        words = ratio_words(*(seconds / ours for ours in times.values()))
        table.row(f"{name}, without noise", f"{64 / seconds:.0f} crops/s", words)

    if spikezoo:
        simulate = load_function(spikezoo / "utils" / "spike_utils.py", "video2spike_simulation", np=np)
        peer("Spike-Zoo `video2spike_simulation` (NumPy)", lambda clip: simulate(clip, 1.0))
    else:
        table.row("Spike-Zoo", "not measured", "not installed")
    try:
        import torch
    except ImportError:
        table.row("integrate and fire in torch on the CPU", "not measured", "torch is not installed")
    else:

        def in_torch(clip: np.ndarray) -> torch.Tensor:
            """The same loop on tensors, in the fastest form for torch."""
            light, charge = torch.from_numpy(clip).float(), torch.rand(96, 96)
            spikes = torch.empty(clip.shape, dtype=torch.uint8)
            for t in range(clip.shape[0]):
                charge += light[t]
                fired = charge >= 1
                charge -= fired.to(charge.dtype)
                spikes[t] = fired
            return spikes

        peer("the same loop in torch on the CPU", in_torch)
    if spikecv:
        # The published function uses `np.float`, which NumPy has removed.
        space = {name: getattr(np, name) for name in ("zeros_like", "zeros")} | {"float": float}
        from types import SimpleNamespace

        convert = load_function(
            spikecv / "SpikeCV" / "spkData" / "convert_img.py", "img_to_spike", np=SimpleNamespace(**space)
        )
        seconds = best(lambda: [convert(clip[0], 1.0, 1.0, 41) for clip in full]) * 4
        held = clips[:, :1]
        ours = best(
            lambda: sl.simulate_batch(
                camera, held, 41, sequences=range(64), interpolation="hold", dense=False, out=packed
            )
        )
        unpacked = best(
            lambda: sl.simulate_batch(camera, held, 41, sequences=range(64), interpolation="hold", out=bits)
        )
        table.row(
            "SpikeCV `img_to_spike`, one image held, without noise",
            f"{64 / seconds:.0f} crops/s",
            ratio_words(seconds / ours, seconds / unpacked),
        )
    else:
        table.row("SpikeCV", "not measured", "not installed")


def calls(table: Table) -> None:
    """Measures calls of one readout of 8x8 pixels, compared with one call for all readouts."""
    camera = sl.Camera.ideal(8, 8)
    light, out = np.full((8, 8), 100, np.uint8), np.empty((1, 8), np.uint8)
    simulator, many = sl.Simulator(camera), 20_000

    def loop() -> None:
        fill = simulator.fill
        for _ in range(many):
            fill(light, out)

    whole = np.empty((many, 8), np.uint8)
    each = best(loop) / many
    together = best(lambda: simulator.fill(light, whole)) / many
    table.row(
        "overhead of a call of one readout, 8x8",
        f"{1e6 * (each - together):.2f} us",
        f"{1e6 * together:.3f} us per readout in one call",
    )


def training(table: Table) -> None:
    """Measures batches of 32 crops of 64x64x41 with new noise, from clips of 80x128 pixels and one plan of `physical`.

    The native rate is that of one thread that simulates such crops without any loader.
    """
    try:
        from torch.utils.data import DataLoader

        from spikelane.torch import SpikeClips, SpikeLoader
    except ImportError:
        table.row("batches for training", "not measured", "torch is not installed")
        return
    count, batch = 512, 32
    clips = np.random.default_rng(3).integers(0, 200, (count, 5, 80, 128), np.uint8)
    camera = sl.Camera.preset("physical").with_shape(80, 128)
    data = SpikeClips(clips, camera, 10, crop=(64, 64), readouts=41)
    parts = [clips[i, :, :64, :64] for i in range(batch)]
    turn = [0]

    def native() -> None:
        turn[0] += batch
        windows = [(0, 0)] * batch
        sl.simulate_batch(camera, parts, 10, sequences=range(turn[0], turn[0] + batch), windows=windows, readouts=41)

    seconds = best(native) / batch
    table.row("crops of 64x64x41 of one plan of 80x128 pixels, one thread, no loader", f"{1 / seconds:.0f} crops/s")

    def epoch(batches: Any, number: int) -> float:
        data.set_epoch(number)
        start = time.perf_counter()
        for _ in batches:
            pass
        return time.perf_counter() - start

    loaders = {f"DataLoader, {n} worker processes": DataLoader(data, batch, num_workers=n) for n in (0, 1, 2)}
    loaders |= {f"SpikeLoader, threads={n}": SpikeLoader(data, batch, threads=n) for n in (1, 2)}
    for name, batches in loaders.items():
        rate = count / min(epoch(batches, number) for number in range(3))
        table.row(name, f"{rate:.0f} crops/s", f"{rate * seconds:.2f} of the rate above")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spikezoo", type=Path)
    parser.add_argument("--spikecv", type=Path)
    parser.add_argument("--markdown", type=Path)
    arguments = parser.parse_args()
    found = importlib.util.find_spec("spikezoo")
    if arguments.spikezoo is None and found is not None and found.origin:
        arguments.spikezoo = Path(found.origin).parent
    table = Table()
    one_stream(table)
    crops(table, arguments.spikezoo, arguments.spikecv)
    calls(table)
    training(table)
    where = f"CPython {platform.python_version()}, NumPy {np.__version__}, spikelane {sl.__version__}, one thread"
    text = f"{where}, the fastest of several runs.\n\n{table.text()}"
    print(text)
    if arguments.markdown:
        replace_between_markers(arguments.markdown, BEGIN, END, text)


if __name__ == "__main__":
    main()
