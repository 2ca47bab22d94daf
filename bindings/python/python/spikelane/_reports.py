"""Measurement, calibration and diagnosis as functions that return what their reports say."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._progress import Callback

__all__ = [
    "Calibration",
    "Defects",
    "Diagnosis",
    "Estimate",
    "FoundEffect",
    "Gap",
    "Lamp",
    "Measurement",
    "Misfit",
    "Parameter",
    "SpectralLine",
    "Statistic",
    "Unexplained",
    "calibrate",
    "diagnose",
    "measure",
]

PathLike = str | os.PathLike[str]


@dataclass(frozen=True)
class Estimate:
    """A value and its standard error, in the unit of the value; NaN where nothing could be told."""

    value: float
    error: float

    @classmethod
    def _of(cls, said: Any) -> Estimate:
        value, error = (_number(said or {}, key) for key in ("value", "error"))
        return cls(value, error)


def _number(said: dict[str, Any], key: str) -> float:
    found = said.get(key)
    return float("nan") if found is None else float(found)


@dataclass(frozen=True)
class Statistic:
    """A statistic of a recording: ``key`` without spaces, ``words`` with its unit; NaN stands for what cannot be told.

    ``recording_error`` is one standard deviation of what another recording of this sensor would give (no more than
    that, where ``at_most``), ``sensor_error`` of what another sensor of this kind would. A value that may be 0 is NaN, and is
    less than ``below`` with 95 % confidence.
    """

    key: str
    words: str
    value: float
    below: float
    recording_error: float
    sensor_error: float
    at_most: bool

    @classmethod
    def _of(cls, said: dict[str, Any]) -> Statistic:
        numbers = {k: _number(said, k) for k in ("value", "below", "recording_error", "sensor_error")}
        return cls(key=said["key"], words=said["words"], at_most=said.get("at_most", False), **numbers)


@dataclass(frozen=True)
class SpectralLine:
    """A line in the spectrum of frame totals.

    ``frequency`` in cycles per readout, ``power`` in spikes squared, ``prominence`` in multiples of what is
    around it; ``harmonic_of_pixel_rate`` is 1 where the line is the pixels' own rate, 0 where it is none of its harmonics.
    """

    frequency: float
    power: float
    prominence: float
    harmonic_of_pixel_rate: int = 0


@dataclass(frozen=True)
class Defects:
    """Pixels that do not behave like the others, each an int64 array of indices row * W + col."""

    dead: NDArray[np.int64]
    stuck: NDArray[np.int64]
    hot: NDArray[np.int64]
    weak: NDArray[np.int64]


@dataclass(frozen=True)
class Measurement:
    """What a recording says of its camera, in the words of EMVA 1288; rates in spikes per readout.

    ``rate`` and ``pattern`` (rate less its 5x5 surroundings) are float64 (H, W); ``interval_histogram`` is int64,
    entry n the number of intervals of n readouts. ``moves`` says that the scene moved; errors are then not those of a
    still one, and ``moving_share`` of the pixels changed.
    """

    readouts: int
    temporal_of_rate: float
    moves: bool
    moving_share: float
    defects: Defects
    statistics: tuple[Statistic, ...]
    frame_total_lines: tuple[SpectralLine, ...]
    rate: NDArray[np.float64] = field(repr=False)
    pattern: NDArray[np.float64] = field(repr=False)
    interval_histogram: NDArray[np.int64] = field(repr=False)

    def __getitem__(self, key: str) -> Statistic:
        """The statistic called ``key``; KeyError lists those there are."""
        for statistic in self.statistics:
            if statistic.key == key:
                return statistic
        raise KeyError(f"found {key!r}, expected one of {', '.join(s.key for s in self.statistics)}")


@dataclass(frozen=True)
class Lamp:
    """A light level as the recording set states it and as it was found.

    ``change`` is by how much, relatively, the light of the second half of its recording differs from the first's. ``rate`` is
    the mean of the pixels that have a line, in spikes per readout; ``scatter`` the spread of their rates about their own
    lines, relative to it; ``readouts`` is 0 for a map of unknown length.
    """

    file: str
    stated: float
    stated_uncertainty: float
    found: float
    deviation: Estimate
    wrong: bool
    saturated: bool
    drifts: bool
    readouts: int
    rate: float
    scatter: float
    change: Estimate


@dataclass(frozen=True)
class Calibration:
    """A camera fitted to recordings of known light.

    ``gain`` and ``dark_rate`` are means over the pixels in thresholds per readout (at full light, and in the dark),
    with their spreads; ``threshold_noise`` is relative to the threshold; ``electrons_per_spike`` in electrons.
    ``camera`` has the maps; ``dead``, ``hot``, ``misfits``, ``unknown_pixels`` are int64 indices row * W + col.
    ``verdict`` says in a sentence how far to trust the camera, ``cautions`` why no further; ``raw`` is all of
    calibration.json.
    """

    camera: _native.Camera
    gain: Estimate
    gain_spread: Estimate
    dark_rate: Estimate
    dark_rate_spread: Estimate
    threshold_spread: Estimate
    threshold_noise: Estimate
    electrons_per_spike: Estimate
    redraw: str
    levels: tuple[Lamp, ...]
    dead: NDArray[np.int64]
    hot: NDArray[np.int64]
    misfits: NDArray[np.int64]
    unknown_pixels: NDArray[np.int64]
    verdict: str
    cautions: tuple[str, ...]
    notes: tuple[str, ...]
    raw: dict[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Parameter:
    """A fitted number in the parameter's unit, with its 95 % interval."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class FoundEffect:
    """An effect that a diagnosis added; ``resembles`` if its name is a likeness only."""

    name: str
    parameters: tuple[Parameter, ...]
    tied_with: tuple[str, ...]
    resembles: bool
    evidence: str


