"""Training items from clips of light: each item is a new stream, determined by (seed, epoch, index)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._arrays import to_numpy
from ._errors import SpikelaneError, make_error, type_error, usage_error

__all__ = ["ClipSampler"]

_MASK = (1 << 64) - 1


def _mix64(x: int) -> int:
    """Maps 64 bits to 64 bits one to one (the finalizer of splitmix64)."""
    x = (x + 0x9E3779B97F4A7C15) & _MASK
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK
    return x ^ (x >> 31)


def _hash(*words: int) -> int:
    """Returns a 64-bit hash of the words and their order."""
    state = 0
    for word in words:
        state = _mix64(state ^ _mix64(word & _MASK))
    return state


def crop_size(crop: Any) -> tuple[int, int] | None:
    """The argument ``crop`` as (height, width)."""
    if crop is None:
        return None
    expected = "a tuple (height, width)"
    if isinstance(crop, int):
        raise type_error("crop", f"{crop} (an int)", expected, f"pass crop=({crop}, {crop})")
    try:
        height, width = crop
    except (TypeError, ValueError):
        raise type_error("crop", repr(crop)[:60], expected, "pass crop=(48, 48) or so") from None
    for i, (name, side) in enumerate((("height", height), ("width", width))):
        try:
            _native.check_argument(name, side)
        except SpikelaneError as error:
            raise _rename(error, name, f"crop[{i}]") from None
    return int(height), int(width)


def _readout_tuple(readouts: Any) -> tuple[int, ...] | None:
    """The argument ``target_readouts``."""
    if readouts is None:
        return None
    if isinstance(readouts, int):
        raise type_error(
            "target_readouts", f"{readouts} (an int)", "a sequence of readouts", f"pass target_readouts=[{readouts}]"
        )
    for readout in readouts:
        _native.check_argument("at", readout)
    return tuple(int(readout) for readout in readouts)


def _rename(error: SpikelaneError, old: str, new: str) -> BaseException:
    """The same error about an argument that has another name for the caller."""
    fields = (error.kind, error.subject.replace(old, new, 1), error.found, error.expected, error.remedy)
    return make_error(str(error).replace(old, new), fields, None, False)


class ClipSampler:
    """A data set of streams: item ``index`` is a new recording of clip ``index`` in every epoch.

    An item is a dict with these keys:

    - ``spikes``: uint8 (T, H, W) of 0 and 1, or packed (T, ceil(H * W / 8)) with ``dense=False``;
    - ``light``: float32 (K, H, W), the linear light at the readouts ``target_readouts``, 1.0 at full scale;
    - ``clean``: like ``spikes``, but from the noise-free twin of the camera; only with ``clean=True``;
    - ``thresholds_at_full_scale``: charge that full-scale light adds per readout, in nominal thresholds;
    - ``index``, ``camera_seed``, ``sequence``, and ``row`` and ``col`` of the crop.

    ``clips`` is a sequence of (N, H, W) arrays of uint8, uint16 or float32: an array (B, N, H, W), a list, or any object
    with ``len`` and indexing. Each frame lasts ``readouts_per_frame`` readouts. ``interpolation`` and
    ``full_scale`` have the meaning that they have in ``Simulator.run``. ``crop=(h, w)`` selects a random rectangle of
    each clip.

    ``camera`` is a Camera or a CameraDistribution. A Camera must have the size of the clips; a crop uses a window of the
    camera. A CameraDistribution draws a camera with the size of the crop for every item of every epoch.
    ``camera_count=K`` limits the number of different cameras to K. These cameras have the size of the clips. If ``camera``
    is a Camera, the K cameras differ in their fixed pattern. The sampler caches the plans of the last 64 cameras.

    ``readouts`` is T; the default is all readouts. ``target_readouts`` are the readouts of ``light``; the default is the
    middle readout.

    All random choices follow from (``seed``, ``epoch``, ``index``). The number and the start method of workers have no
    effect. This class does not need torch. ``spikelane.torch.SpikeClips`` returns the same items to loaders of torch.
    """

    def __init__(
        self,
        clips: Sequence[NDArray[Any]] | NDArray[Any],
        camera: _native.Camera | _native.CameraDistribution,
        readouts_per_frame: int = 1,
        *,
        crop: tuple[int, int] | None = None,
        seed: int = 0,
        interpolation: str = "linear",
        full_scale: float | None = None,
        readouts: int | None = None,
        target_readouts: Sequence[int] | None = None,
        clean: bool = False,
        dense: bool = True,
        camera_count: int | None = None,
        max_light: float = 1.0,
    ) -> None:
        if not isinstance(camera, _native.CameraDistribution):
            _native.check_argument("camera", camera)
        given = {
            "readouts_per_frame": readouts_per_frame,
            "seed": seed,
            "interpolation": interpolation,
            "full_scale": full_scale,
            "readouts": readouts,
            "clean": clean,
            "dense": dense,
            "camera_count": camera_count,
            "max_light": max_light,
        }
        for name, value in given.items():
            if value is not None or name not in ("full_scale", "readouts", "camera_count"):
                _native.check_argument(name, value)
        if not (hasattr(clips, "__len__") and hasattr(clips, "__getitem__")) or isinstance(clips, str | dict):
            kind = f"a {type(clips).__name__}"
            raise type_error(
                "clips", kind, "an array (B, N, H, W), or a sequence of (N, H, W)", "pass a list of arrays"
            )
        if len(clips) == 0:
            raise usage_error("clips", "no clip", "at least one", "pass arrays of shape (N, H, W)")
        self.clips = clips
        self.camera = camera
        self.readouts_per_frame = readouts_per_frame
        self.crop = crop_size(crop)
        self.seed = seed
        self.interpolation = interpolation
        self.full_scale = full_scale
        self.readouts = readouts
        self.target_readouts = _readout_tuple(target_readouts)
        self.clean = clean
        self.dense = dense
        self.camera_count = camera_count
        self.max_light = max_light

    def __len__(self) -> int:
        return len(self.clips)

    def _item_camera(self, epoch: int, index: int, shape: tuple[int, int]) -> tuple[_native.Camera, int]:
        """Returns the camera of an item, in the size of the clip or crop, and the seed of the fixed pattern."""
        drawn = _hash(self.seed, 0xCA3E2A, epoch, index)
        if self.camera_count is not None:
            drawn = _hash(self.seed, 0xCA3E2B, drawn % self.camera_count)
        if isinstance(self.camera, _native.CameraDistribution):
            camera = self.camera.draw(drawn)
            # Without `camera_count`, only this item uses the camera, so the camera needs only the pixels of the crop.
            return camera.with_shape(*(self.crop if self.crop and self.camera_count is None else shape)), drawn
        # All items share one fixed pattern unless `camera_count` requests several patterns.
        camera_seed = drawn if self.camera_count is not None else _hash(self.seed, 0xCA3E2C)
        if self.camera.shape != shape:
            raise usage_error(
                "camera",
                f"{self.camera.shape[0]} x {self.camera.shape[1]} pixels",
                f"{shape[0]} x {shape[1]}, the size of the clips",
                "use camera.with_shape or camera.window",
            )
        return self.camera, camera_seed

    def item(self, index: int, epoch: int = 0) -> dict[str, Any]:
        """Returns item ``index`` of ``epoch``. A negative index counts from the end.

        Raises IndexError if the index is out of range.
        """
        length = len(self)
        if not -length <= index < length:
            raise IndexError(f"found index {index}, expected -{length} to {length - 1}")
        index %= length
        clip = to_numpy(self.clips[index], f"clips[{index}]", "an array of uint8, uint16 or float32")
        if clip.ndim != 3:
            remedy = "pass clip[None] for one image" if clip.ndim == 2 else "pass gray frames: rgb @ weights for colors"
            raise usage_error(f"clips[{index}]", f"shape {clip.shape}", "an array (N, H, W)", remedy)
        camera, camera_seed = self._item_camera(epoch, index, (clip.shape[1], clip.shape[2]))
        row, col = 0, 0
        if self.crop is not None:
            height, width = self.crop
            margins = (clip.shape[1] - height, clip.shape[2] - width)
            if min(margins) < 0 or min(height, width) < 1:
                found, whole = f"{height} x {width}", f"{clip.shape[1]} x {clip.shape[2]}"
                raise usage_error("crop", found, f"a part of the clip's {whole} pixels", "choose a smaller crop")
            row = _hash(self.seed, 0xC209, epoch, index) % (margins[0] + 1)
            col = _hash(self.seed, 0xC20A, epoch, index) % (margins[1] + 1)
            clip = clip[:, row : row + height, col : col + width]
        sequence = _hash(self.seed, 0x5E9, epoch, index)
        lasts = clip.shape[0] * self.readouts_per_frame
        readouts = lasts if self.readouts is None else self.readouts
        if readouts > lasts:
            expected = f"at most {lasts}, which clips[{index}] lasts"
            raise usage_error("readouts", readouts, expected, "pass fewer, or a larger readouts_per_frame")
        targets = (readouts // 2,) if self.target_readouts is None else self.target_readouts
        place = f"[:, {row}:{row + clip.shape[1]}, {col}:{col + clip.shape[2]}]" if self.crop else ""
        try:
            # It checks the shape, and the readouts of `light` before the simulation of the spikes.
            light = _native.light_at(
                clip, targets, self.readouts_per_frame, interpolation=self.interpolation, full_scale=self.full_scale
            )
            spikes = self._simulate(camera, clip, camera_seed, sequence, row, col)
        except SpikelaneError as error:
            if error.subject == "readouts":
                raise _rename(error, "readouts", "target_readouts") from None
            name = "frames" if error.subject.startswith("frames") else "clips[0]"
            raise _rename(error, name, f"clips[{index}]{place}") from None
        item: dict[str, Any] = {
            "spikes": spikes,
            "light": light,
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
            full_scale=self.full_scale,
            readouts=self.readouts,
            dense=self.dense,
            max_light=self.max_light,
        )
        one: NDArray[np.uint8] = batch[0]
        return one

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self.item(index)

    def __repr__(self) -> str:
        crop = f", crop={self.crop}" if self.crop else ""
        return f"<spikelane.ClipSampler of {len(self)} clip{'s' * (len(self) != 1)}{crop}, seed={self.seed}, {self.camera!r}>"
