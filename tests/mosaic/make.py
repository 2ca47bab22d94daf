"""Writes `demosaic.json`, the demosaiced images of another program.

    pip install colour-demosaicing==0.2.7
    python make.py

The values of the mosaic are whole numbers: a value is `code / 1000`. Borders are omitted, because programs
extend images beyond their borders in different ways.
"""

import json
import pathlib
from importlib.metadata import version

import numpy as np
from colour_demosaicing import (
    demosaicing_CFA_Bayer_bilinear,
    demosaicing_CFA_Bayer_Malvar2004,
    demosaicing_CFA_Bayer_Menon2007,
)

SIDE = 24
BORDER = 8
METHODS = {
    "bilinear": demosaicing_CFA_Bayer_bilinear,
    "malvar": demosaicing_CFA_Bayer_Malvar2004,
    "menon": demosaicing_CFA_Bayer_Menon2007,
}


def main():
    rows, cols = np.mgrid[:SIDE, :SIDE]
    rng = np.random.default_rng(1)
    smooth = 400 + 250 * np.sin(0.31 * rows + 0.17 * cols) + 150 * np.cos(0.023 * (rows**2 + cols**2))
    codes = np.rint(smooth + rng.uniform(-60, 60, smooth.shape)).astype(int)
    cases = []
    for pattern in ["RGGB", "BGGR", "GRBG", "GBRG"]:
        for name, method in METHODS.items():
            inside = method(codes / 1000, pattern)[BORDER:-BORDER, BORDER:-BORDER]
            colors = [round(float(x), 6) for x in inside.ravel()]
            cases.append({"pattern": pattern, "method": name, "colors": colors})
    text = {
        "packages": {"colour-demosaicing": version("colour-demosaicing")},
        "side": SIDE, "border": BORDER, "codes": codes.ravel().tolist(), "cases": cases,
    }
    path = pathlib.Path(__file__).parent / "demosaic.json"
    path.write_text(json.dumps(text, allow_nan=False, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
