"""Streams for SpikeCV's loader: a .dat file, and the config.yaml beside it that its examples read.

python spikecv_stream.py FOLDER

from spikecv.spkData.load_dat import data_parameter_dict, SpikeStream
stream = SpikeStream(filepath="FOLDER/light.dat", spike_h=250, spike_w=400, print_dat_detail=False)
spikes = stream.get_spike_matrix()      # (T, H, W), as below
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import spikelane as sl


def write(folder: Path) -> np.ndarray:
    """Writes FOLDER/light.dat and FOLDER/config.yaml; returns the spikes (T, H, W)."""
    camera = sl.Camera.preset("physical")
    scene = sl.Scene(11, lighting="noon", duration_s=0.5)
    light = np.minimum(scene.clip(0.2, 3, 1000), 1.0)
    spikes = sl.Simulator(camera).push_bits(light, 20)
    folder.mkdir(parents=True, exist_ok=True)
    sl.write_stream(folder / "light.dat", spikes, layout="dat", readout_hz=camera.readout_hz, force=True)
    config = f"spike_h: {spikes.shape[1]}\nspike_w: {spikes.shape[2]}\nis_labeled: false\n"
    (folder / "config.yaml").write_text(config)
    return spikes


if __name__ == "__main__":
    made = write(Path(sys.argv[1] if len(sys.argv) > 1 else "spikecv"))
    print(f"{made.shape[0]} readouts, {made.mean():.3f} spikes a readout")
