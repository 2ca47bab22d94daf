# Types of the native half; its docstrings say shapes, ranges, units and errors.
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, TypeAlias, final, overload

import numpy as np
from numpy.typing import NDArray

__version__: str
__all__ = [
    "Camera",
    "CameraDistribution",
    "Scene",
    "Simulator",
    "Stream",
    "__version__",
    "calibrate",
    "command",
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

_Light: TypeAlias = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32] | NDArray[Any]
_Bytes: TypeAlias = NDArray[np.uint8]
_Path: TypeAlias = str | PathLike[str]
_Progress: TypeAlias = Callable[[float, float], object] | bool | None

@final
class Camera:
    @classmethod
    def preset(cls, name: str) -> Camera: ...
    @classmethod
    def load(cls, path: _Path) -> Camera: ...
    @classmethod
    def from_toml(cls, text: str, folder: _Path | None = None) -> Camera: ...
    @classmethod
    def from_bytes(cls, data: bytes) -> Camera: ...
    @classmethod
    def ideal(cls, height: int, width: int, readout_hz: float = 20_000.0) -> Camera: ...
    def with_effect(self, name: str, /, **values: float | str) -> Camera: ...
    def without(self, name: str) -> Camera: ...
    def with_sensor(
        self,
        *,
        readout_hz: float | None = None,
        capacitance_ff: float | None = None,
        swing_v: float | None = None,
        thresholds_at_full_scale: float | None = None,
    ) -> Camera: ...
    def with_maps(
        self,
        *,
        gain: NDArray[np.float64] | None = None,
        dark_pa: NDArray[np.float64] | None = None,
        capacitance_ff: NDArray[np.float64] | None = None,
        swing_v: NDArray[np.float64] | None = None,
    ) -> Camera: ...
    def resized(self, height: int, width: int) -> Camera: ...
    def window(self, row: int, col: int, height: int, width: int) -> Camera: ...
    def clean_twin(self) -> Camera: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def readout_hz(self) -> float: ...
    @property
    def thresholds_at_full_scale(self) -> float: ...
    @property
    def name(self) -> str: ...
    @property
    def source(self) -> str: ...
    @property
    def place(self) -> tuple[int, int, int, int] | None: ...
    @property
    def effects(self) -> dict[str, dict[str, float | str]]: ...
    @property
    def maps(self) -> dict[str, NDArray[np.float64]]: ...
    def to_toml(self) -> str: ...
    def to_bytes(self) -> bytes: ...
    def save(self, folder: _Path, force: bool = False) -> Path: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class CameraDistribution:
    def __new__(cls, text: str | None = None) -> CameraDistribution: ...
    @classmethod
    def load(cls, path: _Path) -> CameraDistribution: ...
    def draw(self, seed: int) -> Camera: ...
    @property
    def ranges(self) -> dict[str, tuple[float, float, str, str]]: ...
    def to_toml(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Simulator:
    def __new__(
        cls,
        camera: Camera,
        *,
        seed: int = 0,
        sequence: int = 0,
        camera_seed: int = 0,
        threads: int = 1,
        backend: str | None = None,
        greatest_light: float = 1.0,
    ) -> Simulator: ...
    def push(
        self,
        frames: _Light,
        readouts_per_frame: int = 1,
        *,
        insertion: str = "linear",
        readouts: int | None = None,
        out: _Bytes | None = None,
        progress: _Progress = None,
        copy: bool = True,
    ) -> _Bytes: ...
    def push_bits(
        self,
        frames: _Light,
        readouts_per_frame: int = 1,
        *,
        insertion: str = "linear",
        readouts: int | None = None,
        out: _Bytes | None = None,
        progress: _Progress = None,
        copy: bool = True,
    ) -> _Bytes: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def readout(self) -> int: ...
    @property
    def backend(self) -> str: ...
    @property
    def seeds(self) -> tuple[int, int, int]: ...
    def state(self) -> bytes: ...
    def restore(self, state: bytes) -> None: ...
    def restart(self, sequence: int | None = None, seed: int | None = None) -> None: ...
    def __getnewargs_ex__(self) -> tuple[tuple[Camera], dict[str, Any]]: ...
    def __getstate__(self) -> bytes: ...
    def __setstate__(self, state: bytes) -> None: ...

@final
class Stream:
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def layout(self) -> str: ...
    @property
    def path(self) -> Path: ...
    @property
    def closed(self) -> bool: ...
    def bits(self, first: int = 0, end: int | None = None) -> _Bytes: ...
    def close(self) -> None: ...
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> _Bytes: ...
    @overload
    def __getitem__(self, index: slice, /) -> _Bytes: ...
    def __enter__(self) -> Stream: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def __exit__(self, *_exception: type[BaseException] | BaseException | TracebackType | None) -> None: ...

@final
class Scene:
    def __new__(
        cls,
        seed: int,
        height: int = 250,
        width: int = 400,
        *,
        fov_deg: float | None = None,
        lighting: str | None = None,
        duration_s: float = 4.0,
        speed_kmh: float | None = None,
        vehicles: int | None = None,
        flicker_hz: float | None = None,
    ) -> Scene: ...
    @property
    def seed(self) -> int: ...
    @property
    def lighting(self) -> str: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def vehicles(self) -> int: ...
    def _render(self, t: float, samples: int = 4, threads: int = 1) -> dict[str, Any]: ...
    def flow(self, t: float, to: float, threads: int = 1) -> tuple[NDArray[np.float32], NDArray[np.bool_]]: ...
    def clip(
        self,
        t: float,
        frames: int,
        hz: float,
        *,
        samples: int = 4,
        threads: int = 1,
        progress: _Progress = None,
    ) -> NDArray[np.float32]: ...
    @staticmethod
    def semantic_names() -> dict[int, str]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[int, int, int], dict[str, Any]]: ...

