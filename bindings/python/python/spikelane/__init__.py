"""Spike-camera simulation: light in, bit-packed spike streams out.

A camera (`Camera`) and a light give spikes: `Simulator` for one stream, `simulate_batch` for many, `spikelane.torch` for
training. `open_stream` and `write_stream` read and write files in the layouts of the field; `tfp`, `tfi` and `span_rate` make
pictures; `measure`, `calibrate` and `diagnose` tell what a recording says of its camera; `Scene` draws traffic with labels.

The same camera, seeds and light give the same bits as the program `spikelane` and the Rust library, on every machine and with
any number of threads.
"""

from ._clips import ClipSampler
from ._errors import (
    SpikelaneError,
    SpikelaneFileExistsError,
    SpikelaneFileNotFoundError,
    SpikelaneOSError,
    SpikelaneTypeError,
)
from ._native import (
    Camera,
    CameraDistribution,
    Simulator,
    Stream,
    __version__,
    effects,
    light_at,
    open_stream,
    pack,
    presets,
    simulate_batch,
    span_rate,
    tfi,
    tfp,
    unpack,
    write_stream,
)
from ._reports import (
    Calibration,
    Defects,
    Diagnosis,
    Estimate,
    FoundEffect,
    Gap,
    Lamp,
    Measurement,
    Misfit,
    Parameter,
    SpectralLine,
    Statistic,
    Unexplained,
    calibrate,
    diagnose,
    measure,
)
from ._scene import Rendered, Scene, VehicleBox

__all__ = [
    "Calibration",
    "Camera",
    "CameraDistribution",
    "ClipSampler",
    "Defects",
    "Diagnosis",
    "Estimate",
    "FoundEffect",
    "Gap",
    "Lamp",
    "Measurement",
    "Misfit",
    "Parameter",
    "Rendered",
    "Scene",
    "Simulator",
    "SpectralLine",
    "SpikelaneError",
    "SpikelaneFileExistsError",
    "SpikelaneFileNotFoundError",
    "SpikelaneOSError",
    "SpikelaneTypeError",
    "Statistic",
    "Stream",
    "Unexplained",
    "VehicleBox",
    "__version__",
    "calibrate",
    "diagnose",
    "effects",
    "light_at",
    "measure",
    "open_stream",
    "pack",
    "presets",
    "simulate_batch",
    "span_rate",
    "tfi",
    "tfp",
    "unpack",
    "write_stream",
]