@dataclass(frozen=True)
class Misfit:
    """A number of the model that the recordings contradict, with the 95 % interval of what was fitted."""

    parameter: str
    model: float
    fitted: float
    low: float
    high: float
    tied_with: tuple[str, ...]


@dataclass(frozen=True)
class Unexplained:
    """A statistic of a recording (``where``) that nothing explains, ``z`` standard deviations off."""

    where: str
    z: float


@dataclass(frozen=True)
class Gap:
    """Distance of model and data after each step, on fitted and held-out recordings, and its floor."""

    train: tuple[float, ...]
    heldout: tuple[float, ...]
    floor: float
    floor_sd: float


@dataclass(frozen=True)
class Diagnosis:
    """What a camera has that its model lacks.

    ``verdict`` is "agrees", "explained", "partly-explained" or "unknown"; ``camera`` the model with the effects
    added; ``seconds`` what it took; ``raw`` all of diagnosis.json.
    """

    verdict: str
    camera: _native.Camera
    effects: tuple[FoundEffect, ...]
    misfits: tuple[Misfit, ...]
    unknown: tuple[Unexplained, ...]
    gap: Gap
    settle: tuple[str, ...]
    not_testable: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float
    raw: dict[str, Any] = field(repr=False)


def _indices(said: Any) -> NDArray[np.int64]:
    return np.asarray(said, dtype=np.int64)


def measure(
    stream: _native.Stream | NDArray[np.uint8] | PathLike,
    height: int | None = None,
    width: int | None = None,
    *,
    progress: Callback | bool | None = None,
) -> Measurement:
    """Measures a stream of a uniform, dark or static scene.

    ``stream`` is a Stream, a path, or bit-packed uint8 (T, ceil(H * W / 8)) with ``height`` and ``width``.
    ``progress(share, 1.0)`` hears about the work; True shows tqdm's bar where tqdm is installed. Ctrl-C stops it.
    Raises as ``open_stream``.
    """
    if isinstance(stream, str | os.PathLike):
        stream = _native.open_stream(os.fspath(stream), height=height, width=width)
    said = json.loads(_native.measure(stream, height, width, progress))
    shape = tuple(said["shape"])
    defects = said["defects"]
    return Measurement(
        readouts=said["readouts"],
        temporal_of_rate=_number(said, "temporal_of_rate"),
        moves=said["scene"]["moves"],
        moving_share=said["scene"]["share"],
        defects=Defects(**{kind: _indices(defects[kind]) for kind in ("dead", "stuck", "hot", "weak")}),
        statistics=tuple(Statistic._of(statistic) for statistic in said["statistics"]),
        frame_total_lines=tuple(SpectralLine(**line) for line in said["frame_total_lines"]),
        rate=np.array(said["rate"], dtype=np.float64).reshape(shape),
        pattern=np.array(said["pattern"], dtype=np.float64).reshape(shape),
        interval_histogram=_indices(said["interval_histogram"]),
    )