def command(args: Sequence[str]) -> int: ...
def presets() -> list[str]: ...
def effects() -> dict[str, dict[str, Any]]: ...
def simulate_batch(
    camera: Camera | Sequence[Camera],
    clips: _Light | Sequence[_Light],
    readouts_per_frame: int = 1,
    *,
    sequences: Iterable[int],
    seed: int = 0,
    camera_seed: int | Iterable[int] | None = None,
    windows: Iterable[Iterable[int]] | None = None,
    insertion: str = "linear",
    readouts: int | None = None,
    threads: int = 1,
    bits: bool = True,
    greatest_light: float = 1.0,
    out: _Bytes | None = None,
    progress: _Progress = None,
    copy: bool = True,
) -> _Bytes: ...
def light_at(
    frames: _Light, at: Sequence[int], readouts_per_frame: int = 1, *, insertion: str = "linear"
) -> NDArray[np.float32]: ...
def unpack(packed: _Bytes, height: int, width: int, *, out: _Bytes | None = None) -> _Bytes: ...
def pack(bits: _Bytes) -> _Bytes: ...
def tfp(packed: _Bytes, height: int, width: int, at: int, half_window: int) -> NDArray[np.float32]: ...
def tfi(packed: _Bytes, height: int, width: int, at: int, search: int = 20) -> NDArray[np.float32]: ...
def span_rate(packed: _Bytes, height: int, width: int, at: int, half_window: int) -> NDArray[np.float32]: ...
def open_stream(
    path: _Path, *, layout: str | None = None, height: int | None = None, width: int | None = None
) -> Stream: ...
def write_stream(
    path: _Path,
    spikes: _Bytes,
    *,
    height: int | None = None,
    width: int | None = None,
    layout: str = "dat",
    readout_hz: float | None = None,
    sidecar: bool = True,
    force: bool = False,
    progress: _Progress = None,
) -> str: ...
def measure(
    stream: Stream | _Bytes, height: int | None = None, width: int | None = None, progress: _Progress = None
) -> str: ...
def calibrate(
    recordings: _Path,
    out: _Path | None = None,
    dead_time: float = 0.002,
    light_uncertainty: float | None = None,
    precision: float | None = None,
    paper: bool = False,
    force: bool = False,
    progress: _Progress = None,
) -> tuple[str, Camera]: ...
def diagnose(
    recordings: _Path,
    camera: Camera | None = None,
    holdout: _Path | None = None,
    seed: int = 1,
    everything: bool = False,
    out: _Path | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> tuple[str, Camera]: ...
