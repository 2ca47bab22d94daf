"""Trains a network of Spike-Zoo (0.2.3) on streams that are simulated anew in every epoch.

    pip install spikezoo
    python bindings/python/examples/spikezoo_train.py [NETWORK] [EPOCHS]

The loop, the networks and the losses are those of Spike-Zoo; only the data set is different. `spk2imgnet` (the default)
trains on a CPU. Most other networks need CUDA. The clips of this example show drifting noise; replace them with your clips,
in a format of `spikelane.ClipSampler`.
"""

from __future__ import annotations

import sys

import numpy as np
import torch
from spikezoo.pipeline import TrainPipeline, TrainPipelineConfig
from spikezoo_dataset import ZooConfig

import spikelane as sl


class Fresh(TrainPipeline):  # type: ignore[misc]
    """The training loop of Spike-Zoo, with new streams in every epoch."""

    def update_learning_rate(self) -> None:
        """Starts the next epoch of the data set. Spike-Zoo calls this method at the end of an epoch."""
        super().update_learning_rate()
        self.train_dataset.set_epoch(self.train_dataset.data.epoch + 1)
        print("next epoch:", self.train_dataset.data.epoch)

    def cal_metrics(self) -> dict[str, float]:
        """Returns the L1 error. The metrics of Spike-Zoo would download networks."""
        batch = self.model.feed_to_device(next(iter(self.dataloader)))
        outputs = self.model.get_outputs_dict(batch)
        return {"l1": float((outputs["recon_img"] - batch["gt_img"]).abs().mean())}


def drifting_clips(count: int, frames: int, size: int) -> np.ndarray:
    """Returns uint8 clips (count, frames, size, size) of smooth noise that moves by one pixel per frame."""
    wide = np.random.default_rng(0).random((count, size // 8 + 2, (size + frames) // 8 + 2))
    smooth = np.kron(wide, np.ones((8, 8)))[:, :size]
    clip = [smooth[:, :, t : t + size] for t in range(frames)]
    return np.rint(255 * np.stack(clip, axis=1)).astype(np.uint8)


def main() -> None:
    network = sys.argv[1] if len(sys.argv) > 1 else "spk2imgnet"
    epochs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    clips = drifting_clips(4, 5, 32)
    camera = sl.Camera.preset("physical").with_shape(32, 32)
    data = ZooConfig(clips=clips, camera=camera, readouts_per_frame=9, options={"interpolation": "linear"})
    loop = TrainPipelineConfig(
        epochs=epochs, use_tensorboard=False, bs_train=2, nw_train=0, bs_test=1, nw_test=0, pin_memory=False
    )
    torch.set_num_threads(2)
    Fresh(loop, network, data).train()


if __name__ == "__main__":
    main()
