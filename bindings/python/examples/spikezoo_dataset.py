"""A data set for the training loop of Spike-Zoo, with the keys of Spike-Zoo and new noise in every epoch.

Spike-Zoo (0.2.3) needs a data set class and a configuration. Copy this file to the folder of your script, and call:

    config = ZooConfig(clips=clips, camera=camera)
    TrainPipeline(TrainPipelineConfig(epochs=10), "bsf", config).train()

`spikezoo_train.py` is a complete program, which simulates new streams for every epoch of the loop.
If Spike-Zoo is not installed, the class derives from torch's Dataset instead.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import torch

import spikelane as sl
from spikelane.torch import SpikeClips

try:
    from spikezoo.datasets.base_dataset import BaseDataset, BaseDatasetConfig
except ImportError:
    from torch.utils.data import Dataset as BaseDataset

    BaseDatasetConfig = object


@dataclass
class ZooConfig(BaseDatasetConfig):  # type: ignore[misc, valid-type]
    """The configuration of a data set; `clips` and `camera` are arguments of `spikelane.ClipSampler`."""

    dataset_name: str = "spikelane"
    clips: Any = None
    camera: Any = None
    readouts_per_frame: int = 1
    options: dict[str, Any] = field(default_factory=dict)
    dataset_cls_local: Any = None

    def __post_init__(self) -> None:
        self.dataset_cls_local = ZooClips


class ZooClips(BaseDataset):  # type: ignore[misc, valid-type]
    """Items for Spike-Zoo: "spike" float32 (T, H, W), "gt_img" float32 (1, H, W) from 0 to 1, and "rate"."""

    def __init__(self, cfg: ZooConfig) -> None:
        self.cfg = cfg
        self.data = SpikeClips(cfg.clips, cfg.camera, cfg.readouts_per_frame, **cfg.options)

    def build_source(self, split: str = "test") -> None:
        """Sets the split. The training loop calls `set_epoch` only for the training data, so test scores are comparable."""
        self.split = split

    def set_epoch(self, epoch: int) -> None:
        self.data.set_epoch(epoch)

    def __len__(self) -> int:
        return len(self.data)

    def __getitem__(self, index: int) -> dict[str, Any]:
        item = self.data[index]
        return {
            "spike": item["spikes"].to(torch.float32),
            "gt_img": item["light"].clamp(max=1.0),
            "rate": float(item["thresholds_at_full_scale"]),
        }


if __name__ == "__main__":
    clips = torch.randint(0, 256, (6, 4, 40, 48), dtype=torch.uint8).numpy()
    config = ZooConfig(clips=clips, camera=sl.Camera.preset("physical").with_shape(40, 48), readouts_per_frame=10)
    data = ZooClips(config)
    data.build_source("train")
    batch = next(iter(torch.utils.data.DataLoader(data, batch_size=2)))
    print({key: tuple(value.shape) for key, value in batch.items()})
