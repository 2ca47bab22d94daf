"""Data sets and a loader for torch: a new recording of every clip in every epoch.

`SpikeClips` is a map-style data set, and `SpikeClipStream` is an iterable data set. (seed, epoch, index) determines a
stream. The number of workers and their start method (fork or spawn) have no effect. `SpikeLoader` simulates the batches of
a `SpikeClips` on native threads, one batch ahead. `SpikeShards` reads the data sets that `spikelane dataset` generated.
Only this module imports torch.
"""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from ._clips import ClipSampler, Recording, _hash
from ._errors import type_error, usage_error
from ._native import Camera, CameraDistribution, check_argument
from ._shards import ShardReader

__all__ = ["SpikeClipStream", "SpikeClips", "SpikeLoader", "SpikeShards", "unpack"]

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


def _check_positive(name: str, value: Any) -> None:
    if not isinstance(value, int) or isinstance(value, bool):
        raise type_error(name, f"{value!r} (a {type(value).__name__})", "an integer from 1", f"pass {name}=1")
    if value < 1:
        raise usage_error(name, value, "an integer from 1", f"pass {name}=1")


def _check_rank(rank: int, ranks: int) -> None:
    check_argument("rank", rank)
    check_argument("ranks", ranks)
    if not rank < ranks:
        raise usage_error("rank", f"{rank} of {ranks}", f"0 to {ranks - 1}", "count ranks from 0")


def _epoch_order(seed: int, epoch: int, count: int, shuffle: bool) -> list[int]:
    """Returns the order of the items in an epoch."""
    order = list(range(count))
    if shuffle:
        order.sort(key=lambda index: _hash(seed, 0x5807, epoch, index))
    return order


class _EpochDataset(IterableDataset[dict[str, Any]]):
    """A pass over the items of an epoch; process ``rank`` of ``ranks`` reads a part of the items."""

    def __init__(self, rank: int, ranks: int) -> None:
        _check_rank(rank, ranks)
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
        epoch = self.epoch
        order = _epoch_order(self.sampler.seed, epoch, len(self.sampler), self.shuffle)
        worker_index, workers = _worker_index_and_count()
        for index in order[self.rank :: self.ranks][worker_index::workers]:
            yield _to_tensors(self.sampler.item(index, epoch))

    def __repr__(self) -> str:
        part = f"rank {self.rank} of {self.ranks}, epoch {self.epoch}"
        return f"<spikelane.torch.SpikeClipStream, {part}, {self.sampler!r}>"


def unpack(packed: torch.Tensor, height: int, width: int) -> torch.Tensor:
    """Unpacks readouts (..., ceil(H * W / 8)) to uint8 (..., H, W) of 0 and 1, on the device of ``packed``.

    The result equals that of ``spikelane.unpack``, which is faster for arrays of numpy.
    """
    check_argument("height", height)
    check_argument("width", width)
    size = (height * width + 7) // 8
    if packed.dtype != torch.uint8 or packed.ndim == 0 or packed.shape[-1] != size:
        found = f"{str(packed.dtype).removeprefix('torch.')} of shape {tuple(packed.shape)}"
        raise usage_error("packed", found, f"uint8 of shape (..., {size})", "pass readouts with dense=False")
    bits = torch.arange(8, dtype=torch.uint8, device=packed.device)
    pixels = packed.unsqueeze(-1).bitwise_right_shift(bits).bitwise_and_(1).flatten(-2)
    return pixels[..., : height * width].reshape(*packed.shape[:-1], height, width)


def _event_after(stream: Any) -> Any:
    """Returns an event that follows the work of a CUDA stream so far."""
    event: Any = torch.cuda.Event()  # type: ignore[no-untyped-call, unused-ignore]
    event.record(stream)
    return event


@dataclass
class _PinnedBuffer:
    """Memory from which a device copies a batch. ``copied`` is the event after the last copy."""

    packed: torch.Tensor
    copied: Any = None


