"""Reads the sequences of packed shards tar by tar, without torch."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._clips import _hash
from ._errors import usage_error
from ._native import unpack

SPLITS = ("train", "validation", "test")


class ShardReader:
    """Reads the tars of a data set that was planned with ``--pack``.

    ``spikelane.torch.SpikeShards`` describes the arguments.
    """

    def __init__(
        self,
        source: str | Path | Sequence[str | Path],
        split: str | None,
        *,
        clean: bool,
        members: Sequence[str],
        shuffle: bool,
        seed: int,
    ) -> None:
        if split is not None and split not in SPLITS:
            raise usage_error("split", repr(split), "'train', 'validation', 'test' or None", "pass None for all sequences")
        self.tars = _find_tars(source)
        self.split = split
        self.clean = clean
        self.members = tuple(members)
        self.shuffle = shuffle
        self.seed = seed

    def part_tars(self, epoch: int, part_count: int, part_index: int) -> list[Path]:
        """Returns the tars of part ``part_index`` of ``part_count``, in the order of the epoch."""
        order = list(range(len(self.tars)))
        if self.shuffle:
            order.sort(key=lambda index: _hash(self.seed, 0x5AD5, epoch, index))
        return [self.tars[index] for index in order[part_index::part_count]]

    def read_items(self, tars: Sequence[Path]) -> Iterator[dict[str, Any]]:
        """Yields every sequence of the split in the order of the tars."""
        for path in tars:
            for key, files in _read_sequences(path):
                found = files.get("split.txt")
                if self.split is None or (found is not None and found.decode() == self.split):
                    yield self._item(path, key, files)

    def _item(self, path: Path, key: str, files: dict[str, bytes]) -> dict[str, Any]:
        try:
            about = json.loads(files["stream.json"])
            item: dict[str, Any] = {
                "id": key,
                "split": files["split.txt"].decode(),
                "record": json.loads(files["json"]),
                "spikes": _decode_spikes(files["spk.dat"], about),
            }
            if self.clean:
                item["clean"] = _decode_spikes(files["clean.dat"], about)
            item.update({name: _decode_member(name, files[name]) for name in self.members})
        except KeyError as missing:
            raise usage_error(
                str(path),
                f"no {missing.args[0]} of {key}",
                "a sequence that 'spikelane dataset run' packed",
                f"choose from {', '.join(sorted(files))}",
            ) from missing
        return item


def _find_tars(source: str | Path | Sequence[str | Path]) -> list[Path]:
    if isinstance(source, (str, Path)):
        folder = Path(source)
        found = sorted(folder.glob("shards/*.tar")) or sorted(folder.glob("*.tar"))
        if not found:
            raise usage_error(
                str(source),
                "no tar",
                "the folder of a data set that was planned with --pack",
                "run the shards of this data set",
            )
        return found
    return [Path(path) for path in source]


def _read_sequences(path: Path) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yields sequences: consecutive members whose names are equal before the first dot."""
    key, files = "", dict[str, bytes]()
    with tarfile.open(path, "r|") as tar:
        for member in tar:
            body = tar.extractfile(member)
            if body is None:
                continue
            sequence, _, member_name = member.name.partition(".")
            if sequence != key and files:
                yield key, files
                files = {}
            key = sequence
            files[member_name] = body.read()
    if files:
        yield key, files


def _decode_spikes(stream: bytes, about: dict[str, Any]) -> NDArray[np.uint8]:
    """Returns uint8 (T, H, W) of 0 and 1, with the top row first."""
    width, height, readouts = about["width"], about["height"], about["readouts"]
    packed = np.frombuffer(stream, np.uint8).reshape(readouts, (width * height + 7) // 8)
    bits: NDArray[np.uint8] = unpack(packed, height, width)
    # The file stores the bottom row first.
    return np.ascontiguousarray(bits[:, ::-1])


def _decode_member(name: str, body: bytes) -> Any:
    if name.endswith(".npy"):
        return np.load(io.BytesIO(body))
    if name.endswith(".json"):
        return json.loads(body)
    return body
