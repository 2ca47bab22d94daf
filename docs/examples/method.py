"""Reconstructs an image for `spikelane benchmark run`: the mean of the 21 readouts around the middle of a stream."""

import sys

import numpy as np


def main() -> None:
    stream, output, width, height, white_rate = sys.argv[1:]
    bits = np.unpackbits(np.fromfile(stream, np.uint8), bitorder="little")
    # A .dat file begins with the bottom row of each readout.
    spikes = bits.reshape(-1, int(height), int(width))[:, ::-1]
    middle = len(spikes) // 2
    image = spikes[middle - 10 : middle + 11].mean(axis=0) / float(white_rate)
    np.save(output, image.astype(np.float32))


main()
