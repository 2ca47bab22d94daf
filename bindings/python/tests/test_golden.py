"""Rust, the program and Python share one table of digests."""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest

import spikelane as sl

SEEDS = {"camera_seed": 11, "seed": 22, "sequence": 33}


def fnv(data: bytes) -> str:
    """Returns the FNV-1a digest in the format of the table."""
    state = 0xCBF29CE484222325
    for byte in data:
        state = ((state ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return f"{state:#018x}"


def ramp(pixels: int) -> np.ndarray:
    return (np.arange(pixels) * 255 // max(pixels, 2)).astype(np.uint8)


def light(kind: str, shape: tuple[int, int]) -> tuple[np.ndarray, int, dict]:
    """Returns the frames, the readouts per frame and other arguments of `run` for 200 readouts."""
    pixels = shape[0] * shape[1]
    if kind == "u8":
        return ramp(pixels).reshape(1, *shape), 200, {}
    if kind == "u16":
        wide = (np.arange(pixels) * 65_535 // max(pixels, 2)).astype(np.uint16)
        return wide.reshape(1, *shape), 200, {}
    if kind == "bright":
        lit = np.float32(1.6) * np.arange(pixels, dtype=np.float32) / np.float32(pixels)
        frames = np.stack([lit, lit, lit, np.zeros_like(lit)])
        return frames.reshape(4, *shape), 50, {"interpolation": "hold"}
    assert kind == "between"
    frames = np.stack([ramp(pixels), ramp(pixels)[::-1]])
    return frames.reshape(2, *shape), 200, {"readouts": 200, "interpolation": "linear"}


def test_python_reproduces_the_golden_digests(golden):
    for case in golden:
        camera = sl.Camera.from_toml(case["camera"])
        frames, each, how = light(case["light"], camera.shape)
        simulator = sl.Simulator(camera, max_light=1.6, **SEEDS)
        spikes = simulator.run(frames, readouts_per_frame=each, **how)
        assert fnv(spikes.packed.tobytes()) == case["fnv1a"], case["name"]


@pytest.mark.parametrize("kind", ["u8", "u16", "bright", "between"])
def test_the_program_reproduces_the_golden_digests(golden, program, tmp_path, kind):
    for i, case in enumerate(c for c in golden if c["light"] == kind):
        camera = sl.Camera.from_toml(case["camera"])
        frames, each, how = light(kind, camera.shape)
        # Only the program applies the [light] section of a camera file. The golden table has linear light.
        camera_file = re.sub(r"\[light\]\n(?:.+\n)*", "", case["camera"])
        (tmp_path / "camera.toml").write_text(camera_file)
        np.save(tmp_path / "light.npy", frames)
        command = [
            *program,
            "simulate",
            str(tmp_path / "light.npy"),
            "--camera",
            str(tmp_path / "camera.toml"),
            "-o",
            str(tmp_path / f"out{i}"),
        ]
        command += ["--camera-seed", "11", "--seed", "22", "--sequence", "33"]
        command += ["--readouts-per-frame", str(each), "--readouts", "200", "--max-light", "1.6"]
        command += [
            "--interpolation",
            how.get("interpolation", "hold"),
            "--to",
            "dat-top",
            "--transfer",
            "linear",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert fnv((tmp_path / f"out{i}.dat").read_bytes()) == case["fnv1a"], case["name"]
