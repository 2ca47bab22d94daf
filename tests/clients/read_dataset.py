#!/usr/bin/env python3
"""Loads a generated dataset with the clients of the field, and reconstructs it with their own code.

    pip install spikezoo
    git clone https://github.com/Zyj061/SpikeCV
    spikelane dataset -o set --preset tiny --images 200 --label-every 0
    python tests/clients/read_dataset.py set --spikecv SpikeCV

Spike-Zoo: its BaseDataset finds streams and clear images, its TFPModel makes the picture.
SpikeCV: data_parameter_dict reads config.yaml and finds the clear image, SpikeStream decodes,
its TFP makes the picture. Nothing of this file decodes a bit. A picture counts as read when it
correlates with the clear image, upright, by more than 0.8 and by more than upside down and
mirrored. Exits with 1 if one does not. Without --spikecv only Spike-Zoo is asked, and that is said.
"""

import argparse
import contextlib
import io
import os
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
import torch


def judge(client, name, picture, clear):
    """One line of the result; whether the picture is the clear image's."""
    light = np.where(clear <= 0.04045, clear / 12.92, ((clear + 0.055) / 1.055) ** 2.4)
    picture = np.asarray(picture, dtype=np.float64)
    found = {
        way: np.corrcoef(turned.ravel(), light.ravel())[0, 1]
        for way, turned in (
            ("upright", picture),
            ("upside down", picture[::-1]),
            ("mirrored", picture[:, ::-1]),
        )
    }
    good = found["upright"] > max(0.8, found["upside down"], found["mirrored"])
    told = ", ".join(f"{value:.4f} {way}" for way, value in found.items())
    print(f"{client}  {name}  {picture.shape[1]}x{picture.shape[0]}  {told}  {'read' if good else 'NOT READ'}")
    return good


def spike_zoo(root, width, height):
    from spikezoo.archs.tfp.nets import TFPModel
    from spikezoo.datasets.base_dataset import BaseDataset, BaseDatasetConfig

    for split in ("train", "test"):
        data = BaseDataset(BaseDatasetConfig(root_dir=root, width=width, height=height))
        data.build_source(split)
        for i, path in enumerate(data.spike_list):
            item = data[i]
            picture = TFPModel()(item["spike"][None])[0, 0].numpy()
            yield judge("Spike-Zoo", f"{split}/{path.stem}", picture, item["gt_img"][0].numpy())


def spike_cv(root, clone):
    sys.path.insert(0, str(clone))
    with tempfile.TemporaryDirectory() as place:
        # SpikeCV looks for data in ../spkData/datasets from where it is run.
        datasets = Path(place) / "spkData" / "datasets"
        datasets.mkdir(parents=True)
        (datasets / root.name).symlink_to(root)
        (Path(place) / "examples").mkdir()
        back = Path.cwd()
        os.chdir(Path(place) / "examples")
        from SpikeCV.spkData.load_dat import SpikeStream, data_parameter_dict
        from SpikeCV.spkProc.reconstruction.tfp import TFP

        for path in sorted(root.glob("*/spike/*.dat")):
            name = path.relative_to(root)
            found = data_parameter_dict(f"{root.name}/{name}", "reconstruction")
            with contextlib.redirect_stdout(io.StringIO()):
                spikes = SpikeStream(**found).get_spike_matrix()
            tfp = TFP(found["spike_h"], found["spike_w"], torch.device("cpu"))
            picture = tfp.spikes2frame(np.ascontiguousarray(spikes), len(spikes) // 2, 20)
            clear = cv2.imread(found["labeled_data_dir"], cv2.IMREAD_GRAYSCALE) / 255
            yield judge("SpikeCV  ", f"{name.parts[0]}/{path.stem}", picture, clear)
        os.chdir(back)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("dataset", type=Path)
    arguments.add_argument("--spikecv", type=Path, metavar="CLONE")
    arguments = arguments.parse_args()
    root = arguments.dataset.resolve()
    clone = arguments.spikecv and arguments.spikecv.resolve()
    keys = dict(line.split(": ", 1) for line in (root / "config.yaml").read_text().splitlines())
    print(f"spikezoo {version('spikezoo')}, torch {torch.__version__}")
    results = list(spike_zoo(root, int(keys["spike_w"]), int(keys["spike_h"])))
    if clone:
        results += spike_cv(root, clone)
    else:
        print("SpikeCV was not asked: no --spikecv")
    print(f"{len(results)} sequences loaded, {results.count(False)} of them wrong")
    return 1 if not results or False in results else 0


if __name__ == "__main__":
    sys.exit(main())
