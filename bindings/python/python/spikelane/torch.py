"""Data sets for loaders of torch: a new recording of every clip in every epoch.

`SpikeClips` is a map-style data set, and `SpikeClipStream` is an iterable data set. (seed, epoch, index) determines a
stream. The number of workers and their start method (fork or spawn) have no effect. `SpikeShards` reads the
data sets that `spikelane dataset` generated. Only this module imports torch.
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
    """Converts arrays to tensors in the same memory, and seeds to text, because they can exceed the integers of torch."""
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
    """Returns the integer 0 in memory that forked and spawned workers share."""
    zero: Any = torch.zeros(1, dtype=torch.int64)
    return zero.share_memory_()


class SpikeClips(Dataset[dict[str, Any]]):
    """A map-style data set of streams. Arguments and items are those of ``spikelane.ClipSampler``, with tensors for arrays.

    After ``set_epoch``, every item is a new stream. The epoch is in shared memory, so persistent workers read each change.
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
        """Sets the epoch, which is initially 0. Call this before each pass, as for the DistributedSampler of torch."""
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
    """Returns the index of this worker and the number of workers."""
    worker: Any = get_worker_info()  # type: ignore[no-untyped-call, unused-ignore]
    return (worker.id, worker.num_workers) if worker else (0, 1)


class _EpochDataset(IterableDataset[dict[str, Any]]):
    """A pass over the items of an epoch; process ``rank`` of ``ranks`` reads a part of the items."""

    def __init__(self, rank: int, ranks: int) -> None:
        check_argument("rank", rank)
        check_argument("ranks", ranks)
        if not rank < ranks:
            raise usage_error("rank", f"{rank} of {ranks}", f"0 to {ranks - 1}", "count ranks from 0")
        self.rank = rank
        self.ranks = ranks
        self._epoch = _shared_zero()

    def set_epoch(self, epoch: int) -> None:
        """Sets the epoch, which is initially 0."""
        check_argument("epoch", epoch)
        self._epoch[0] = epoch

    @property
    def epoch(self) -> int:
        """The epoch."""
        return int(self._epoch[0])


class SpikeClipStream(_EpochDataset):
    """An iterable data set of streams: one pass over all clips, in a random order that differs between epochs.

    Arguments and items are those of ``spikelane.ClipSampler``, with tensors for arrays. Each of R ranks (``rank`` of
    ``ranks``) simulates every R-th item, and each of W workers simulates every W-th item of its rank. The numbers of ranks
    and workers change the order of the items, but not the streams. ``shuffle=False`` keeps the order of the clips.
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
        """Returns the number of items in a pass of this rank."""
        return len(range(self.rank, len(self.sampler), self.ranks))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        epoch, order = self.epoch, list(range(len(self.sampler)))
        if self.shuffle:
            order.sort(key=lambda index: _hash(self.sampler.seed, 0x5807, epoch, index))
        worker_index, workers = _worker_index_and_count()
        for index in order[self.rank :: self.ranks][worker_index::workers]:
            yield _to_tensors(self.sampler.item(index, epoch))

    def __repr__(self) -> str:
        part = f"rank {self.rank} of {self.ranks}, epoch {self.epoch}"
        return f"<spikelane.torch.SpikeClipStream, {part}, {self.sampler!r}>"


class SpikeShards(_EpochDataset):
    """An iterable data set of generated sequences: one pass over the sequences of a split, shard by shard.

    ``source`` is the folder of a data set, plan or shard, the tar of a packed shard, a folder of tars, or a list of these.
    The items of packed and other data sets are equal. An item is a dict with these keys:

    - ``id`` and ``split``: str;
    - ``record``: a dict;
    - ``spikes``: uint8 (T, H, W) of 0 and 1, with the top row first;
    - ``clean``: like ``spikes``, but from the noise-free twin; only with ``clean=True``;
    - each path in ``files``: a tensor for ``"labels/000000.depth.npy"``, a dict for ``"stream.json"``, and bytes for other
      files such as ``"reference.png"``. Paths start at the folder of the sequence.

    Each of R ranks reads every R-th shard, and each of W workers reads every W-th shard of its rank. So the data set should
    have more shards than workers. In a data set without shards, each sequence counts as a shard. ``shuffle=True`` draws a new
    order of shards in every epoch. Within a shard, sequences are sorted by name.

    Raises SpikelaneError if no data set exists or a sequence lacks a file.
    """

    def __init__(
        self,
        source: str | Path | Sequence[str | Path],
        split: str | None = None,
        *,
        clean: bool = False,
        files: Sequence[str] = (),
        shuffle: bool = False,
        seed: int = 0,
        rank: int = 0,
        ranks: int = 1,
    ) -> None:
        super().__init__(rank, ranks)
        self.reader = ShardReader(source, split, clean=clean, files=files, shuffle=shuffle, seed=seed)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        worker_index, workers = _worker_index_and_count()
        parts = self.reader.select_parts(self.epoch, self.ranks * workers, self.rank * workers + worker_index)
        for item in self.reader.read_items(parts):
            yield _to_tensors(item)

    def __repr__(self) -> str:
        part = f"rank {self.rank} of {self.ranks}, epoch {self.epoch}"
        count = len(self.reader.parts)
        shards = "1 shard" if count == 1 else f"{count} shards"
        return f"<spikelane.torch.SpikeShards, {part}, {shards}, split {self.reader.split or 'all'}>"
