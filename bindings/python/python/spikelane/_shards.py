"""Reads the sequences of data sets, from folders and from packed shards, without torch."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._clips import _hash
from ._errors import usage_error
from ._native import unpack

SPLITS = ("train", "validation", "test")

# A part is read by one worker. It consists of the path of a data set or tar, and the indices of sequences in it.
Part = tuple[Path, list[int]]


class ShardReader:
    """Reads the sequences of data sets, plans and shards.

    ``spikelane.torch.SpikeShards`` describes the arguments.
    """

    def __init__(
        self,
        source: str | Path | Sequence[str | Path],
        split: str | None,
        *,
        clean: bool,
        files: Sequence[str],
        shuffle: bool,
        seed: int,
    ) -> None:
        if split is not None and split not in SPLITS:
            raise usage_error(
                "split", repr(split), "'train', 'validation', 'test' or None", "pass None for all sequences"
            )
        sources = _list_sources(Path(source)) if isinstance(source, (str, Path)) else [Path(path) for path in source]
        self.split = split
        self.parts = [part for path in sources for part in _find_parts(path, split)]
        self.clean = clean
        self.files = tuple(files)
        self.shuffle = shuffle
        self.seed = seed

    def select_parts(self, epoch: int, reader_count: int, reader_index: int) -> list[Part]:
        """Returns the parts of reader ``reader_index`` of ``reader_count``, in the order of the epoch."""
        order = list(range(len(self.parts)))
        if self.shuffle:
            order.sort(key=lambda index: _hash(self.seed, 0x5AD5, epoch, index))
        return [self.parts[index] for index in order[reader_index::reader_count]]

    def read_items(self, parts: Sequence[Part]) -> Iterator[dict[str, Any]]:
        """Yields every sequence of the split in the order of the parts."""
        for path, parts_of_path in groupby(parts, key=lambda part: part[0]):
            dataset = _native.DatasetReader(path)
            sequences = dataset.sequences()
            for _, indices in parts_of_path:
                for index in indices:
                    name, split, _ = sequences[index]
                    yield self._item(name, split, dataset.open(index))

    def _item(self, name: str, split: str, sequence: _native.SequenceFiles) -> dict[str, Any]:
        record = json.loads(sequence.read("record.json"))
        item: dict[str, Any] = {"id": name, "split": split, "record": record, "spikes": _read_spikes(sequence, False)}
        if self.clean:
            item["clean"] = _read_spikes(sequence, True)
        names = {"record.json", *(file["path"] for file in record["files"])}
        for file in self.files:
            if file not in names:
                remedy = f"choose from {', '.join(sorted(names))}"
                raise usage_error("files", repr(file), f"a file of {name}", remedy)
            item[file] = _decode_file(file, sequence.read(file))
        return item


def _list_sources(path: Path) -> list[Path]:
    """Returns the tars in a folder to which only tars were copied, and otherwise ``path``."""
    if (path / "manifest.jsonl").exists() or (path / "plan.json").exists():
        return [path]
    return sorted(path.glob("shards/*.tar")) or sorted(path.glob("*.tar")) or [path]


def _find_parts(path: Path, split: str | None) -> list[Part]:
    """Returns a part for each shard, or for each sequence of a data set without shards."""
    parts: dict[str, list[tuple[str, int]]] = {}
    for index, (name, own_split, shard) in enumerate(_native.DatasetReader(path).sequences()):
        key = (name if path.is_dir() else "") if shard is None else shard
        part = parts.setdefault(key, [])
        if split is None or split == own_split:
            part.append((name, index))
    return [(path, [index for _, index in sorted(part)]) for _, part in sorted(parts.items())]


def _read_spikes(sequence: _native.SequenceFiles, clean: bool) -> NDArray[np.uint8]:
    """Returns uint8 (T, H, W) of 0 and 1, with the top row first."""
    bits: NDArray[np.uint8] = unpack(*sequence.read_packed(clean))
    return bits


def _decode_file(name: str, body: bytes) -> Any:
    if name.endswith(".npy"):
        return np.load(io.BytesIO(body))
    if name.endswith(".json"):
        return json.loads(body)
    return body
