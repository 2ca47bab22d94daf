"""Measure the speed of alternative tools on the same clip, and print a table of ratios.

    python bindings/python/peers.py [--spikecv FOLDER] [--scsim FOLDER] [--v2e FOLDER] [--markdown docs/why/performance.md]

The script installs the tools in target/peers: Spike-Zoo and visionsim with pip, and SpikeCV, SCSim and v2e as checkouts
unless a folder is given. If an installation fails, the script skips the tool and the table contains the reason. Each tool
runs on one thread, with its light in memory or in PNG files as the tool requires. SPIKELANE is the program (default: that
of this package).
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import struct
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

# NumPy and torch read these variables only once, when Python imports them.
os.environ.update({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"})

import numpy as np
from bench import best, load_function, replace_between_markers

import spikelane as sl

BEGIN, END = "<!-- peers: begin -->", "<!-- peers: end -->"
HEIGHT, WIDTH = 250, 400
INSTALLED = Path("target/peers")

Work = Callable[[], object]


class PeerMissing(Exception):
    """The reason for which a tool is not in the table."""


def clip(frames: int) -> np.ndarray:
    """Returns a texture that moves by one pixel per readout: uint8 (T, H, W), values 40 to 200."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    wave = [np.sin((columns + t) / 9.0) * np.cos(rows / 13.0) for t in range(frames)]
    return np.stack([(120 + 80 * w).astype(np.uint8) for w in wave])


def pictures(folder: Path, frames: np.ndarray) -> Path:
    from PIL import Image

    for t, frame in enumerate(frames):
        Image.fromarray(frame).convert("RGB").save(folder / f"{t:04}.png")
    return folder


