#!/usr/bin/env python3
"""Loads a generated data set with the client of its layout, and reconstructs images with code of the client.

    pip install spikezoo
    git clone https://github.com/Zyj061/SpikeCV
    spikelane dataset -o set --scene-preset tiny --images-per-scene 200 --label-every 0 --dataset-layout spike-zoo
    python crates/cli/tests/clients/read_dataset.py set
    spikelane dataset -o set-cv --scene-preset tiny --images-per-scene 200 --label-every 0
    python crates/cli/tests/clients/read_dataset.py set-cv --spikecv SpikeCV

Spike-Zoo: BaseDataset finds the streams and clear images. TFPModel computes the image. As in the pipeline of
Spike-Zoo, the test divides the image by the rate in the data set.
SpikeCV: data_parameter_dict reads config.yaml and finds the clear image, SpikeStream decodes, TFP computes the
image, and calculate_psnr compares the images. Only the client decodes spikes.

An image is correct if it correlates with the clear image by more than 0.8, and by more than the same image upside
down or mirrored. For clean streams, PSNR must also be at least the limit of counting and motion minus 1 dB.
- In n readouts at rate r, the spike count is one of two integers. Its variance over start phases is f (1 - f), where f
  is the fraction of n r.
- Truncation of an image to integer codes adds 1/3 squared code, and rounding of the ground truth adds 1/12.
- The stored images show the motion during the n readouts, so the data set needs an image of every readout.
- The 1 dB allows for light above white and for correlated errors. Codes that are mistaken for linear light score at
  least 10 dB less.
Exits with code 1 if an image is wrong or a PSNR is too low.
"""

import argparse
import contextlib
import io
import json
import os
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
import torch


# Window of TFP in both clients, in readouts; the default of Spike-Zoo.
READOUTS = 41


def allowed_db(root, sequence, clear, rate, codes):
    """Returns the PSNR limit of counting and motion; `codes` is true if the image is truncated to 8-bit codes."""
    folder = root / "sequences" / sequence
    middle = json.loads((folder / "record.json").read_text())["facts"]["reference_readout"]
    near = range(middle - READOUTS // 2, middle + READOUTS // 2 + 1)
    seen = np.mean([light(folder / "images" / f"{readout:06}.png") for readout in near], axis=0)
    part = READOUTS * seen * rate % 1.0
    error = part * (1.0 - part) / (READOUTS * rate) ** 2 + (seen - clear) ** 2
    return -10 * np.log10(error.mean() + (1 / 12 + codes / 3) / 255**2)


def light(path):
    """Returns the linear light of an 8-bit sRGB image."""
    code = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) / 255
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def judge(client, name, picture, clear, psnr, psnr_limit):
    """Prints one line of the result, and returns whether the image is correct."""
    picture = np.asarray(picture, dtype=np.float64)
    found = {
        orientation: np.corrcoef(turned.ravel(), clear.ravel())[0, 1]
        for orientation, turned in (
            ("upright", picture),
            ("upside down", picture[::-1]),
            ("mirrored", picture[:, ::-1]),
        )
    }
    good = found["upright"] > max(0.8, found["upside down"], found["mirrored"])
    correlations = ", ".join(f"{value:.4f} {orientation}" for orientation, value in found.items())
    score = f"PSNR {psnr:.2f} dB"
    if psnr_limit is not None:
        good = good and psnr >= psnr_limit - 1.0
        score += f", counting and motion allow {psnr_limit:.2f}"
    print(f"{client}  {name}  {picture.shape[1]}x{picture.shape[0]}  {correlations}  {score}  {'read' if good else 'NOT READ'}")
    return good


def spike_zoo(root, width, height):
    from spikezoo.archs.tfp.nets import TFPModel
    from spikezoo.datasets.base_dataset import BaseDataset, BaseDatasetConfig

    for folder in ("spike", "clean"):
        for split in ("train", "test"):
            config = BaseDatasetConfig(root_dir=root, width=width, height=height, spike_dir_name=folder)
            data = BaseDataset(config)
            data.build_source(split)
            for i, path in enumerate(data.spike_list):
                item = data[i]
                tfp = TFPModel(READOUTS)
                clear = item["gt_img"][0].numpy().astype(np.float64)
                picture = np.clip(tfp(item["spike"][None])[0, 0].numpy() / item["rate"], 0, 1)
                psnr = -10 * np.log10(((picture - clear) ** 2).mean())
                psnr_limit = allowed_db(root, path.stem, clear, item["rate"], False) if folder == "clean" else None
                yield judge("Spike-Zoo", f"{split}/{folder}/{path.stem}", picture, clear, psnr, psnr_limit)


def spike_cv(root, clone):
    # The examples of SpikeCV import the metrics from these folders.
    sys.path[:0] = [str(clone), str(clone / "SpikeCV")]
    with tempfile.TemporaryDirectory() as place:
        # SpikeCV searches for data in ../spkData/datasets, relative to the current folder. It accepts only one name for
        # the folder of streams, so a second folder links the clean streams under this name.
        datasets = Path(place) / "spkData" / "datasets"
        for kind in ("noisy", "clean"):
            for split in ("train", "test"):
                (datasets / kind / split).mkdir(parents=True)
                (datasets / kind / split / "spike").symlink_to(root / split / ("spike" if kind == "noisy" else kind))
                (datasets / kind / split / "gt").symlink_to(root / split / "gt")
            (datasets / kind / "config.yaml").symlink_to(root / "config.yaml")
        (Path(place) / "examples").mkdir()
        back = Path.cwd()
        os.chdir(Path(place) / "examples")
        from metrics.reconsturction import calculate_psnr
        from SpikeCV.spkData.load_dat import SpikeStream, data_parameter_dict
        from SpikeCV.spkProc.reconstruction.tfp import TFP

        for kind in ("noisy", "clean"):
            for split in ("train", "test"):
                for path in sorted((datasets / kind / split / "spike").glob("*.dat")):
                    found = data_parameter_dict(f"{kind}/{split}/spike/{path.name}", "reconstruction")
                    with contextlib.redirect_stdout(io.StringIO()):
                        spikes = SpikeStream(**found).get_spike_matrix()
                    tfp = TFP(found["spike_h"], found["spike_w"], torch.device("cpu"))
                    picture = tfp.spikes2frame(np.ascontiguousarray(spikes), len(spikes) // 2, READOUTS // 2)
                    clear = cv2.imread(found["labeled_data_dir"], cv2.IMREAD_GRAYSCALE)
                    psnr = calculate_psnr(picture, clear)
                    psnr_limit = allowed_db(root, path.stem, clear / 255, 1.0, True) if kind == "clean" else None
                    yield judge("SpikeCV  ", f"{split}/{kind}/{path.stem}", picture, clear / 255, psnr, psnr_limit)
        os.chdir(back)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("dataset", type=Path)
    arguments.add_argument("--spikecv", type=Path, metavar="CLONE")
    arguments = arguments.parse_args()
    root = arguments.dataset.resolve()
    clone = arguments.spikecv and arguments.spikecv.resolve()
    print(f"torch {torch.__version__}")
    if clone:
        results = list(spike_cv(root, clone))
    else:
        sidecar = json.loads(next(root.glob("sequences/*/stream.json")).read_text())
        print(f"spikezoo {version('spikezoo')}")
        results = list(spike_zoo(root, sidecar["width"], sidecar["height"]))
    print(f"{len(results)} streams loaded, {results.count(False)} of them wrong")
    return 1 if not results or False in results else 0


if __name__ == "__main__":
    sys.exit(main())
