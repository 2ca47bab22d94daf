"""Writes a stream for the loader of SpikeCV: a .dat file, and the config.yaml that the examples of SpikeCV read.

python spikecv_stream.py FOLDER

SpikeCV then reads the stream:

from spikecv.spkData.load_dat import data_parameter_dict, SpikeStream
stream = SpikeStream(filepath="FOLDER/light.dat", spike_h=250, spike_w=400, print_dat_detail=False)
spikes = stream.get_spike_matrix()      # shape (T, H, W)
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import spikelane as sl


def write(folder: Path) -> sl.SpikeFrames:
    """Writes FOLDER/light.dat and FOLDER/config.yaml, and returns the spikes."""
    camera = sl.Camera.preset("physical")
    scene = sl.Scene(11, lighting="noon", duration_s=0.5)
    light = np.minimum(scene.clip(0.2, 3, 1000), 1.0)
    spikes = sl.Simulator(camera).run(light, readouts_per_frame=20, interpolation="linear")
    folder.mkdir(parents=True, exist_ok=True)
    sl.write_stream(folder / "light.dat", spikes, layout="dat", readout_hz=camera.readout_hz, force=True)
    config = f"spike_h: {spikes.height}\nspike_w: {spikes.width}\nis_labeled: false\n"
    (folder / "config.yaml").write_text(config)
    return spikes


if __name__ == "__main__":
    made = write(Path(sys.argv[1] if len(sys.argv) > 1 else "spikecv"))
    rate = made.spike_count / (made.readouts * made.height * made.width)
    print(f"{made.readouts} readouts, {rate:.3f} spikes per pixel and readout")
