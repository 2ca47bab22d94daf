"""Spike-camera simulation: light in, bit-packed spike streams out.

A simulation turns light and a `Camera` into `SpikeFrames`: use `Simulator` for one stream, `simulate_batch` for many streams,
and `spikelane.torch` for training. `open_stream` and `write_stream` read and write files. `tfp`, `tfi` and `span_rates`
reconstruct images. `measure`, `calibrate` and `diagnose` analyze recordings of a camera. `Scene` renders traffic with labels.

    >>> import numpy as np
    >>> import spikelane as sl
    >>> camera = sl.Camera.preset("physical")
    >>> light = np.full(camera.shape, 51, np.uint8)
    >>> spikes = sl.Simulator(camera, seed=1).run(light, 1000)
    >>> image = sl.tfp(spikes, at=500, half_window=20)

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
    SpikelaneWarning,
)
from ._native import (
    Camera,
    CameraDistribution,
    Simulator,
    SpikeFrames,
    Stream,
    __version__,
    effects,
    light_at,
    open_stream,
    pack,
    presets,
    simulate_batch,
    span_rates,
    tfi,
    tfp,
    unpack,
    write_stream,
)
from ._reports import (
    Calibration,
    Defects,
    Diagnosis,
    Discrepancy,
    EffectLimit,
    Estimate,
    Flicker,
    FoundEffect,
    Lamp,
    Measurement,
    Parameter,
    ParameterMismatch,
    SpectralLine,
    Statistic,
    UnexplainedStatistic,
    calibrate,
    diagnose,
    measure,
)
from ._scene import RenderedFrame, Scene, VehicleBox

__all__ = [
    "Calibration",
    "Camera",
    "CameraDistribution",
    "ClipSampler",
    "Defects",
    "Diagnosis",
    "Discrepancy",
    "EffectLimit",
    "Estimate",
    "Flicker",
    "FoundEffect",
    "Lamp",
    "Measurement",
    "Parameter",
    "ParameterMismatch",
    "RenderedFrame",
    "Scene",
    "Simulator",
    "SpectralLine",
    "SpikeFrames",
    "SpikelaneError",
    "SpikelaneFileExistsError",
    "SpikelaneFileNotFoundError",
    "SpikelaneOSError",
    "SpikelaneTypeError",
    "SpikelaneWarning",
    "Statistic",
    "Stream",
    "UnexplainedStatistic",
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
    "span_rates",
    "tfi",
    "tfp",
    "unpack",
    "write_stream",
]
