"""A pass over a data set has each sequence of a split once, with the bits that the program writes."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

import spikelane as sl

torch = pytest.importorskip("torch")

from torch.utils.data import DataLoader  # noqa: E402

from spikelane.torch import SpikeShards  # noqa: E402

SCENES = "--scene-preset tiny --sequences 7 --images-per-scene 3 --label-every 2 --width 32 --height 24".split()
SCENES += ["--validation-share", "0.2"]
FILES = ["labels/000002.depth.npy", "images/000001.png", "stream.json", "reference.png"]


@pytest.fixture(scope="module")
def packed(program: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generates seven scenes: in packed shards of two scenes (``set``), in shards (``cut``) and without (``plain``)."""
    folder = tmp_path_factory.mktemp("packed")
    lines = [
        ["plan", *SCENES, "-o", "set", "--sequences-per-shard", "2", "--pack"],
        ["run", "set", "--shards", "all"],
        ["merge", "set"],
        ["plan", *SCENES, "-o", "cut", "--sequences-per-shard", "2"],
        ["run", "cut", "--shards", "all"],
        [*SCENES, "-o", "plain"],
    ]
    for line in lines:
        subprocess.run([*program, "dataset", *line], cwd=folder, check=True, capture_output=True)
    return folder


def ids(loader: object) -> list[str]:
    return [item["id"] for item in loader]  # type: ignore[attr-defined]


def test_a_sequence_contains_the_files_of_the_program(packed: Path) -> None:
    item = next(iter(SpikeShards(packed / "set", clean=True, files=FILES)))
    plain = packed / "plain" / "sequences" / item["id"]
    for key, file in [("spikes", "stream.dat"), ("clean", "stream.clean.dat")]:
        with sl.open_stream(plain / file) as stream:
            assert np.array_equal(item[key].numpy(), stream.read_dense())
    assert item["spikes"].shape == (3, 24, 32)
    assert np.array_equal(item["labels/000002.depth.npy"].numpy(), np.load(plain / "labels/000002.depth.npy"))
    assert item["reference.png"] == (plain / "reference.png").read_bytes()
    assert item["stream.json"]["readouts"] == 3 and item["record"]["id"] == item["id"]


@pytest.mark.parametrize("source", ["plain", "cut", "set/shards/000001", "cut/shards/000001", "set/shards/000001.tar"])
def test_packed_and_unpacked_sequences_are_equal(packed: Path, source: str) -> None:
    expected = {item["id"]: item for item in SpikeShards(packed / "set", clean=True, files=FILES)}
    found = list(SpikeShards(packed / source, clean=True, files=FILES))
    assert [item["id"] for item in found] == (list(expected) if source in ("plain", "cut") else list(expected)[2:4])
    for item in found:
        other = expected[item["id"]]
        assert item.keys() == other.keys()
        for key, value in item.items():
            assert torch.equal(value, other[key]) if torch.is_tensor(value) else value == other[key], key


@pytest.mark.parametrize("folder", ["tars", "tars/shards"])
def test_a_folder_of_copied_tars_is_read(packed: Path, tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir(parents=True)
    for path in (packed / "set/shards").glob("*.tar"):
        (tmp_path / folder / path.name).write_bytes(path.read_bytes())
    assert ids(SpikeShards(tmp_path / "tars", "test")) == ids(SpikeShards(packed / "plain", "test"))


def test_sequences_of_unequal_length_are_read(program: list[str], tmp_path: Path) -> None:
    (tmp_path / "clips").mkdir()
    for name, (width, height, frames) in {"a": (32, 24, 2), "b": (48, 40, 5), "c": (33, 25, 1)}.items():
        head = f"YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 Cmono\n".encode()
        body = b"".join(b"FRAME\n" + bytes([40 * k + 30]) * (width * height) for k in range(frames))
        (tmp_path / "clips" / f"{name}.y4m").write_bytes(head + body)
    flags = (
        "--from clips --width 32 --height 24 --readouts-per-frame 4 --images-every 2 --sequences-per-shard 2".split()
    )
    for line in (["plan", *flags, "--pack", "-o", "set"], ["run", "set", "--shards", "all"]):
        subprocess.run([*program, "dataset", *line], cwd=tmp_path, check=True, capture_output=True)
    assert [item["spikes"].shape for item in SpikeShards(tmp_path / "set")] == [(8, 24, 32), (20, 24, 32), (4, 24, 32)]


def test_workers_and_ranks_share_the_sequences_of_a_split(packed: Path) -> None:
    plain = {split: sorted(p.stem for p in (packed / "plain" / split / "gt").glob("*.png")) for split in sl_splits()}
    assert sum(map(len, plain.values())) == 7 and plain["test"] and plain["validation"]
    for split, names in plain.items():
        assert ids(SpikeShards(packed / "set", split)) == names
        shared = [ids(SpikeShards(packed / "set", split, rank=rank, ranks=3)) for rank in range(3)]
        assert sorted(name for share in shared for name in share) == names
        loader = DataLoader(SpikeShards(packed / "set", split), batch_size=None, num_workers=2)
        assert sorted(ids(loader)) == names


def sl_splits() -> tuple[str, ...]:
    return ("train", "validation", "test")


def test_the_order_of_shards_follows_seed_and_epoch(packed: Path) -> None:
    shards = SpikeShards(packed / "set", shuffle=True, seed=3)
    first = ids(shards)
    assert ids(shards) == first and sorted(first) == ids(SpikeShards(packed / "set"))
    orders = set()
    for epoch in range(6):
        shards.set_epoch(epoch)
        orders.add(tuple(ids(shards)))
    assert len(orders) > 1


def test_errors_name_missing_data(packed: Path) -> None:
    with pytest.raises(sl.SpikelaneError, match=r"manifest\.jsonl"):
        SpikeShards(packed / "plain" / "train")
    with pytest.raises(sl.SpikelaneError, match="'train'"):
        SpikeShards(packed / "set", "training")
    for source in ("set", "plain"):
        with pytest.raises(sl.SpikelaneError, match=r"a file of scene-0000; choose from gt\.png, images/000000\.png"):
            next(iter(SpikeShards(packed / source, files=["depth.npy"])))