def calibrate(
    recordings: PathLike,
    *,
    out: PathLike | None = None,
    dead_time: float = 0.002,
    light_uncertainty: float | None = None,
    precision: float | None = None,
    paper: bool = False,
    force: bool = False,
    progress: Callback | bool | None = None,
) -> Calibration:
    """Fits a camera to a recording set (a .toml file; `docs/why/calibration.md` has its form).

    ``out`` is a folder for camera.toml, its maps, calibration.json and report.html; without it nothing is written.
    ``dead_time`` is the share of the first increment after a spike that the reset loses, ``light_uncertainty`` the
    relative standard deviation of the levels, ``precision`` a relative standard error of the gain to insist on,
    ``paper`` also runs the SCSim paper's estimator. ``progress`` and Ctrl-C as in ``measure``.
    Raises SpikelaneError when the set is bad, FileExistsError unless ``force``.
    """
    text, camera = _native.calibrate(
        os.fspath(recordings),
        None if out is None else os.fspath(out),
        dead_time,
        light_uncertainty,
        precision,
        paper,
        force,
        progress,
    )
    said = json.loads(text)
    people = said["population"]
    estimate = Estimate._of
    return Calibration(
        camera=camera,
        gain=estimate(people["mean_a"]),
        gain_spread=estimate(people["sd_a"]),
        dark_rate=estimate(people["mean_d"]),
        dark_rate_spread=estimate(people["sd_d"]),
        threshold_spread=estimate(people["sigma_phi"]),
        threshold_noise=estimate(said["sigma_t"]),
        electrons_per_spike=estimate(said["electrons_per_spike"]),
        redraw=said["redraw"],
        levels=tuple(
            Lamp(**{**level, "deviation": estimate(level["deviation"]), "change": estimate(level.get("change"))})
            for level in said["levels"]
        ),
        dead=_indices(said["dead"]),
        hot=_indices(said["hot"]),
        misfits=_indices(said["misfits"]),
        unknown_pixels=_indices(said["unknown_pixels"]),
        verdict=said["verdict"],
        cautions=tuple(said["cautions"]),
        notes=tuple(said["notes"]),
        raw=said,
    )


def diagnose(
    recordings: PathLike,
    camera: _native.Camera | None = None,
    *,
    holdout: PathLike | None = None,
    seed: int = 1,
    everything: bool = False,
    out: PathLike | None = None,
    force: bool = False,
    progress: Callback | bool | None = None,
) -> Diagnosis:
    """Finds what a camera has that its model lacks, names it and adds it (`docs/why/diagnosis.md`).

    ``recordings`` and ``holdout`` are recording sets (.toml); ``camera`` the model to start from, without it the
    published one calibrated. The same ``seed`` gives the same diagnosis. ``everything`` judges all readouts of
    large recordings. ``out`` is a folder for diagnosis.json, camera.toml and report.html. ``progress`` and Ctrl-C
    as in ``measure``. Raises SpikelaneError when a set is bad, FileExistsError unless ``force``.
    """
    text, found = _native.diagnose(
        os.fspath(recordings),
        camera,
        None if holdout is None else os.fspath(holdout),
        seed,
        everything,
        None if out is None else os.fspath(out),
        force,
        progress,
    )
    said = json.loads(text)
    gap = said["gap"]
    return Diagnosis(
        verdict=said["verdict"],
        camera=found,
        effects=tuple(
            FoundEffect(
                name=e["name"],
                parameters=tuple(Parameter(**p) for p in e["parameters"]),
                tied_with=tuple(e["tied_with"]),
                resembles=e["resembles"],
                evidence=e["evidence"],
            )
            for e in said["effects"]
        ),
        misfits=tuple(Misfit(**{**m, "tied_with": tuple(m["tied_with"])}) for m in said["misfits"]),
        unknown=tuple(Unexplained(**u) for u in said["unknown"]),
        gap=Gap(tuple(gap["train"]), tuple(gap["heldout"]), gap["floor"], gap["floor_sd"]),
        settle=tuple(said["settle"]),
        not_testable=tuple(said["not_testable"]),
        notes=tuple(said["notes"]),
        seconds=said["seconds"],
        raw=said,
    )
