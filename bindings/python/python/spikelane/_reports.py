"""Measurement, calibration and diagnosis as functions that return what their reports say."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._progress import ProgressCallback

__all__ = [
    "Calibration",
    "Defects",
    "Diagnosis",
    "Discrepancy",
    "Estimate",
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
    """A value and its standard error, in the unit of the value; NaN where nothing could be told."""

    value: float
    error: float

    @classmethod
    def _from_json(cls, said: Any) -> Estimate:
        value, error = (_number(said or {}, key) for key in ("value", "error"))
        return cls(value, error)


def _number(said: dict[str, Any], key: str) -> float:
    found = said.get(key)
    return float("nan") if found is None else float(found)


@dataclass(frozen=True)
class Statistic:
    """A statistic of a recording: ``key`` without spaces, ``description`` with its unit; NaN stands for what cannot be told.

    ``recording_error`` is the standard deviation between recordings of this sensor, or an upper bound of it if
    ``recording_error_is_bound``. ``sensor_error`` is the standard deviation between sensors of this kind. A value that may
    be 0 is NaN, and is less than ``upper_limit`` with 95 % confidence.
    """

    key: str
    description: str
    value: float
    upper_limit: float
    recording_error: float
    sensor_error: float
    recording_error_is_bound: bool

    @classmethod
    def _from_json(cls, said: dict[str, Any]) -> Statistic:
        numbers = {k: _number(said, k) for k in ("value", "upper_limit", "recording_error", "sensor_error")}
        return cls(
            key=said["key"],
            description=said["description"],
            recording_error_is_bound=said.get("recording_error_is_bound", False),
            **numbers,
        )


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

    ``rate`` and ``local_pattern`` (rate less its 5x5 surroundings) are float64 (H, W); ``interval_histogram`` is int64,
    entry n the number of intervals of n readouts. ``is_moving`` says that the scene moved; errors are then not those of a
    still one, and ``moving_share`` of the pixels changed.
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
        """The statistic called ``key``; KeyError lists those there are."""
        for statistic in self.statistics:
            if statistic.key == key:
                return statistic
        raise KeyError(f"found {key!r}, expected one of {', '.join(s.key for s in self.statistics)}")


@dataclass(frozen=True)
class Lamp:
    """A light level as the recording set states it and as it was found.

    ``light_change`` is the relative difference of the light between the second and the first half of its recording.
    ``mean_rate`` is the mean of the fitted pixels in spikes per readout. ``rate_scatter`` is the spread of their rates about
    their fitted lines, relative to ``mean_rate``. ``readouts`` is 0 for a map of unknown length.
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


