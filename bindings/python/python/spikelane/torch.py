"""Streams for torch's loaders: a fresh recording of every clip in every epoch.

`SpikeClips` is a map-style dataset, `SpikeClipStream` an iterable one. A stream is fixed by (seed, epoch, index): the
workers, their number, and whether they are forked or spawned change nothing. `SpikeShards` reads datasets that were made
before, from their packs. torch is imported here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from ._clips import ClipSampler, _hash
from ._errors import usage_error
from ._native import Camera, CameraDistribution, check_argument
from ._shards import ShardReader

__all__ = ["SpikeClipStream", "SpikeClips", "SpikeShards"]

Clips = Sequence[NDArray[Any]] | NDArray[Any]


def _to_tensors(item: dict[str, Any]) -> dict[str, Any]:
    """Arrays as tensors on the same memory; seeds, which may exceed torch's integers, as text."""
    made: dict[str, Any] = {}
    for key, value in item.items():
        if isinstance(value, np.ndarray):
            made[key] = torch.from_numpy(value)
        elif key in ("camera_seed", "sequence"):
            made[key] = str(value)
        else:
            made[key] = value
    return made


def _shared_zero() -> Any:
    """A number that forked and spawned workers see change."""
    zero: Any = torch.zeros(1, dtype=torch.int64)
    return zero.share_memory_()


class SpikeClips(Dataset[dict[str, Any]]):
    """A map-style dataset of streams; arguments and items are those of ``spikelane.ClipSampler``, arrays as tensors.

    ``set_epoch`` makes every stream anew. The epoch is shared memory, so persistent workers see it too.
    """

    def __init__(
        self,
        clips: Clips,
        camera: Camera | CameraDistribution,
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
        self.sampler = ClipSampler(
            clips,
            camera,
            readouts_per_frame,
            crop=crop,
            seed=seed,
            interpolation=interpolation,
            full_scale=full_scale,
            readouts=readouts,
            target_readouts=target_readouts,
            clean=clean,
            dense=dense,
            camera_count=camera_count,
            max_light=max_light,
        )
        self._epoch = _shared_zero()

    def set_epoch(self, epoch: int) -> None:
        """Chooses the epoch, 0 at first: call it before each pass, as with torch's DistributedSampler."""
        check_argument("epoch", epoch)
        self._epoch[0] = epoch

    @property
    def epoch(self) -> int:
        """The epoch."""
        return int(self._epoch[0])

    def __len__(self) -> int:
        return len(self.sampler)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return _to_tensors(self.sampler.item(int(index), self.epoch))

    def __repr__(self) -> str:
        return f"<spikelane.torch.SpikeClips, epoch {self.epoch}, {self.sampler!r}>"


def _worker_index_and_count() -> tuple[int, int]:
    """Number of this worker, and how many there are."""
    worker: Any = get_worker_info()  # type: ignore[no-untyped-call, unused-ignore]
    return (worker.id, worker.num_workers) if worker else (0, 1)


class _EpochDataset(IterableDataset[dict[str, Any]]):
    """Passes over items of which this rank takes a part: ``epoch`` and ``rank`` of ``ranks``."""

    def __init__(self, rank: int, ranks: int) -> None:
        check_argument("rank", rank)
        check_argument("ranks", ranks)
        if not rank < ranks:
            raise usage_error("rank", f"{rank} of {ranks}", f"0 to {ranks - 1}", "count ranks from 0")
        self.rank = rank
        self.ranks = ranks
        self._epoch = _shared_zero()

    def set_epoch(self, epoch: int) -> None:
        """Chooses the epoch, 0 at first."""
        check_argument("epoch", epoch)
        self._epoch[0] = epoch

    @property
    def epoch(self) -> int:
        """The epoch."""
        return int(self._epoch[0])


class SpikeClipStream(_EpochDataset):
    """An iterable dataset of streams: one pass over all clips, in an order drawn anew in every epoch.

    Arguments and items are those of ``spikelane.ClipSampler``, arrays as tensors. Of W workers (and R ranks, with
    ``rank`` and ``ranks``) each takes every W-th item: which worker makes a stream changes where it comes in the order of
    a loader, not the stream. ``shuffle=False`` keeps the clips' order.
    """

    def __init__(
        self,
        clips: Clips,
        camera: Camera | CameraDistribution,
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
        shuffle: bool = True,
        rank: int = 0,
        ranks: int = 1,
    ) -> None:
        super().__init__(rank, ranks)
        self.sampler = ClipSampler(
            clips,
            camera,
            readouts_per_frame,
            crop=crop,
            seed=seed,
            interpolation=interpolation,
            full_scale=full_scale,
            readouts=readouts,
            target_readouts=target_readouts,
            clean=clean,
            dense=dense,
            camera_count=camera_count,
            max_light=max_light,
        )
        self.shuffle = shuffle

    def __len__(self) -> int:
        """Items of a pass of this rank."""
        return len(range(self.rank, len(self.sampler), self.ranks))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        epoch, order = self.epoch, list(range(len(self.sampler)))
        if self.shuffle:
            order.sort(key=lambda index: _hash(self.sampler.seed, 0x5807, epoch, index))
        own, workers = _worker_index_and_count()
        for index in order[self.rank :: self.ranks][own::workers]:
            yield _to_tensors(self.sampler.item(index, epoch))

    def __repr__(self) -> str:
        part = f"rank {self.rank} of {self.ranks}, epoch {self.epoch}"
        return f"<spikelane.torch.SpikeClipStream, {part}, {self.sampler!r}>"


class SpikeShards(_EpochDataset):
    """Sequences of packed shards: one pass over those of a split, read tar by tar.

    ``source`` is the folder of a dataset that was planned with ``--pack``, or a list of tars. Items hold ``id``, ``split``,
    ``record`` (a dict), ``spikes`` (uint8 of 0 and 1, shape (T, H, W), the top row first), with ``clean`` also the noise-free
    twin, and whatever ``members`` names: ``"labels-000000-depth.npy"`` as a tensor, ``"stream.json"`` as a dict, other files,
    such as ``"png"``, as bytes. Of W workers (and R ranks) each takes every W-th (R-th) tar, so have more tars than
    workers. ``shuffle=True`` draws the order of tars anew in every epoch; within a tar sequences follow their names.

    Raises SpikelaneError where there is no tar, or a sequence lacks what is asked for.
    """

    def __init__(
        self,
        source: str | Path | Sequence[str | Path],
        split: str | None = None,
        *,
        clean: bool = False,
        members: Sequence[str] = (),
        shuffle: bool = False,
        seed: int = 0,
        rank: int = 0,
        ranks: int = 1,
    ) -> None:
        super().__init__(rank, ranks)
        self.reader = ShardReader(source, split, clean=clean, members=members, shuffle=shuffle, seed=seed)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        own, workers = _worker_index_and_count()
        tars = self.reader.part_tars(self.epoch, self.ranks * workers, self.rank * workers + own)
        for item in self.reader.read_items(tars):
            yield _to_tensors(item)

    def __repr__(self) -> str:
        part = f"rank {self.rank} of {self.ranks}, epoch {self.epoch}"
        return (
            f"<spikelane.torch.SpikeShards, {part}, {len(self.reader.tars)} tars, split {self.reader.split or 'all'}>"
        )
