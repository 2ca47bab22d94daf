"""Reconstructs images with a small network, as a server for `spikelane benchmark run`.

    spikelane benchmark run quick --server 'python3 bindings/python/examples/learned_method.py' -o runs/learned

The network has five 3x3 convolutions, as the network BASE of Spike-Zoo, and reads 41 bins of readouts around the reference
readout. Unlike BASE, it also reads the light level, and it corrects a blurred spike count. `learned_train.py` trains it. This
program needs only NumPy.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

BINS = 41
CHANNELS = (BINS + 2, 64, 128, 64, 16, 1)
"""Channels between the layers. The input has 41 bins, the light level and the blurred spike count."""

MAX_SIGMA_PX, MAX_LIGHT = 5.0, 2.0
STRIP_ROWS = 16


def gaussian_blur(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Returns the image (H, W) after a Gaussian blur. The image is mirrored at its borders."""
    radius = min(int(np.ceil(3 * sigma)), min(image.shape) - 1)
    taps = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(radius, radius) if a == axis else (0, 0) for a in (0, 1)], mode="reflect")
        parts = (np.take(padded, range(k, k + image.shape[axis]), axis) for k in range(len(taps)))
        image = sum((tap * part for tap, part in zip(taps, parts, strict=True)), np.zeros_like(image, np.float64))
    return image.astype(np.float32)


def network_input(spikes: NDArray[np.uint8], white_rate: float) -> NDArray[np.float32]:
    """Returns the input (43, H, W) from 41 * k readouts (T, H, W) of zeros and ones, where k readouts are one bin.

    `white_rate` is the number of spikes per readout of a white pixel. The last channel is the mean of the readouts in units
    of light, with a blur that is wider in dimmer light: a blur of s pixels divides the variance of the noise by 4 pi s^2.
    """
    bins = spikes.reshape(BINS, -1, *spikes.shape[1:]).sum(axis=1, dtype=np.float32)
    white_count = len(spikes) * white_rate
    level = np.full(spikes.shape[1:], np.log10(white_count), np.float32)
    light = gaussian_blur(bins.sum(axis=0) / np.float32(white_count), min(2 / np.sqrt(white_count), MAX_SIGMA_PX))
    # The division by the root gives the bins a similar spread at each light level.
    return np.concatenate([bins / np.float32(np.sqrt(white_count)), level[None], np.minimum(light, MAX_LIGHT)[None]])


def start_image(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the image (H, W) that the network corrects: the last input, times 0 to 1 for 1 to 10 spikes of white.

    In dimmer light, dark current exceeds the light, so the image starts at 0.
    """
    image: NDArray[np.float32] = np.clip(x[BINS], 0, 1) * x[BINS + 1]
    return image


def convolution(x: NDArray[np.float32], weight: NDArray[np.float32], bias: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the 3x3 convolution of x (C, H, W) with zeros around the image."""
    channels, height, width = x.shape
    padded = np.zeros((channels, height + 2, width + 2), np.float32)
    padded[:, 1:-1, 1:-1] = x
    out = np.repeat(bias, height * width).reshape(len(bias), -1)
    for row in range(3):
        for col in range(3):
            part = padded[:, row : row + height, col : col + width].reshape(channels, -1)
            out += weight[:, :, row, col] @ part
    return out.reshape(-1, height, width)


class Network:
    """The trained network."""

    def __init__(self, path: Path) -> None:
        with np.load(path, allow_pickle=False) as file:
            count = len(CHANNELS) - 1
            self.layers = [
                (file[f"weight{i}"].astype(np.float32), file[f"bias{i}"].astype(np.float32)) for i in range(count)
            ]

    def image(self, spikes: NDArray[np.uint8], readout: int, white_rate: float) -> NDArray[np.float32]:
        """Returns the light (H, W) at a readout of a stream (T, H, W) with at least 41 readouts."""
        length = BINS * (len(spikes) // BINS)
        if length == 0:
            raise ValueError(f"the stream has {len(spikes)} readouts, expected at least {BINS}")
        first = min(max(readout - length // 2, 0), len(spikes) - length)
        x = network_input(spikes[first : first + length], white_rate)
        image = start_image(x)
        height, margin = len(image), len(self.layers)
        # Strips of rows need less memory. Each layer uses one more row above and below a strip.
        for top in range(0, height, STRIP_ROWS):
            bottom, first_row = min(top + STRIP_ROWS, height), max(top - margin, 0)
            part = x[:, first_row : bottom + margin]
            for weight, bias in self.layers[:-1]:
                part = np.maximum(convolution(part, weight, bias), 0)
            image[top:bottom] += convolution(part, *self.layers[-1])[0, top - first_row : bottom - first_row]
        return image


def read_dat(path: str, height: int, width: int) -> NDArray[np.uint8]:
    """Reads a stream (T, H, W). A .dat file begins with the bottom row of each readout."""
    packed = np.fromfile(path, np.uint8).reshape(-1, -(-height * width // 8))
    bits = np.unpackbits(packed, axis=1, count=height * width, bitorder="little")
    return bits.reshape(-1, height, width)[:, ::-1]


def serve(network: Network) -> None:
    """Answers the requests of `spikelane benchmark run --server`."""
    print("ready", flush=True)
    for line in sys.stdin:
        request: dict[str, Any] = json.loads(line)
        try:
            spikes = read_dat(request["stream"], request["height"], request["width"])
            np.save(request["output"], network.image(spikes, request["readout"], request["white_rate"]))
            print("ok", flush=True)
        except (OSError, ValueError) as error:
            print(" ".join(f"{type(error).__name__}: {error}".split()), flush=True)


if __name__ == "__main__":
    weights = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("learned_weights.npz")
    serve(Network(weights))
