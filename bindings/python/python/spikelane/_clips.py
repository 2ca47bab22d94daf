"""Training items from clips of light: each item is a new stream, determined by (seed, epoch, index)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class Recording:
    """All that determines the stream of an item, and the light at its target readouts."""

    index: int
    # The clip in messages: `clips[3][:, 0:48, 5:53]`.
    name: str
    clip: NDArray[Any]
    light: NDArray[np.float32]
    camera: _native.Camera
    camera_seed: int
    sequence: int
    row: int
    col: int

    @property
    def window(self) -> tuple[int, int]:
        """Row and column of the crop in the camera. A camera of the size of the crop has only (0, 0)."""
        return (0, 0) if self.camera.shape == self.clip.shape[1:] else (self.row, self.col)


class ClipSampler:
    """A data set of streams: item ``index`` is a new recording of clip ``index`` in every epoch.

    An item is a dict with these keys:

    - ``spikes``: uint8 (T, H, W) of 0 and 1, or packed (T, ceil(H * W / 8)) with ``dense=False``;
    - ``light``: float32 (K, H, W), the linear light at the readouts ``target_readouts``, 1.0 at full scale; for color
      clips, (K, H, W, 3);
    - ``clean``: like ``spikes``, but from the noise-free twin of the camera; only with ``clean=True``;
    - ``thresholds_at_full_scale``: charge that full-scale light adds per readout, in nominal thresholds;
    - ``index``, ``camera_seed``, ``sequence``, and ``row`` and ``col`` of the crop.

    ``clips`` is a sequence of (N, H, W) arrays of uint8, uint16 or float32: an array (B, N, H, W), a list, or any object
    with ``len`` and indexing. For a camera with a mosaic, clips may be linear RGB light, (N, H, W, 3). Each frame lasts
    ``readouts_per_frame`` readouts. ``interpolation`` and ``full_scale`` have the meaning that they have in
    ``Simulator.run``. ``crop=(h, w)`` selects a random rectangle of each clip. For a camera with a mosaic, all crops start
    at the same phase of the pattern.

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
        _native.check_camera(camera)
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
        recording = self._recording(index, epoch)
        item: dict[str, Any] = {
            "spikes": self._simulate([recording])[0],
            "light": recording.light,
            "thresholds_at_full_scale": recording.camera.thresholds_at_full_scale,
            "index": recording.index,
            "camera_seed": recording.camera_seed,
            "sequence": recording.sequence,
            "row": recording.row,
            "col": recording.col,
        }
        if self.clean:
            item["clean"] = self._simulate([recording], twin=True)[0]
        return item

    def _recording(self, index: int, epoch: int) -> Recording:
        """Draws the camera, the crop and the noise of an item, and computes its light."""
        length = len(self)
        if not -length <= index < length:
            raise IndexError(f"found index {index}, expected -{length} to {length - 1}")
        index %= length
        clip = to_numpy(self.clips[index], f"clips[{index}]", "an array of uint8, uint16 or float32")
        has_colors = clip.ndim == 4 and clip.shape[3] == 3
        if clip.ndim != 3 and not has_colors:
            remedy = "pass clip[None] for one image" if clip.ndim == 2 else "pass gray frames: rgb @ weights for colors"
            raise usage_error(f"clips[{index}]", f"shape {clip.shape}", "an array (N, H, W)", remedy)
        camera, camera_seed = self._item_camera(epoch, index, (clip.shape[1], clip.shape[2]))
        if has_colors and camera.mosaic is None:
            found, expected = f"shape {clip.shape}: RGB images?", "an array (N, H, W) for a camera without a mosaic"
            raise usage_error(f"clips[{index}]", found, expected, "weight the colors, or use camera.with_mosaic")
        row, col, name = 0, 0, f"clips[{index}]"
        if self.crop is not None:
            height, width = self.crop
            margins = (clip.shape[1] - height, clip.shape[2] - width)
            if min(margins) < 0 or min(height, width) < 1:
                found, whole = f"{height} x {width}", f"{clip.shape[1]} x {clip.shape[2]}"
                raise usage_error("crop", found, f"a part of the clip's {whole} pixels", "choose a smaller crop")
            # A gray camera has the period (1, 1).
            rows, cols = camera.mosaic_period
            row = _hash(self.seed, 0xC209, epoch, index) % (margins[0] // rows + 1) * rows
            col = _hash(self.seed, 0xC20A, epoch, index) % (margins[1] // cols + 1) * cols
            clip = clip[:, row : row + height, col : col + width]
            name += f"[:, {row}:{row + height}, {col}:{col + width}]"
        sequence = _hash(self.seed, 0x5E9, epoch, index)
        lasts, readouts = len(clip) * self.readouts_per_frame, self._readout_count(clip)
        if readouts > lasts:
            expected = f"at most {lasts}, which clips[{index}] lasts"
            raise usage_error("readouts", readouts, expected, "pass fewer, or a larger readouts_per_frame")
        targets = (readouts // 2,) if self.target_readouts is None else self.target_readouts
        try:
            # It checks the shape, and the readouts of `light` before the simulation of the spikes.
            def light_at(frames: NDArray[Any]) -> NDArray[np.float32]:
                return _native.light_at(
                    frames,
                    targets,
                    self.readouts_per_frame,
                    interpolation=self.interpolation,
                    full_scale=self.full_scale,
                )

            if has_colors:
                light = np.stack([light_at(clip[..., color]) for color in range(3)], axis=-1)
                # The crop starts at the phase of the first pixel of the camera.
                clip = camera.filter_light(clip, full_scale=self.full_scale)
            else:
                light = light_at(clip)
        except SpikelaneError as error:
            if error.subject == "readouts":
                raise _rename(error, "readouts", "target_readouts") from None
            raise (_rename(error, "frames", name) if error.subject.startswith("frames") else error) from None
        return Recording(index, name, clip, light, camera, camera_seed, sequence, row, col)

    def _readout_count(self, clip: NDArray[Any]) -> int:
        """Returns the number of readouts of an item."""
        return len(clip) * self.readouts_per_frame if self.readouts is None else self.readouts

    def _simulate(
        self,
        recordings: Sequence[Recording],
        *,
        twin: bool = False,
        dense: bool | None = None,
        threads: int = 1,
        out: NDArray[np.uint8] | None = None,
    ) -> NDArray[np.uint8]:
        """Simulates recordings of equal size: uint8 (B, T, H, W), or packed (B, T, ceil(H * W / 8)).

        With ``twin``, the cameras are the noise-free twins.
        """
        cameras = [one.camera.clean_twin() if twin else one.camera for one in recordings]
        # A camera of the size of the crop needs no window. The window of all its pixels gives the same bits.
        has_window = self.crop is not None and any(camera.shape != self.crop for camera in cameras)
        try:
            return _native.simulate_batch(
                cameras,
                [one.clip for one in recordings],
                self.readouts_per_frame,
                sequences=[one.sequence for one in recordings],
                seed=self.seed,
                camera_seed=[one.camera_seed for one in recordings],
                windows=[one.window for one in recordings] if has_window else None,
                interpolation=self.interpolation,
                # The light behind color filters is in full scales already.
                full_scale=None if recordings[0].light.ndim == 4 else self.full_scale,
                readouts=self.readouts,
                threads=threads,
                dense=self.dense if dense is None else dense,
                max_light=self.max_light,
                out=out,
            )
        except SpikelaneError as error:
            for i, one in enumerate(recordings):
                if error.subject.startswith(f"clips[{i}]"):
                    raise _rename(error, f"clips[{i}]", one.name) from None
            raise

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self.item(index)

    def __repr__(self) -> str:
        crop = f", crop={self.crop}" if self.crop else ""
        return f"<spikelane.ClipSampler of {len(self)} clip{'s' * (len(self) != 1)}{crop}, seed={self.seed}, {self.camera!r}>"
