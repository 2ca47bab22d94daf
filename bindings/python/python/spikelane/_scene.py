"""Random driving scenes, with light and labels as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._progress import ProgressCallback

__all__ = ["RenderedFrame", "Scene", "VehicleBox"]


@dataclass(frozen=True)
class VehicleBox:
    """A vehicle in an image. Boxes are (left, top, right, bottom) in pixels and exclude the right column and bottom row.

    ``visible_box`` encloses the visible pixels of the vehicle, or is None if no pixel is visible. ``amodal_box`` encloses
    the whole vehicle with its hidden parts and can extend beyond the image. ``occlusion`` and ``truncation`` are shares
    from 0 to 1. ``center_m`` has the camera coordinates (right, down, forward), ``size_m`` is (length, width, height), and
    ``rotation_y`` is the angle of KITTI in radians.
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

    - ``light``: float32 (H, W), linear, 1.0 at white; lamps and highlights exceed 1.0;
    - ``rgb``: float32 (H, W, 3), linear, in cd/m2, with the full light of lamps;
    - ``depth``: float32 (H, W) in meters, infinite in the sky;
    - ``instances``: uint32 (H, W), the ``track_id`` of the vehicle, or 0 where no vehicle is visible;
    - ``semantic``: uint8 (H, W), with the values of ``Scene.semantic_names``;
    - ``flow``: float32 (2, H, W), the motion from ``t`` to ``flow_to`` in pixels, first columns, then rows;
    - ``occluded``: bool (H, W), true if the point of the pixel is hidden at ``flow_to`` seconds.
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
    """A random city with traffic and a moving camera. ``seed`` determines the city, the traffic and the light.

    ``height`` and ``width`` are in pixels. ``fov_deg`` is 5 to 150 degrees. ``lighting`` is "noon", "low-sun", "overcast",
    "rain", "tunnel", "dusk" or "night". ``duration_s`` is at most 120 s, and ``speed_kmh`` is 1 to 300 km/h. ``vehicles`` is
    the number of vehicles besides the vehicle of the camera. Lamps flicker with ``flicker_hz`` Hz. The seed determines
    omitted values and the lens; ``ideal_lens`` omits blur, glare, vignetting and distortion. The exposure follows the
    scene, and ``lock_exposure`` keeps it as it is at the start. The scene renders any instant of the drive, in any order.
    Raises SpikelaneError if a value is out of range.
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
        ideal_lens: bool = False,
        lock_exposure: bool = False,
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
            ideal_lens=ideal_lens,
            lock_exposure=lock_exposure,
        )

    @property
    def seed(self) -> int:
        """The seed of the scene."""
        return self._native.seed

    @property
    def lighting(self) -> str:
        """The lighting: the argument, or the value that the seed determines."""
        return self._native.lighting

    @property
    def duration_s(self) -> float:
        """The duration of the drive in seconds; instants are 0 to ``duration_s``."""
        return self._native.duration_s

    @property
    def vehicles(self) -> int:
        """The number of vehicles besides the vehicle of the camera; instance numbers are 1 to ``vehicles``."""
        return self._native.vehicles

    def render(self, t: float, *, flow_to: float | None = None, samples: int = 4, threads: int = 1) -> RenderedFrame:
        """Renders light and labels at ``t`` seconds, with ``samples`` (4 or 16) color samples per pixel.

        ``flow_to`` is the end of the motion in ``flow``, in seconds. The default is ``t`` + 1 ms, and ``t`` - 1 ms at the end
        of the drive. Raises SpikelaneError if an instant is outside the drive.
        """
        if flow_to is None:
            flow_to = t + 1e-3 if t + 1e-3 <= self.duration_s else max(t - 1e-3, 0.0)
        rendered = self._native._render(t, samples, threads)
        flow, occluded = self._native.flow(t, flow_to, threads)
        boxes = tuple(VehicleBox(**box) for box in rendered.pop("boxes"))
        return RenderedFrame(boxes=boxes, flow=flow, occluded=occluded, flow_to=flow_to, **rendered)

    def flow(self, t: float, to: float, *, threads: int = 1) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Returns the motion of the pixels from instant ``t`` to instant ``to``, in seconds; ``to`` can be earlier.

        Returns float32 (2, H, W), the motion in pixels to the right and down, and bool (H, W), true if the point of the pixel
        is hidden at ``to``.
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
        """Renders ``frames`` frames of light from ``t`` on, at ``fps`` Hz: float32 (frames, H, W), 1.0 at white.

        ``Simulator.run`` and ``simulate_batch`` accept this light. The function calls ``progress(done, total)`` with numbers
        of frames.
        """
        return self._native.clip(t, frames, fps, samples=samples, threads=threads, progress=progress)

    @staticmethod
    def semantic_names() -> dict[int, str]:
        """Returns the name of each value of ``semantic`` images."""
        return _native.Scene.semantic_names()

    def __repr__(self) -> str:
        return repr(self._native)