class SpikeLoader:
    """Iterates over the batches of an epoch of a `SpikeClips`. Native threads of this process simulate the next batches.

    A batch equals the batch that ``torch.utils.data.DataLoader(data, batch_size)`` makes of the same items: tensors with a
    leading axis B, and lists of ``camera_seed`` and ``sequence``. No worker process is started, and nothing is pickled. All
    clips must have equal shapes.

    - ``shuffle=True`` draws a new order of the items in every epoch (``data.set_epoch``);
    - ``drop_last=True`` leaves out the last batch if it is smaller;
    - ``threads`` is the number of threads that simulate (default: all processors of this process);
    - ``ahead`` is the number of batches that are simulated before they are requested;
    - ``device`` receives the tensors. With "cuda", packed spikes are simulated straight into pinned memory, copied while the
      device computes, and unpacked on the device;
    - each of R ranks (``rank`` of ``ranks``) simulates every R-th item.

    Raises SpikelaneError for wrong arguments. An error in a thread is raised by the iteration. The end of an iteration, also
    by ``break``, ends its threads.
    """

    def __init__(
        self,
        data: SpikeClips,
        batch_size: int = 1,
        *,
        shuffle: bool = False,
        drop_last: bool = False,
        threads: int | None = None,
        ahead: int = 1,
        device: str | torch.device | None = None,
        rank: int = 0,
        ranks: int = 1,
    ) -> None:
        if not isinstance(data, SpikeClips):
            raise usage_error("data", f"a {type(data).__name__}", "a SpikeClips", "pass SpikeClips(clips, camera)")
        available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        numbers = {"batch_size": batch_size, "ahead": ahead, "threads": available if threads is None else threads}
        for name, value in numbers.items():
            _check_positive(name, value)
        _check_rank(rank, ranks)
        self.data = data
        self.batch_size = batch_size
        self.shuffle = shuffle
        self.drop_last = drop_last
        self.threads = numbers["threads"]
        self.ahead = ahead
        self.device = torch.device("cpu" if device is None else device)
        self.rank = rank
        self.ranks = ranks

    def __len__(self) -> int:
        """Returns the number of batches in a pass of this rank."""
        items = len(range(self.rank, len(self.data), self.ranks))
        return items // self.batch_size if self.drop_last else -(-items // self.batch_size)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        epoch, sampler = self.data.epoch, self.data.sampler
        order = _epoch_order(sampler.seed, epoch, len(self.data), self.shuffle)[self.rank :: self.ranks]
        parts = [order[i * self.batch_size : (i + 1) * self.batch_size] for i in range(len(self))]
        ready: queue.Queue[dict[str, Any] | BaseException | None] = queue.Queue(self.ahead)
        stopped = threading.Event()
        thread = threading.Thread(
            target=self._simulate_parts, args=(parts, epoch, ready, stopped), name="SpikeLoader", daemon=True
        )
        thread.start()
        try:
            while (batch := ready.get()) is not None:
                if isinstance(batch, BaseException):
                    raise batch
                event = batch.pop("_unpacked", None)
                if event is not None:
                    stream = torch.cuda.current_stream(self.device)
                    stream.wait_event(event)
                    for value in batch.values():
                        if torch.is_tensor(value):
                            value.record_stream(stream)
                yield batch
        finally:
            stopped.set()
            while thread.is_alive():
                # The thread may wait for a place in the queue.
                while not ready.empty():
                    ready.get()
                thread.join(0.01)

    def _simulate_parts(
        self, parts: list[list[int]], epoch: int, ready: queue.Queue[Any], stopped: threading.Event
    ) -> None:
        """Puts the batches into ``ready``, and None at the end."""
        sampler = self.data.sampler
        is_cuda = self.device.type == "cuda"
        buffers: list[_PinnedBuffer] = []
        stream: Any = torch.cuda.Stream(self.device) if is_cuda else None  # type: ignore[no-untyped-call, unused-ignore]

        def prepare(part: list[int]) -> list[Recording]:
            return [sampler._recording(index, epoch) for index in part]

        try:
            # The interpreter prepares a batch while native threads simulate the batch before.
            with ThreadPoolExecutor(1) as executor:
                waiting: Future[list[Recording]] | None = executor.submit(prepare, parts[0]) if parts else None
                for i in range(len(parts)):
                    assert waiting is not None
                    recordings = waiting.result()
                    waiting = executor.submit(prepare, parts[i + 1]) if i + 1 < len(parts) else None
                    if stopped.is_set():
                        return
                    if stream is None:
                        batch = self._collate(recordings)
                        batch = {k: v.to(self.device) if torch.is_tensor(v) else v for k, v in batch.items()}
                    else:
                        batch = self._collate_on_device(recordings, buffers, i, stream)
                    ready.put(batch)
            ready.put(None)
        except BaseException as error:
            ready.put(error)

    def _collate(self, recordings: list[Recording]) -> dict[str, Any]:
        """Simulates a batch into memory of its own."""
        sampler = self.data.sampler
        batch = self._describe(recordings)
        batch["spikes"] = torch.from_numpy(sampler._simulate(recordings, threads=self.threads))
        if sampler.clean:
            batch["clean"] = torch.from_numpy(sampler._simulate(recordings, twin=True, threads=self.threads))
        return batch

    def _collate_on_device(
        self, recordings: list[Recording], buffers: list[_PinnedBuffer], number: int, stream: Any
    ) -> dict[str, Any]:
        """Simulates packed spikes into pinned memory, and copies and unpacks them on ``stream`` of the device."""
        sampler = self.data.sampler
        height, width = recordings[0].clip.shape[1:]
        readouts = sampler._readout_count(recordings[0].clip)
        shape = (len(recordings), readouts, (height * width + 7) // 8)
        batch = self._describe(recordings)
        with torch.cuda.stream(stream):
            batch = {
                k: v.pin_memory().to(self.device, non_blocking=True) if torch.is_tensor(v) else v
                for k, v in batch.items()
            }
            for k, twin in enumerate([False, True][: 1 + sampler.clean]):
                # Two buffers per output: the device may still copy one while the other receives the next batch.
                place = 2 * k + number % 2
                while len(buffers) <= place:
                    size = (self.batch_size, *shape[1:])
                    buffers.append(_PinnedBuffer(torch.empty(size, dtype=torch.uint8, pin_memory=True)))
                buffer = buffers[place]
                if buffer.copied is not None:
                    buffer.copied.synchronize()
                packed = buffer.packed[: shape[0]]
                sampler._simulate(recordings, twin=twin, dense=False, threads=self.threads, out=packed.numpy())
                moved = packed.to(self.device, non_blocking=True)
                buffer.copied = _event_after(stream)
                batch["clean" if twin else "spikes"] = unpack(moved, height, width) if sampler.dense else moved
            batch["_unpacked"] = _event_after(stream)
        return batch

    def _describe(self, recordings: list[Recording]) -> dict[str, Any]:
        """Returns everything in a batch but the spikes."""
        thresholds = [one.camera.thresholds_at_full_scale for one in recordings]
        return {
            "light": torch.from_numpy(np.stack([one.light for one in recordings])),
            "thresholds_at_full_scale": torch.tensor(thresholds, dtype=torch.float64),
            "index": torch.tensor([one.index for one in recordings]),
            "camera_seed": [str(one.camera_seed) for one in recordings],
            "sequence": [str(one.sequence) for one in recordings],
            "row": torch.tensor([one.row for one in recordings]),
            "col": torch.tensor([one.col for one in recordings]),
        }

    def __repr__(self) -> str:
        return (
            f"<spikelane.torch.SpikeLoader of {len(self)} batches of {self.batch_size}, {self.threads} threads,"
            f" device {self.device}, {self.data!r}>"
        )


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
