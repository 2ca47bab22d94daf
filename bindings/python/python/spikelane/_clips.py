"""Clips of light as training items: each a stream of its own, fixed by (seed, epoch, index)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._errors import make_error

__all__ = ["ClipSampler"]

_MASK = (1 << 64) - 1


def _mix64(x: int) -> int:
    """A bijection of 64 bits (splitmix64's finalizer)."""
    x = (x + 0x9E3779B97F4A7C15) & _MASK
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK
    return x ^ (x >> 31)


def _hash(*words: int) -> int:
    """64 bits that follow from the words and their order."""
    state = 0
    for word in words:
        state = _mix64(state ^ _mix64(word & _MASK))
    return state


def _usage_error(subject: str, found: object, expected: str, remedy: str) -> BaseException:
    text = f"{subject}: found {found}, expected {expected}; {remedy}"
    return make_error(text, ("usage", subject, str(found), expected, remedy), None, False)


class ClipSampler:
    """A dataset of streams: item ``index`` is a new recording of clip ``index`` in every epoch.

    An item is a dict with these keys:

    - ``spikes``: uint8 (T, H, W) of 0 and 1, or packed (T, ceil(H * W / 8)) with ``bits=False``;
    - ``light``: float32 (K, H, W), the linear light at the readouts ``target_readouts``, 1.0 at full scale;
    - ``clean``: like ``spikes``, from the noise-free twin, with ``clean=True``;
    - ``thresholds_at_full_scale``: nominal thresholds that full-scale light adds per readout;
    - ``index``, ``camera_seed``, ``sequence``, and ``row`` and ``col`` of the crop.

    ``clips`` is a sequence of (N, H, W) arrays of uint8, uint16 or float32: an array (B, N, H, W), a list, or any object
    with ``len`` and indexing. Each frame lasts ``readouts_per_frame`` readouts, and ``interpolation`` is that of
    ``Simulator.run``. ``crop=(h, w)`` cuts a random rectangle out of each clip.

    ``camera`` is a Camera or a CameraDistribution. A Camera has the size of the clips; a crop uses its window. With a
    CameraDistribution, every item of every epoch draws a camera of the size of the crop. ``camera_count=K`` limits the number
    of different cameras to K, and they have the size of the clips. With a Camera, it makes K individuals of it. The plans of
    the last 64 cameras are cached.

    ``readouts`` is T (all by default), ``target_readouts`` the readouts of ``light`` (the middle one by default).

    All random choices follow from (``seed``, ``epoch``, ``index``), not from the number or start method of workers. It needs
    no torch; ``spikelane.torch.SpikeClips`` is the same for its loaders.
    """

    def __init__(
        self,
        clips: Sequence[NDArray[Any]] | NDArray[Any],
        camera: _native.Camera | _native.CameraDistribution,
        readouts_per_frame: int = 1,
        *,
        crop: tuple[int, int] | None = None,
        seed: int = 0,
        interpolation: str = "hold",
        readouts: int | None = None,
        target_readouts: Sequence[int] | None = None,
        clean: bool = False,
        bits: bool = True,
        camera_count: int | None = None,
        max_light: float = 1.0,
    ) -> None:
        if not isinstance(camera, _native.Camera | _native.CameraDistribution):
            raise _usage_error("camera", type(camera).__name__, "a Camera or a CameraDistribution", "make one of them")
        if camera_count is not None and camera_count < 1:
            raise _usage_error("camera_count", camera_count, "at least 1", "leave it out for one per item")
        if len(clips) == 0:
            raise _usage_error("clips", "no clip", "at least one", "give arrays of shape (N, H, W)")
        self.clips = clips
        self.camera = camera
        self.readouts_per_frame = readouts_per_frame
        self.crop = None if crop is None else (crop[0], crop[1])
        self.seed = seed
        self.interpolation = interpolation
        self.readouts = readouts
        self.target_readouts = None if target_readouts is None else tuple(int(t) for t in target_readouts)
        self.clean = clean
        self.bits = bits
        self.camera_count = camera_count
        self.max_light = max_light

    def __len__(self) -> int:
        return len(self.clips)

    def _item_camera(self, epoch: int, index: int, shape: tuple[int, int]) -> tuple[_native.Camera, int]:
        """The item's camera, as large as its clip or as its crop, and the seed of its fixed pattern."""
        drawn = _hash(self.seed, 0xCA3E2A, epoch, index)
        if self.camera_count is not None:
            drawn = _hash(self.seed, 0xCA3E2B, drawn % self.camera_count)
        if isinstance(self.camera, _native.CameraDistribution):
            camera = self.camera.draw(drawn)
            # No other item sees a camera of its own, so it needs no pixels beyond the crop.
            return camera.with_shape(*(self.crop if self.crop and self.camera_count is None else shape)), drawn
        # One camera keeps its fixed pattern, unless several of its kind are asked for.
        camera_seed = drawn if self.camera_count is not None else _hash(self.seed, 0xCA3E2C)
        if self.camera.shape != shape:
            raise _usage_error(
                "camera",
                f"{self.camera.shape[0]} x {self.camera.shape[1]} pixels",
                f"{shape[0]} x {shape[1]}, the size of the clips",
                "use camera.with_shape or camera.window",
            )
        return self.camera, camera_seed

    def item(self, index: int, epoch: int = 0) -> dict[str, Any]:
        """The item ``index`` (negative ones count from the end) in ``epoch``. Raises IndexError beyond the end."""
        length = len(self)
        if not -length <= index < length:
            raise IndexError(f"found index {index}, expected -{length} to {length - 1}")
        index %= length
        clip = np.asarray(self.clips[index])
        if clip.ndim != 3:
            raise _usage_error(
                f"clips[{index}]", f"{clip.ndim} axes", "an array (N, H, W)", "give clip[None] for a picture"
            )
        camera, camera_seed = self._item_camera(epoch, index, (clip.shape[1], clip.shape[2]))
        row, col = 0, 0
        if self.crop is not None:
            height, width = self.crop
            rooms = (clip.shape[1] - height, clip.shape[2] - width)
            if min(rooms) < 0 or min(height, width) < 1:
                found, whole = f"{height} x {width}", f"{clip.shape[1]} x {clip.shape[2]}"
                raise _usage_error("crop", found, f"a part of the clip's {whole} pixels", "choose a smaller crop")
            row = _hash(self.seed, 0xC209, epoch, index) % (rooms[0] + 1)
            col = _hash(self.seed, 0xC20A, epoch, index) % (rooms[1] + 1)
            clip = clip[:, row : row + height, col : col + width]
        sequence = _hash(self.seed, 0x5E9, epoch, index)
        spikes = self._simulate(camera, clip, camera_seed, sequence, row, col)
        readouts = spikes.shape[0]
        targets = (readouts // 2,) if self.target_readouts is None else self.target_readouts
        item: dict[str, Any] = {
            "spikes": spikes,
            "light": _native.light_at(clip, targets, self.readouts_per_frame, interpolation=self.interpolation),
            "thresholds_at_full_scale": camera.thresholds_at_full_scale,
            "index": index,
            "camera_seed": camera_seed,
            "sequence": sequence,
            "row": row,
            "col": col,
        }
        if self.clean:
            item["clean"] = self._simulate(camera.clean_twin(), clip, camera_seed, sequence, row, col)
        return item

    def _simulate(
        self,
        camera: _native.Camera,
        clip: NDArray[Any],
        camera_seed: int,
        sequence: int,
        row: int,
        col: int,
    ) -> NDArray[np.uint8]:
        batch = _native.simulate_batch(
            camera,
            [clip],
            self.readouts_per_frame,
            sequences=[sequence],
            seed=self.seed,
            camera_seed=camera_seed,
            windows=[(row, col)] if self.crop is not None and camera.shape != self.crop else None,
            interpolation=self.interpolation,
            readouts=self.readouts,
            bits=self.bits,
            max_light=self.max_light,
        )
        one: NDArray[np.uint8] = batch[0]
        return one

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self.item(index)