def command_output(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise PeerMissing((done.stderr.strip().splitlines() or ["it cannot be installed"])[-1])


def installed_program_folder(*names: str) -> Path:
    """Installs packages without their dependencies and returns their folder."""
    site = INSTALLED / "site"
    for name in names:
        if not list(site.glob(f"{name.replace('-', '_')}-*")):
            command_output([sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(site), name])
    return site


def checkout(given: Path | None, repository: str) -> Path:
    folder = given or INSTALLED / repository.split("/")[1]
    if not folder.is_dir():
        command_output(["git", "clone", "-q", "--depth", "1", f"https://github.com/{repository}", str(folder)])
    return folder


def spikezoo() -> tuple[Work, int]:
    path = installed_program_folder("spikezoo") / "spikezoo" / "utils" / "spike_utils.py"
    convert, light = load_function(path, "video2spike_simulation", np=np), clip(64) / 255.0
    return lambda: convert(light, 1.0), 64


def spikecv_video(given: Path | None, folder: Path) -> tuple[Work, int]:
    source = checkout(given, "Zyj061/SpikeCV") / "SpikeCV" / "spkData" / "convert_video.py"
    sys.path.append(str(installed_program_folder("opencv-python-headless")))
    import cv2

    cv2.setNumThreads(1)
    space: dict[str, Any] = {"np": np, "cv2": cv2, "os": os}
    space["is_video_file"] = load_function(source, "is_video_file", **space)
    convert, light = load_function(source, "video_to_spike", **space), pictures(folder, clip(64))
    return lambda: convert(str(light), None, 1.0), 64


def spikecv_image(given: Path | None) -> tuple[Work, int]:
    source = checkout(given, "Zyj061/SpikeCV") / "SpikeCV" / "spkData" / "convert_img.py"
    # The published function uses `np.float`, which NumPy has removed.
    numpy = types.SimpleNamespace(zeros_like=np.zeros_like, zeros=np.zeros, float=float)
    convert, image = load_function(source, "img_to_spike", np=numpy), clip(1)[0] / 255.0
    return lambda: convert(image, 1.0, 1.0, 64), 64


def visionsim() -> tuple[Work, int]:
    emulate = load_function(
        installed_program_folder("visionsim") / "visionsim" / "emulate" / "spc.py",
        "emulate_spc",
        np=np,
        npt=types.SimpleNamespace(NDArray=np.ndarray),
        cast=lambda _, value: value,
    )
    light, random = clip(64) / 255.0, np.random.default_rng(1)
    return lambda: [emulate(frame, 1.0, random) for frame in light], 64


def v2e(given: Path | None) -> tuple[Work, int]:
    source = checkout(given, "SensorsINI/v2e")
    # Empty modules replace packages for windows, dialogs and a file format, which the measured code does not use.
    for name in ("screeninfo", "easygui", "tkinter", "dv_processing", "h5py"):
        module = types.ModuleType(name)
        module.__getattr__ = lambda attribute: list  # type: ignore[method-assign]
        sys.modules.setdefault(name, module)
    packages = ("opencv-python-headless", "engineering-notation", "numba", "llvmlite")
    sys.path[:0] = [str(source), str(installed_program_folder(*packages))]
    import torch
    from v2ecore.emulator import EventEmulator

    torch.set_num_threads(1)
    light = clip(64).astype(np.float64)

    def run() -> None:
        emulator = EventEmulator(shot_noise_rate_hz=1.0, device="cpu")
        for t, frame in enumerate(light):
            emulator.generate_events(frame, t / 20_000)

    return run, 64


def scsim(given: Path | None, folder: Path) -> tuple[Work, int]:
    from PIL import Image

    source = checkout(given, "Acnext/SCSim") / "v2s.py"
    # The published code needs older packages. Pillow has renamed the filter, and NumPy no longer converts an array of one
    # element to a number.
    picture = types.SimpleNamespace(open=Image.open, ANTIALIAS=Image.LANCZOS)
    draw = np.random
    random = types.SimpleNamespace(rand=draw.rand, normal=draw.normal, poisson=lambda lam, size: draw.poisson(lam))
    names = ("zeros", "ones", "array", "save", "uint8")
    numpy = types.SimpleNamespace(random=random, **{name: getattr(np, name) for name in names})
    convert = load_function(source, "get_spike", np=numpy, Image=picture, struct=struct, print=lambda *_: None)
    pictures(folder, clip(3))
    where = f"{folder}{os.sep}"
    return lambda: convert(where, where, WIDTH, HEIGHT, 1, 0, 2, 1), 3


def ours_call() -> tuple[Work, int]:
    camera = sl.Camera.preset("physical").with_shape(HEIGHT, WIDTH)
    simulator, light = sl.Simulator(camera), clip(512)
    out = np.empty((512, HEIGHT * WIDTH // 8), np.uint8)
    return lambda: simulator.fill(light, out, readouts_per_frame=1, interpolation="hold"), 512


def ours_program(folder: Path) -> tuple[Work, int]:
    program = os.environ.get("SPIKELANE")
    command = [program] if program else [sys.executable, "-m", "spikelane"]
    np.save(folder / "clip.npy", clip(4000))
    command += ["simulate", "clip.npy", "-o", "out", "--force", "--threads", "1"]
    command += ["--readouts-per-frame", "1", "--interpolation", "hold", "--camera", "physical"]
    return lambda: subprocess.run(command, cwd=folder, check=True, capture_output=True), 4000


def speed(make: Callable[[], tuple[Work, int]]) -> float | str:
    """Returns the speed in millions of pixel-readouts per second, or the reason for a missing result."""
    try:
        work, readouts = make()
        with contextlib.redirect_stdout(io.StringIO()):
            return readouts * HEIGHT * WIDTH / best(work, 2.0) / 1e6
    except (PeerMissing, ImportError) as missing:
        return f"skipped: {missing}"


def rows(given: argparse.Namespace, folders: list[Path]) -> list[tuple[str, str, float | str]]:
    own, scene = "circuit", "none"
    return [
        ("spikelane, `physical`, one call from Python", own, speed(ours_call)),
        ("spikelane, `physical`, `simulate` to a file, whole process", own, speed(lambda: ours_program(folders[0]))),
        ("SCSim `v2s.py`, PNG in, files out", own, speed(lambda: scsim(given.scsim, folders[1]))),
        ("Spike-Zoo `video2spike_simulation`", scene, speed(spikezoo)),
        ("SpikeCV `video_to_spike`, PNG in", scene, speed(lambda: spikecv_video(given.spikecv, folders[2]))),
        ("SpikeCV `img_to_spike`, one image held", scene, speed(lambda: spikecv_image(given.spikecv))),
        ("visionsim `emulate_spc`, a photon camera", "photons", speed(visionsim)),
        ("v2e `EventEmulator`, an event camera", "thresholds, leak and shot noise", speed(lambda: v2e(given.v2e))),
    ]


def number(value: float) -> str:
    return f"{float(f'{value:.3g}'):,g}"


def table(found: list[tuple[str, str, float | str]]) -> str:
    lines = [
        "| tool | noise | Mpixel-readouts/s | one call is faster by |",
        "|---|---|--:|--:|",
    ]
    call = float(found[0][2])
    for what, noise, value in found:
        if isinstance(value, str):
            lines.append(f"| {what} | {noise} | {value} | |")
        else:
            lines.append(f"| {what} | {noise} | {number(value)} | {number(call / value)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("spikecv", "scsim", "v2e", "markdown"):
        parser.add_argument(f"--{name}", type=Path)
    arguments = parser.parse_args()
    with contextlib.ExitStack() as stack:
        folders = [Path(stack.enter_context(tempfile.TemporaryDirectory())) for _ in range(3)]
        text = table(rows(arguments, folders))
    versions = f"{time.strftime('%Y-%m-%d')}, NumPy {np.__version__}, spikelane {sl.__version__}"
    text = f"{versions}, one thread, 400x250 pixels, a new frame per readout, the fastest of several runs.\n\n{text}"
    print(text)
    if arguments.markdown:
        replace_between_markers(arguments.markdown, BEGIN, END, text)


if __name__ == "__main__":
    main()
