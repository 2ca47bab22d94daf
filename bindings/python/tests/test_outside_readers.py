"""Programs of others read generated data sets: webdataset, Hugging Face's datasets and pycocotools.

    pip install webdataset datasets pillow pycocotools

A missing package skips its tests. The tests need no network.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# The packages read these variables when they are imported.
os.environ["HF_HUB_OFFLINE"] = os.environ["HF_DATASETS_OFFLINE"] = "1"

SCENES = "--scene-preset tiny --sequences 8 --images-per-scene 3 --label-every 2 --width 32 --height 24".split()
CLIPS = "--from clips --width 32 --height 24 --readouts-per-frame 4 --images-every 2".split()
KEYS = {"clean.dat", "files.tar", "gt.png", "json", "png", "spk.dat", "split.txt"}


@pytest.fixture(scope="module")
def sets(program: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generates scenes and clips of unequal length and size. Each set is generated plain and in packed shards."""
    folder = tmp_path_factory.mktemp("sets")
    (folder / "clips").mkdir()
    for number, (width, height, frames) in enumerate([(32, 24, 2), (48, 40, 5), (20, 30, 1), (33, 25, 3)] * 2):
        head = f"YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 Cmono\n".encode()
        body = b"".join(b"FRAME\n" + bytes([30 * k + 20]) * (width * height) for k in range(frames))
        (folder / "clips" / f"{number:02}.y4m").write_bytes(head + body)
    for flags, name in ((SCENES, "scenes"), (CLIPS, "inputs")):
        for line in (
            [*flags, "-o", f"{name}-plain"],
            ["plan", *flags, "-o", name, "--sequences-per-shard", "3", "--pack"],
            ["run", name, "--shards", "all"],
        ):
            subprocess.run([*program, "dataset", *line], cwd=folder, check=True, capture_output=True)
    return folder


def test_pillow_reads_the_frames_of_animated_images(program: list[str], tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    from PIL import Image, ImageSequence

    size = ["--width", "33", "--height", "24", "--readouts", "200"]
    pictures = ["reconstruct", "c.dat", "--window", "41", "--every", "40"]
    for words in (
        ["simulate", "--builtin-light", "chart", *size, "-o", "c"],
        [*pictures, "-o", "folder"],
        [*pictures, "-o", "a.gif"],
        [*pictures, "-o", "a.webp"],
    ):
        subprocess.run([*program, *words], cwd=tmp_path, check=True, capture_output=True)
    expected = [np.asarray(Image.open(path).convert("L")) for path in sorted((tmp_path / "folder").iterdir())]
    for name in ("a.gif", "a.webp"):
        with Image.open(tmp_path / name) as animation:
            assert animation.info["loop"] == 0
            frames = [np.asarray(frame.convert("L")) for frame in ImageSequence.Iterator(animation)]
            assert animation.info["duration"] == 40
        assert len(frames) == len(expected) == 5
        assert all(np.array_equal(a, b) for a, b in zip(frames, expected, strict=True)), name


@pytest.fixture(params=["scenes", "inputs"])
def packed(sets: Path, request: pytest.FixtureRequest) -> tuple[list[str], Path]:
    """Returns the tars of a set and the folder of the same sequences."""
    tars = sorted(str(path) for path in (sets / request.param / "shards").glob("*.tar"))
    assert len(tars) == 3
    return tars, sets / f"{request.param}-plain" / "sequences"


def check_samples(samples: Iterator[dict[str, Any]], plain: Path) -> None:
    """Asserts that the samples are the sequences of the folder ``plain``, with the bytes of every file."""
    found = set()
    for sample in samples:
        folder = plain / sample["__key__"]
        found.add(folder.name)
        description = json.loads(sample["json"]) if isinstance(sample["json"], bytes) else sample["json"]
        sidecar = json.loads((folder / "stream.json").read_text())
        assert description["id"] == folder.name
        assert int(description["sequence_seed"]) == sidecar["seeds"]["sequence"]
        assert (description["readouts"], description["mean_rate"]) == (sidecar["readouts"], sidecar["mean_rate"])
        files = {"stream.dat": sample["spk.dat"], "stream.clean.dat": sample["clean.dat"]}
        with tarfile.open(fileobj=io.BytesIO(sample["files.tar"])) as tar:
            files |= {member.name: tar.extractfile(member).read() for member in tar}
        listed = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.*")}
        for image in ("reference.png", "gt.png"):
            codes = listed.pop(image)
            name = image.removeprefix("reference.")
            if isinstance(sample[name], bytes):
                assert sample[name] == codes
            else:
                from PIL import Image

                assert np.array_equal(np.asarray(sample[name]), np.asarray(Image.open(io.BytesIO(codes))))
        assert files == listed
    assert found == {folder.name for folder in plain.iterdir()}


def test_webdataset_reads_packs(packed: tuple[list[str], Path]) -> None:
    webdataset = pytest.importorskip("webdataset")
    samples = list(webdataset.WebDataset(packed[0], shardshuffle=False))
    assert all({key for key in sample if not key.startswith("__")} == KEYS for sample in samples)
    check_samples(iter(samples), packed[1])


@pytest.mark.parametrize("streaming", [False, True], ids=["table", "streaming"])
def test_hugging_face_reads_packs(packed: tuple[list[str], Path], tmp_path: Path, streaming: bool) -> None:
    datasets = pytest.importorskip("datasets")
    pytest.importorskip("PIL")
    loaded = datasets.load_dataset(
        "webdataset", data_files=packed[0], split="train", streaming=streaming, cache_dir=str(tmp_path)
    )
    check_samples(iter(loaded), packed[1])


def test_hugging_face_reads_scenes_and_inputs_as_one_table(sets: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("datasets")
    pytest.importorskip("PIL")
    tars = [str(path) for name in ("scenes", "inputs") for path in sorted((sets / name / "shards").glob("*.tar"))]
    loaded = datasets.load_dataset("webdataset", data_files=tars, split="train", cache_dir=str(tmp_path))
    assert len(loaded) == 16 and {row["content"] for row in loaded["json"]} == {"drive", "input"}


def test_pycocotools_reads_boxes_of_packed_sequences(sets: Path) -> None:
    pytest.importorskip("pycocotools")
    from pycocotools.coco import COCO

    masks = 0
    for path in sorted((sets / "scenes" / "shards").glob("*.tar")):
        with tarfile.open(path) as shard:
            for member in (m for m in shard if m.name.endswith(".files.tar")):
                with tarfile.open(fileobj=shard.extractfile(member)) as tar:
                    coco = COCO()
                    coco.dataset = json.load(tar.extractfile("labels/coco.json"))
                    coco.createIndex()
                    for image in coco.dataset["images"]:
                        label = f"labels/{image['readout']:06}.instance.npy"
                        instance = np.load(io.BytesIO(tar.extractfile(label).read()))
                        for annotation in coco.loadAnns(coco.getAnnIds(imgIds=image["id"])):
                            assert np.array_equal(coco.annToMask(annotation) == 1, instance == annotation["track_id"])
                            masks += 1
    assert masks > 0
