"""A pass over packed shards has each sequence of a split once, with the bits that the program writes."""

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


@pytest.fixture(scope="module")
def packed(program: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generates seven scenes twice: in packed shards of two scenes (``set``) and unsharded (``plain``)."""
    folder = tmp_path_factory.mktemp("packed")
    lines = [
        ["plan", *SCENES, "-o", "set", "--sequences-per-shard", "2", "--pack"],
        ["run", "set", "--shards", "all"],
        ["merge", "set"],
        [*SCENES, "-o", "plain"],
    ]
    for line in lines:
        subprocess.run([*program, "dataset", *line], cwd=folder, check=True, capture_output=True)
    return folder


def ids(loader: object) -> list[str]:
    return [item["id"] for item in loader]  # type: ignore[attr-defined]


def test_a_sequence_contains_the_files_of_the_program(packed: Path) -> None:
    members = ["labels-000002-depth.npy", "stream.json", "png"]
    item = next(iter(SpikeShards(packed / "set", clean=True, members=members)))
    plain = packed / "plain" / "sequences" / item["id"]
    for key, file in [("spikes", "stream.dat"), ("clean", "stream.clean.dat")]:
        with sl.open_stream(plain / file) as stream:
            assert np.array_equal(item[key].numpy(), stream.read_dense())
    assert item["spikes"].shape == (3, 24, 32)
    assert np.array_equal(item["labels-000002-depth.npy"].numpy(), np.load(plain / "labels/000002.depth.npy"))
    assert item["png"] == (plain / "reference.png").read_bytes()
    assert item["stream.json"]["readouts"] == 3 and item["record"]["id"] == item["id"]


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


def test_the_order_of_tars_follows_seed_and_epoch(packed: Path) -> None:
    shards = SpikeShards(packed / "set", shuffle=True, seed=3)
    first = ids(shards)
    assert ids(shards) == first and sorted(first) == ids(SpikeShards(packed / "set"))
    orders = set()
    for epoch in range(6):
        shards.set_epoch(epoch)
        orders.add(tuple(ids(shards)))
    assert len(orders) > 1


def test_errors_name_missing_data(packed: Path) -> None:
    with pytest.raises(sl.SpikelaneError, match="no tar"):
        SpikeShards(packed / "plain")
    with pytest.raises(sl.SpikelaneError, match="'train'"):
        SpikeShards(packed / "set", "training")
    with pytest.raises(sl.SpikelaneError, match=r"no depth\.npy of scene-0000"):
        next(iter(SpikeShards(packed / "set", members=["depth.npy"])))
