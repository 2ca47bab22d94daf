"""Measurement, calibration and diagnosis; each function returns the content of its report."""

from __future__ import annotations

import json
import os
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._progress import ProgressCallback

__all__ = [
    "Calibration",
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
    "SpectralLine",
    "Statistic",
    "UnexplainedStatistic",
    "calibrate",
    "diagnose",
    "measure",
]

PathLike = str | os.PathLike[str]


@dataclass(frozen=True)
class Estimate:
    """A value and its standard error, in the unit of the value; NaN if the data determine no value."""

    value: float
    error: float


@dataclass(frozen=True)
class Statistic:
    """A statistic of a recording. ``key`` is a name without spaces, and ``description`` contains the unit.

    ``recording_error`` is the standard deviation between recordings of this sensor. If ``recording_error_is_bound`` is true,
    it is an upper bound of this standard deviation. ``sensor_error`` is the standard deviation between sensors of this kind.
    If ``value`` is not significantly above 0, it is NaN, and the true value is below ``upper_limit`` with 95 % confidence.
    A number that the recording does not determine is NaN.
    """

    key: str
    description: str
    value: float
    upper_limit: float
    recording_error: float
    sensor_error: float
    recording_error_is_bound: bool


@dataclass(frozen=True)
class SpectralLine:
    """A line in the spectrum of frame totals.

    ``frequency`` is in cycles per readout and ``power`` in squared spikes. ``prominence`` is the ratio of the power to the
    power of the neighboring frequencies. ``harmonic_of_pixel_rate`` is n if the line is the n-th harmonic of the mean firing
    rate of the pixels, and 0 if the line is no such harmonic.
    """

    frequency: float
    power: float
    prominence: float
    harmonic_of_pixel_rate: int = 0


@dataclass(frozen=True)
class Defects:
    """Defective pixels of each kind, as int64 arrays of indices row * W + col."""

    dead: NDArray[np.int64]
    stuck: NDArray[np.int64]
    hot: NDArray[np.int64]
    weak: NDArray[np.int64]


@dataclass(frozen=True)
class Measurement:
    """The statistics of a recording, with the terms of EMVA 1288. Rates are in spikes per readout.

    ``rate`` and ``local_pattern`` are float64 (H, W). ``local_pattern`` is ``rate`` minus the mean of its 5x5 neighborhood.
    ``interval_histogram`` is int64; entry n is the number of intervals of n readouts. ``is_moving`` is true if the scene
    moved during the recording. The errors of a moving scene are not valid. ``moving_share`` is the share of changed pixels.
    """

    readouts: int
    temporal_rate_sd: float
    is_moving: bool
    moving_share: float
    defects: Defects
    statistics: tuple[Statistic, ...]
    frame_total_lines: tuple[SpectralLine, ...]
    rate: NDArray[np.float64] = field(repr=False)
    local_pattern: NDArray[np.float64] = field(repr=False)
    interval_histogram: NDArray[np.int64] = field(repr=False)

    def __getitem__(self, key: str) -> Statistic:
        """Returns the statistic named ``key``. Raises KeyError with a list of all keys if there is none."""
        for statistic in self.statistics:
            if statistic.key == key:
                return statistic
        raise KeyError(f"found {key!r}, expected one of {', '.join(s.key for s in self.statistics)}")


@dataclass(frozen=True)
class Flicker:
    """An oscillation of the light. ``depth`` is its amplitude relative to the mean light."""

    frequency_hz: float
    depth: float


@dataclass(frozen=True)
class Lamp:
    """The light level of a recording: the stated level of the recording set and the fitted level.

    ``pull`` is the relative deviation divided by ``stated_uncertainty``, or None for a dark or saturated level. A lamp whose
    pull exceeds 3.5 is an outlier. ``light_change`` is the relative difference of the light between the second and the first
    half of the recording. ``flicker`` is the strongest oscillation of the light, or None. ``is_light_change_removed`` states
    whether rates and intervals were corrected for the change of the light.
    ``mean_rate`` is the mean rate of the fitted pixels in spikes per readout. ``rate_scatter`` is the spread of pixel rates
    around the fitted lines of the pixels, relative to ``mean_rate``. ``readouts`` is 0 for a map of unknown length.
    """

    file: str
    stated_light: float
    stated_uncertainty: float
    found_light: float
    deviation: Estimate
    is_outlier: bool
    is_saturated: bool
    drifts: bool
    readouts: int
    mean_rate: float
    rate_scatter: float
    light_change: Estimate
    is_light_change_removed: bool
    flicker: Flicker | None = None
    pull: float | None = None


