"""Random driving scenes: light, and labels as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._progress import ProgressCallback

__all__ = ["RenderedFrame", "Scene", "VehicleBox"]


@dataclass(frozen=True)
class VehicleBox:
    """A vehicle in a picture. Boxes are (left, top, right, bottom) in pixels, right and bottom not included.

    ``visible_box`` encloses its visible pixels, None if there are none; ``amodal_box`` the whole vehicle, which may
    leave the picture. ``occlusion`` and ``truncation`` are shares, 0 to 1. ``center_m`` is in the camera's frame
    (right, down, forward), ``size_m`` (length, width, height), ``rotation_y`` in radians as KITTI has it.
    """

    track_id: int
    vehicle_class: str
    visible_box: tuple[float, float, float, float] | None
    amodal_box: tuple[float, float, float, float]
    visible_pixels: int
    occlusion: float
    truncation: float
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    rotation_y: float
    speed_mps: float


@dataclass(frozen=True)
class RenderedFrame:
    """A scene at ``t`` seconds, with exact labels.

    ``light`` float32 (H, W), linear, 1.0 at white (lamps and highlights lie above); ``rgb`` float32 (H, W, 3),
    linear; ``depth`` float32 (H, W) in meters, infinite in the sky; ``instances`` uint32 (H, W), 0 for none, else the
    ``track_id`` of the boxes; ``semantic`` uint8 (H, W), see ``Scene.semantic_names``; ``flow`` float32 (2, H, W) in
    pixels, columns and rows, to ``flow_to`` seconds; ``occluded`` bool (H, W), hidden there then.
    """

    t: float
    flow_to: float
    boxes: tuple[VehicleBox, ...]
    light: NDArray[np.float32] = field(repr=False)
    rgb: NDArray[np.float32] = field(repr=False)
    depth: NDArray[np.float32] = field(repr=False)
    instances: NDArray[np.uint32] = field(repr=False)
    semantic: NDArray[np.uint8] = field(repr=False)
    flow: NDArray[np.float32] = field(repr=False)
    occluded: NDArray[np.bool_] = field(repr=False)


class Scene:
    """A random city with its traffic and its light, all from ``seed``, and a camera that drives through.

    ``height`` and ``width`` in pixels; ``fov_deg`` 5 to 150 degrees; ``lighting`` one of "noon", "low-sun",
    "overcast", "rain", "tunnel", "dusk", "night"; ``duration_s`` up to 120 s; ``speed_kmh`` 1 to 300; ``vehicles``
    besides the camera's; lamps flicker with ``flicker_hz``. What is left out follows from the seed. Any instant can be
    asked for, in any order. Raises SpikelaneError for values out of range.
    """

    def __init__(
        self,
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
    ) -> None:
        self._native = _native.Scene(
            seed,
            height,
            width,
            fov_deg=fov_deg,
            lighting=lighting,
            duration_s=duration_s,
            speed_kmh=speed_kmh,
            vehicles=vehicles,
            flicker_hz=flicker_hz,
        )

    @property
    def seed(self) -> int:
        """The seed."""
        return self._native.seed

    @property
    def lighting(self) -> str:
        """The light, asked for or drawn."""
        return self._native.lighting

    @property
    def duration_s(self) -> float:
        """Instants from 0 to this many seconds exist."""
        return self._native.duration_s

    @property
    def vehicles(self) -> int:
        """Vehicles besides the camera's; instance numbers run from 1 to this."""
        return self._native.vehicles

    def render(self, t: float, *, flow_to: float | None = None, samples: int = 4, threads: int = 1) -> RenderedFrame:
        """Light and labels at ``t`` seconds, with ``samples`` (4 or 16) color samples a pixel.

        ``flow_to`` is the instant to which the flow goes: one millisecond later unless given (earlier at the end).
        Raises SpikelaneError when an instant lies outside the drive.
        """
        if flow_to is None:
            flow_to = t + 1e-3 if t + 1e-3 <= self.duration_s else max(t - 1e-3, 0.0)
        said = self._native._render(t, samples, threads)
        flow, occluded = self._native.flow(t, flow_to, threads)
        boxes = tuple(VehicleBox(**box) for box in said.pop("boxes"))
        return RenderedFrame(boxes=boxes, flow=flow, occluded=occluded, flow_to=flow_to, **said)

    def flow(self, t: float, to: float, *, threads: int = 1) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Where the pixels of instant ``t`` are at instant ``to`` (seconds, earlier or later).

        Returns float32 (2, H, W), columns to the right and rows down in pixels, and bool (H, W), hidden then.
        """
        return self._native.flow(t, to, threads)

    def clip(
        self,
        t: float,
        frames: int,
        fps: float,
        *,
        samples: int = 4,
        threads: int = 1,
        progress: ProgressCallback | bool | None = None,
    ) -> NDArray[np.float32]:
        """Light of ``frames`` instants from ``t`` on, ``fps`` a second: float32 (frames, H, W), 1.0 at white.

        ``Simulator.run`` and ``simulate_batch`` take this light. ``progress(done, total)`` is called with numbers of frames.
        """
        return self._native.clip(t, frames, fps, samples=samples, threads=threads, progress=progress)

    @staticmethod
    def semantic_names() -> dict[int, str]:
        """Names of the values of ``semantic`` pictures, by value."""
        return _native.Scene.semantic_names()

    def __repr__(self) -> str:
        return repr(self._native)