@dataclass(frozen=True)
class Calibration:
    """A camera fitted to recordings of known light.

    ``gain`` and ``dark_rate`` are means over the pixels in thresholds per readout (at full light, and in the dark),
    with their spreads; ``threshold_noise`` is relative to the threshold; ``electrons_per_spike`` in electrons.
    ``camera`` has the maps. ``dead_pixels``, ``hot_pixels``, ``poor_fit_pixels`` and ``unfitted_pixels`` are int64 indices
    row * W + col. ``verdict`` is a sentence about the reliability of the camera, and ``cautions`` lists its limits. ``raw``
    is the content of calibration.json.
    """

    camera: _native.Camera
    gain: Estimate
    gain_spread: Estimate
    dark_rate: Estimate
    dark_rate_spread: Estimate
    threshold_spread: Estimate
    threshold_noise: Estimate
    electrons_per_spike: Estimate
    noise_sampling: str
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
    """A fitted number in the parameter's unit, with its 95 % interval."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class FoundEffect:
    """An effect that a diagnosis added; ``is_tentative`` if its name is a likeness only."""

    name: str
    parameters: tuple[Parameter, ...]
    ambiguous_with: tuple[str, ...]
    is_tentative: bool
    evidence: str


@dataclass(frozen=True)
class ParameterMismatch:
    """A number of the model that the recordings contradict, with the 95 % interval of what was fitted."""

    parameter: str
    model_value: float
    fitted_value: float
    low: float
    high: float
    ambiguous_with: tuple[str, ...]


@dataclass(frozen=True)
class UnexplainedStatistic:
    """A statistic of a recording (``where``) that nothing explains, ``z`` standard deviations off."""

    where: str
    z: float


@dataclass(frozen=True)
class Discrepancy:
    """Distance of model and data after each step, on fitted and held-out recordings, and its floor."""

    fitted_set: tuple[float, ...]
    held_out_set: tuple[float, ...]
    noise_floor: float
    noise_floor_sd: float


@dataclass(frozen=True)
class Diagnosis:
    """What a camera has that its model lacks.

    ``verdict`` is "agrees", "explained", "partly-explained" or "unknown"; ``camera`` the model with the effects
    added; ``seconds`` what it took; ``raw`` all of diagnosis.json.
    """

    verdict: str
    camera: _native.Camera
    effects: tuple[FoundEffect, ...]
    parameter_mismatches: tuple[ParameterMismatch, ...]
    unexplained: tuple[UnexplainedStatistic, ...]
    discrepancy: Discrepancy
    recommended_recordings: tuple[str, ...]
    undetectable: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float
    raw: dict[str, Any] = field(repr=False)


def _indices(said: Any) -> NDArray[np.int64]:
    return np.asarray(said, dtype=np.int64)


def measure(
    stream: _native.Stream | _native.SpikeFrames | NDArray[np.uint8] | PathLike,
    height: int | None = None,
    width: int | None = None,
    *,
    progress: ProgressCallback | bool | None = None,
) -> Measurement:
    """Measures a stream of a uniform, dark or static scene.

    ``stream`` is a Stream, SpikeFrames, a path, or bit-packed uint8 (T, ceil(H * W / 8)) with ``height`` and ``width``.
    ``progress(share, 1.0)`` is called during the work; True shows a bar if tqdm is installed. Ctrl-C stops it.
    Raises the errors of ``open_stream``.
    """
    if isinstance(stream, str | os.PathLike):
        stream = _native.open_stream(stream, height=height, width=width)
    said = json.loads(_native.measure(stream, height, width, progress))
    shape = tuple(said["shape"])
    defects = said["defects"]
    return Measurement(
        readouts=said["readouts"],
        temporal_rate_sd=_number(said, "temporal_rate_sd"),
        is_moving=said["scene_motion"]["is_moving"],
        moving_share=said["scene_motion"]["moving_share"],
        defects=Defects(**{kind: _indices(defects[kind]) for kind in ("dead", "stuck", "hot", "weak")}),
        statistics=tuple(Statistic._from_json(statistic) for statistic in said["statistics"]),
        frame_total_lines=tuple(SpectralLine(**line) for line in said["frame_total_lines"]),
        rate=np.array(said["rate"], dtype=np.float64).reshape(shape),
        local_pattern=np.array(said["local_pattern"], dtype=np.float64).reshape(shape),
        interval_histogram=_indices(said["interval_histogram"]),
    )


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
    """Fits a camera to a recording set (a .toml file; `docs/why/calibration.md` has its form).

    ``out`` is a folder for camera.toml, its maps, calibration.json and report.html; without it nothing is written.
    ``dead_time_fraction`` is the share of the first increment after a spike that the reset loses, ``light_uncertainty`` the
    relative standard deviation of the levels, ``max_gain_error`` a relative standard error of the gain to insist on,
    ``snee`` also runs the SCSim paper's estimator. ``progress`` and Ctrl-C as in ``measure``.
    Raises SpikelaneError when the set is bad, FileExistsError unless ``force``.
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
    said = json.loads(text)
    people = said["population"]
    estimate = Estimate._from_json
    return Calibration(
        camera=camera,
        gain=estimate(people["mean_a"]),
        gain_spread=estimate(people["sd_a"]),
        dark_rate=estimate(people["mean_d"]),
        dark_rate_spread=estimate(people["sd_d"]),
        threshold_spread=estimate(people["sigma_phi"]),
        threshold_noise=estimate(said["sigma_t"]),
        electrons_per_spike=estimate(said["electrons_per_spike"]),
        noise_sampling=said["noise_sampling"],
        lamps=tuple(
            Lamp(
                **{
                    **level,
                    "deviation": estimate(level["deviation"]),
                    "light_change": estimate(level.get("light_change")),
                }
            )
            for level in said["lamps"]
        ),
        dead_pixels=_indices(said["dead_pixels"]),
        hot_pixels=_indices(said["hot_pixels"]),
        poor_fit_pixels=_indices(said["poor_fit_pixels"]),
        unfitted_pixels=_indices(said["unfitted_pixels"]),
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
    all_readouts: bool = False,
    out: PathLike | None = None,
    force: bool = False,
    progress: ProgressCallback | bool | None = None,
) -> Diagnosis:
    """Finds what a camera has that its model lacks, names it and adds it (`docs/why/diagnosis.md`).

    ``recordings`` and ``holdout`` are recording sets (.toml); ``camera`` the model to start from, without it the
    published one calibrated. The same ``seed`` gives the same diagnosis. ``all_readouts`` judges all readouts of
    large recordings. ``out`` is a folder for diagnosis.json, camera.toml and report.html. ``progress`` and Ctrl-C
    as in ``measure``. Raises SpikelaneError when a set is bad, FileExistsError unless ``force``.
    """
    text, found = _native.diagnose(
        recordings,
        camera,
        holdout,
        seed,
        all_readouts,
        out,
        force,
        progress,
    )
    said = json.loads(text)
    discrepancy = said["discrepancy"]
    return Diagnosis(
        verdict=said["verdict"],
        camera=found,
        effects=tuple(
            FoundEffect(
                name=e["name"],
                parameters=tuple(Parameter(**p) for p in e["parameters"]),
                ambiguous_with=tuple(e["ambiguous_with"]),
                is_tentative=e["is_tentative"],
                evidence=e["evidence"],
            )
            for e in said["effects"]
        ),
        parameter_mismatches=tuple(
            ParameterMismatch(**{**m, "ambiguous_with": tuple(m["ambiguous_with"])})
            for m in said["parameter_mismatches"]
        ),
        unexplained=tuple(UnexplainedStatistic(**u) for u in said["unexplained"]),
        discrepancy=Discrepancy(
            fitted_set=tuple(discrepancy["fitted_set"]),
            held_out_set=tuple(discrepancy["held_out_set"]),
            noise_floor=discrepancy["noise_floor"],
            noise_floor_sd=discrepancy["noise_floor_sd"],
        ),
        recommended_recordings=tuple(said["recommended_recordings"]),
        undetectable=tuple(said["undetectable"]),
        notes=tuple(said["notes"]),
        seconds=said["seconds"],
        raw=said,
    )