@dataclass(frozen=True)
class Calibration:
    """A camera fitted to recordings of known light.

    ``gain`` and ``dark_rate`` are means over the pixels in thresholds per readout, at full-scale light and in the dark.
    ``gain_spread`` and ``dark_rate_spread`` are the standard deviations between pixels. ``threshold_spread`` and
    ``threshold_noise`` are relative to the threshold. ``electrons_per_threshold`` does not depend on the unit of light.
    ``photons_at_full_light`` is the parameter of the camera file. ``redraw_share`` is the share of the threshold noise
    that is redrawn at every readout. ``corner_falloff`` is the falloff of the light at the corners, or None for uniform
    light. ``class_gains`` lists the mean gains of the four pixels of a 2x2 cell if they differ. ``camera`` contains the
    maps.
    ``dead_pixels``, ``hot_pixels``, ``poor_fit_pixels`` and ``unfitted_pixels`` are int64 indices row * W + col.
    ``verdict`` is a sentence about the reliability of the camera, and ``cautions`` lists the limits of the camera. ``raw`` is
    the content of calibration.json.
    """

    camera: _native.Camera
    gain: Estimate
    gain_spread: Estimate
    dark_rate: Estimate
    dark_rate_spread: Estimate
    threshold_spread: Estimate
    threshold_noise: Estimate
    electrons_per_threshold: Estimate
    photons_at_full_light: Estimate
    redraw_share: Estimate
    noise_sampling: str
    corner_falloff: Estimate | None
    class_gains: tuple[Estimate, ...]
    lamps: tuple[Lamp, ...]
    dead_pixels: NDArray[np.int64]
    hot_pixels: NDArray[np.int64]
    poor_fit_pixels: NDArray[np.int64]
    unfitted_pixels: NDArray[np.int64]
    verdict: str
    cautions: tuple[str, ...]
    notes: tuple[str, ...]
    raw: dict[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Parameter:
    """A fitted number in the unit of the parameter, with its 95 % interval from ``low`` to ``high``."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class FoundEffect:
    """An effect that a diagnosis added; ``is_tentative`` is true if the name may stand for another effect."""

    name: str
    parameters: tuple[Parameter, ...]
    ambiguous_with: tuple[str, ...]
    is_tentative: bool
    evidence: str


@dataclass(frozen=True)
class ParameterMismatch:
    """A model parameter that the recordings contradict; ``low`` and ``high`` are the 95 % interval of the fit.

    ``is_tentative`` is true if the held-out recordings do not confirm the mismatch, or if the mismatch explains only a part.
    """

    parameter: str
    model_value: float
    fitted_value: float
    low: float
    high: float
    ambiguous_with: tuple[str, ...]
    is_tentative: bool


@dataclass(frozen=True)
class EffectLimit:
    """The largest strength of an effect with which the recordings are compatible, with 95 % confidence.

    ``limit`` is the difference of ``parameter`` from the value of the model. It is the largest value over the tried shapes
    of the effect, and ``median_limit`` is the median. A limit is None if the recordings are compatible with
    ``largest_tried``.
    """

    name: str
    parameter: str
    limit: float | None
    median_limit: float | None
    largest_tried: float


@dataclass(frozen=True)
class UnexplainedStatistic:
    """A statistic of a recording (``where``) that no effect explains; ``z`` is its deviation in standard deviations."""

    where: str
    z: float


@dataclass(frozen=True)
class Discrepancy:
    """The squared distance between model and recordings after each step, and its noise floor."""

    fitted_set: tuple[float, ...]
    held_out_set: tuple[float, ...]
    noise_floor: float
    noise_floor_sd: float


@dataclass(frozen=True)
class Diagnosis:
    """The effects of a camera that its model lacks.

    ``verdict`` is "agrees", "explained", "partly-explained", "unknown" or "undecided". ``camera`` is the model with the
    added effects. ``limits`` has upper limits for the other effects if the verdict is "agrees" or "explained".
    ``undecided`` lists the questions that ``time_limit`` left open. ``seconds`` is the duration of the diagnosis, and
    ``raw`` is the content of diagnosis.json.
    """

    verdict: str
    camera: _native.Camera
    effects: tuple[FoundEffect, ...]
    parameter_mismatches: tuple[ParameterMismatch, ...]
    unexplained: tuple[UnexplainedStatistic, ...]
    discrepancy: Discrepancy
    limits: tuple[EffectLimit, ...]
    undecided: tuple[str, ...]
    recommended_recordings: tuple[str, ...]
    undetectable: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float
    raw: dict[str, Any] = field(repr=False)


def _from_json(kind: Any, data: dict[str, Any] | None, **values: Any) -> Any:
    """Returns the dataclass ``kind`` with the fields of ``data``, and with ``values`` for the fields that are not in it.

    The types of the fields state the conversion. A missing number is NaN, and a missing list is empty.
    """
    data = data or {}
    hints = get_type_hints(kind)
    for each in fields(kind):
        if each.name not in values and (each.name in data or each.default is MISSING):
            values[each.name] = _convert(hints[each.name], data.get(each.name))
    return kind(**values)


def _convert(hint: Any, value: Any) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is UnionType:
        return None if value is None else _convert(arguments[0], value)
    if origin is tuple:
        return tuple(_convert(arguments[0], item) for item in value or ())
    if origin is np.ndarray:
        return np.asarray(value, dtype=get_args(arguments[1])[0])
    if is_dataclass(hint):
        return _from_json(hint, value)
    if hint is float:
        return float("nan") if value is None else float(value)
    return bool(value) if hint is bool else value


def measure(
    stream: _native.Stream | _native.SpikeFrames | NDArray[np.uint8] | PathLike,
    height: int | None = None,
    width: int | None = None,
    *,
    progress: ProgressCallback | bool | None = None,
) -> Measurement:
    """Measures a stream of a uniform, dark or static scene.

    ``stream`` is a Stream, SpikeFrames, a path, or bit-packed uint8 (T, ceil(H * W / 8)) with ``height`` and ``width``.
    The function calls ``progress(share, 1.0)`` during the work; True shows a bar if tqdm is installed. Ctrl-C stops the
    measurement. Raises the errors of ``open_stream``.
    """
    if isinstance(stream, str | os.PathLike):
        stream = _native.open_stream(stream, height=height, width=width)
    data = json.loads(_native.measure(stream, height, width, progress))
    maps = {key: np.reshape(data[key], data["shape"]).astype(np.float64) for key in ("rate", "local_pattern")}
    measurement: Measurement = _from_json(Measurement, {**data, **data["scene_motion"]}, **maps)
    return measurement


def calibrate(
    recordings: PathLike,
    *,
    out: PathLike | None = None,
    dead_time_fraction: float = 0.002,
    light_uncertainty: float | None = None,
    max_gain_error: float | None = None,
    snee: bool = False,
    force: bool = False,
    progress: ProgressCallback | bool | None = None,
) -> Calibration:
    """Fits a camera to a recording set (a .toml file; `docs/why/calibration.md` describes the format).

    ``out`` is a folder for camera.toml, its maps, calibration.json and report.html; without ``out``, no file is written.
    ``dead_time_fraction`` is the share of the first increment after a spike that the reset discards. ``light_uncertainty``
    is the relative standard deviation of the levels. ``max_gain_error`` is the largest accepted median, over the pixels, of
    the relative standard error of the gain. ``snee`` also runs the estimator of the SCSim paper. ``progress`` and Ctrl-C work
    as in ``measure``.
    Raises SpikelaneError if the set is invalid, and FileExistsError if an output exists and ``force`` is false.
    """
    text, camera = _native.calibrate(
        recordings,
        out,
        dead_time_fraction,
        light_uncertainty,
        max_gain_error,
        snee,
        force,
        progress,
    )
    data = json.loads(text)
    population = data["population"]
    renamed = {
        "gain": population["mean_a"],
        "gain_spread": population["sd_a"],
        "dark_rate": population["mean_d"],
        "dark_rate_spread": population["sd_d"],
        "threshold_spread": population["sigma_phi"],
        "threshold_noise": data["sigma_t"],
        "corner_falloff": data.get("light_field", {}).get("corner_falloff"),
    }
    calibration: Calibration = _from_json(Calibration, {**data, **renamed}, camera=camera, raw=data)
    return calibration


def diagnose(
    recordings: PathLike,
    camera: _native.Camera | None = None,
    *,
    holdout: PathLike | None = None,
    seed: int = 1,
    all_readouts: bool = False,
    time_limit: float | None = None,
    out: PathLike | None = None,
    force: bool = False,
    progress: ProgressCallback | bool | None = None,
) -> Diagnosis:
    """Finds, names and adds the effects that a camera model is missing (`docs/why/diagnosis.md`).

    ``recordings`` and ``holdout`` are recording sets (.toml). ``camera`` is the initial model; without ``camera``, the
    function calibrates the published model. The same ``seed`` gives the same diagnosis. ``all_readouts`` uses all readouts
    of large recordings. ``time_limit`` ends the simulations after this many seconds; ``Diagnosis.undecided`` then lists
    the open questions. ``out`` is a folder for diagnosis.json, camera.toml and report.html. ``progress`` and Ctrl-C work
    as in ``measure``. Raises SpikelaneError if a set is invalid, and FileExistsError if an output exists and ``force`` is
    false.
    """
    text, found = _native.diagnose(
        recordings,
        camera,
        holdout,
        seed,
        all_readouts,
        time_limit,
        out,
        force,
        progress,
    )
    data = json.loads(text)
    diagnosis: Diagnosis = _from_json(Diagnosis, data, camera=found, raw=data)
    return diagnosis
