#!/usr/bin/env python3
"""Reads a generated dataset as Spike-Zoo and SpikeCV do, and compares it with its clear images.

    python tests/clients/read_spikezoo.py DATASET [SPIKEZOO_WHEEL_OR_SITE]

With the package `spikezoo` importable (or its wheel given: only its file `utils/spike_utils.py`
is used then, which needs numpy alone once torch, cv2 and imageio are stood in for), its own
loader decodes the stream. Otherwise the loaders' documented rule does: no header, LSB first,
bottom row first. Folders are found as its base dataset finds them: SPLIT/spike/**/*.dat and
SPLIT/gt. `config.yaml` is read by SpikeCV's keys. Exits with 1 if a stream is not upright.
"""

import sys
import types
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image


def documented_rule(path, height, width):
    frame = height * width // 8
    data = np.fromfile(path, dtype=np.uint8)
    bits = np.unpackbits(data[: len(data) // frame * frame].reshape(-1, frame), axis=1, bitorder="little")
    return bits.reshape(-1, height, width)[:, ::-1].astype(np.float32)


def wheel_loader(wheel):
    """The package's own function, with stand-ins for modules that decoding does not touch."""
    for name in ("torch", "torch.nn", "cv2", "imageio"):
        sys.modules.setdefault(name, types.ModuleType(name))
    sys.modules["torch"].nn = sys.modules["torch.nn"]
    sys.modules["torch"].from_numpy = lambda a: a
    sys.modules["torch.nn"].Module = object
    code = zipfile.ZipFile(wheel).read("spikezoo/utils/spike_utils.py").decode()
    scope = {"__name__": "spike_utils"}
    exec(compile(code, "spike_utils.py", "exec", flags=0, dont_inherit=True), scope)
    return scope["load_vidar_dat"]


def loader(arguments):
    if arguments:
        return wheel_loader(arguments[0]), "spikezoo's load_vidar_dat, from its wheel"
    try:
        from spikezoo.utils.spike_utils import load_vidar_dat

        return load_vidar_dat, "spikezoo's load_vidar_dat"
    except ImportError:
        return documented_rule, "the documented rule"


def main():
    root = Path(sys.argv[1])
    load, name = loader(sys.argv[2:])
    keys = dict(line.split(": ", 1) for line in (root / "config.yaml").read_text().splitlines())
    height, width = int(keys["spike_h"]), int(keys["spike_w"])
    print(f"decoded by {name}, {width}x{height}")
    wrong = seen = 0
    for split in ("train", "test"):
        for path in sorted((root / split / keys["data_field_identifier"]).glob("**/*.dat")):
            label = root / split / keys["label_field_identifier"] / f"{path.stem}.{keys['labeled_data_suffix']}"
            clear = (np.asarray(Image.open(label)) / 255.0) ** 2.2
            rate = np.asarray(load(str(path), height=height, width=width)).mean(axis=0)
            upright = np.corrcoef(rate.ravel(), clear.ravel())[0, 1]
            flipped = np.corrcoef(rate[::-1].ravel(), clear.ravel())[0, 1]
            print(f"{split} {path.name}: correlation {upright:.4f} upright, {flipped:.4f} upside down")
            wrong += not upright > max(flipped, 0.5)
            seen += 1
    print(f"{seen} streams, {wrong} not upright")
    return 1 if wrong or not seen else 0


if __name__ == "__main__":
    sys.exit(main())
