"""Runs the converter of another simulator on a folder of images, and writes its spikes.

    python driver.py SIMULATOR CODE FRAMES OUTPUT SEED READOUTS

SIMULATOR is spikezoo, spikecv, spikecv-image or scsim. The script runs one function of a file in the folder CODE, with the
Python packages of this function and without the other imports of the file. It writes spikes.dat (top row first, least
significant bit first, each readout padded to whole bytes) and result.json. If the converter draws a start charge for each
pixel, it also writes start.f64, the charges as shares of the threshold.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import shutil
import struct
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np

CODE, FRAMES, OUTPUT = (Path(argument) for argument in sys.argv[2:5])
SEED, READOUTS = (int(argument) for argument in sys.argv[5:7])

result: dict[str, Any] = {"numpy": np.__version__, "python": sys.version.split()[0]}


def load_functions(path: str, *names: str, **space: Any) -> list[Any]:
    """Loads functions of a file in the folder CODE. `space` contains what the functions use from the imports of the file."""
    # CODE is a checkout, or the installed package inside the checkout.
    candidates = [CODE / path, CODE / path.partition("/")[2]]
    found = next((file for file in candidates if file.is_file()), None)
    if found is None:
        sys.exit(f"{CODE}: found no file {path}, expected a checkout or an installed package of the simulator")
    source = found.read_bytes()
    result.update(source=path, sha256=hashlib.sha256(source).hexdigest(), functions=names)
    nodes = [n for n in ast.parse(source).body if isinstance(n, ast.FunctionDef) and n.name in names]
    missing = set(names) - {node.name for node in nodes}
    if missing:
        sys.exit(f"{found}: found no function {missing.pop()}, expected the published code of the simulator")
    exec(compile(ast.Module([*nodes], []), str(found), "exec"), space)
    return [space[name] for name in names]


def frames() -> list[Path]:
    return sorted(FRAMES.iterdir())


def all_readouts() -> list[Path]:
    """Returns one file for each readout. A single image is the light of all readouts."""
    files = frames()
    return files * READOUTS if len(files) == 1 else files


def numbered_copies() -> Path:
    """Returns a folder with one file for each readout, 0000.png, 0001.png and so on."""
    folder = OUTPUT / "frames"
    folder.mkdir()
    for readout, file in enumerate(all_readouts()):
        shutil.copyfile(file, folder / f"{readout:04}.png")
    return folder


def start_charges(height: int, width: int) -> np.ndarray:
    """Returns the first random numbers after the seed. The converter draws the same numbers as its start charges."""
    np.random.seed(SEED)
    start = np.random.random(size=(height, width))
    np.random.seed(SEED)
    return start


def read_color(file: Path) -> np.ndarray:
    import cv2

    image = cv2.imread(str(file))
    if image is None:
        sys.exit(f"{file}: OpenCV cannot read the image")
    return image


def spikezoo() -> tuple[np.ndarray, np.ndarray | None]:
    import cv2

    (convert,) = load_functions("spikezoo/utils/spike_utils.py", "video2spike_simulation", np=np)

    # These two lines are those of `process_image` in scripts/simulate_spike.py.
    def gray(file: Path) -> np.ndarray:
        image = cv2.cvtColor(read_color(file), cv2.COLOR_BGR2GRAY)
        return image.astype(np.float32) / 255

    light = {file: gray(file) for file in frames()}
    start = start_charges(*next(iter(light.values())).shape)
    return convert([light[file] for file in all_readouts()]), start


def spikecv() -> tuple[np.ndarray, np.ndarray | None]:
    import cv2

    space = {"np": np, "cv2": cv2, "os": os}
    _, convert = load_functions("SpikeCV/spkData/convert_video.py", "is_video_file", "video_to_spike", **space)
    folder = numbered_copies()
    start = start_charges(*read_color(frames()[0]).shape[:2])
    return convert(str(folder)), start


def spikecv_image() -> tuple[np.ndarray, np.ndarray | None]:
    from PIL import Image

    # The function uses `np.float`, which NumPy has removed.
    numpy = types.SimpleNamespace(zeros_like=np.zeros_like, zeros=np.zeros, float=float)
    (convert,) = load_functions("SpikeCV/spkData/convert_img.py", "img_to_spike", np=numpy)
    # This is the light of examples/test_data_augmentation.py.
    light = np.array(Image.open(frames()[0]).convert("RGB")).astype(float).mean(axis=2) / 255.0
    return convert(light, n_timestep=READOUTS), None


def scsim() -> tuple[None, None]:
    from PIL import Image

    # Pillow has renamed the filter, and NumPy no longer converts an array of one element to a number.
    pillow = types.SimpleNamespace(open=Image.open, ANTIALIAS=Image.Resampling.LANCZOS)
    draw = np.random
    random = types.SimpleNamespace(rand=draw.rand, normal=draw.normal, poisson=lambda lam, size: draw.poisson(lam))
    used = ("zeros", "ones", "array", "save", "uint8")
    numpy = types.SimpleNamespace(random=random, **{name: getattr(np, name) for name in used})
    (convert,) = load_functions("v2s.py", "get_spike", np=numpy, Image=pillow, struct=struct)
    folder = numbered_copies()
    readouts = len(all_readouts())
    width, height = Image.open(frames()[0]).size
    files = OUTPUT / "scsim"
    files.mkdir()
    np.random.seed(SEED)
    convert(f"{folder}{os.sep}", f"{files}{os.sep}", width, height, 1, 0, readouts - 1, 1)
    (files / "noise_pattern.dat").replace(OUTPUT / "spikes.dat")
    shutil.rmtree(files)
    return None, None


def main() -> None:
    converters = {"spikezoo": spikezoo, "spikecv": spikecv, "spikecv-image": spikecv_image, "scsim": scsim}
    spikes, start = converters[sys.argv[1]]()
    if spikes is not None:
        bits = np.packbits(np.asarray(spikes).astype(bool).reshape(len(spikes), -1), axis=1, bitorder="little")
        (OUTPUT / "spikes.dat").write_bytes(bits.tobytes())
    if start is not None:
        (OUTPUT / "start.f64").write_bytes(start.astype("<f8").tobytes())
    (OUTPUT / "result.json").write_text(json.dumps(result))


if __name__ == "__main__":
    try:
        main()
    except ImportError as error:
        sys.exit(
            f"Python has no module {error.name}: install it with pip (cv2 is in opencv-python-headless, PIL in Pillow)"
        )
