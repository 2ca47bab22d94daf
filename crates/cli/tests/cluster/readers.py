"""Packs and folders read by what users have: webdataset and Hugging Face's datasets, each compared with the files.

python3 crates/cli/tests/cluster/readers.py PLAIN PACKED MERGED: the same dataset made by `dataset`, by shards with --pack, and by shards
without; needs `pip install webdataset datasets pillow`.
"""

import io
import json
import sys
from pathlib import Path

import numpy as np


def main() -> None:
    plain, packed, merged = (Path(arg).resolve() for arg in sys.argv[1:4])
    tars = sorted(str(p) for p in (packed / "shards").glob("*.tar"))
    with_webdataset(plain, tars)
    with_datasets(plain, tars)
    with_imagefolder(plain, merged)


def same(plain: Path, key: str, files: dict) -> None:
    """The bytes of a sample's files are those of the sequence."""
    folder = plain / "sequences" / key
    for name, path in [("spk.dat", "stream.dat"), ("clean.dat", "stream.clean.dat"), ("png", "reference.png"), ("gt.png", "gt.png")]:
        assert files[name] == (folder / path).read_bytes(), (key, name)
    assert json.loads(files["json"])["id"] == key
    labels = sorted(p.name for p in (folder / "labels").glob("*.npy"))
    for label in labels:
        name = f"labels-{label.removesuffix('.npy').replace('.', '-')}.npy"
        assert np.array_equal(np.load(io.BytesIO(files[name])), np.load(folder / "labels" / label)), (key, name)


def with_webdataset(plain: Path, tars: list[str]) -> None:
    import webdataset as wds

    splits: dict[str, set[str]] = {}
    count = 0
    for sample in wds.WebDataset(tars, shardshuffle=False):
        same(plain, sample["__key__"], sample)
        splits.setdefault(sample["split.txt"].decode(), set()).add(sample["__key__"])
        count += 1
    for split, keys in splits.items():
        assert keys == {p.stem for p in (plain / split / "gt").glob("*.png")}, split
    decoded = next(iter(wds.WebDataset(tars, shardshuffle=False).decode("rgb8")))
    print(f"webdataset {wds.__version__}: {count} sequences in {len(tars)} tars, splits "
          f"{ {k: len(v) for k, v in sorted(splits.items())} }; decoded: png {decoded['png'].shape}, "
          f"depth {decoded['labels-000000-depth.npy'].shape}")


def with_datasets(plain: Path, tars: list[str]) -> None:
    import datasets

    loaded = datasets.load_dataset("webdataset", data_files={"train": tars}, split="train", streaming=True)
    count = 0
    for sample in loaded:
        key = sample["__key__"]
        folder = plain / "sequences" / key
        assert sample["spk.dat"] == (folder / "stream.dat").read_bytes(), key
        assert sample["json"]["id"] == key
        count += 1
    print(f"datasets {datasets.__version__}, webdataset: {count} sequences, columns such as {sorted(sample)[:4]}")


def with_imagefolder(plain: Path, merged: Path) -> None:
    import datasets
    from PIL import Image

    for root in (plain, merged):
        loaded = datasets.load_dataset("imagefolder", data_dir=str(root))
        for split, rows in loaded.items():
            names = set()
            for row in rows:
                names.add(row["id"])
                with Image.open(plain / split / "gt" / f"{row['id']}.png") as picture:
                    assert np.array_equal(np.asarray(row["image"]), np.asarray(picture)), row["id"]
                assert (root / split / row["spike"]).is_file()
            assert names == {p.stem for p in (plain / split / "gt").glob("*.png")}, split
        print(f"datasets {datasets.__version__}, imagefolder of {'plain' if root == plain else 'shards'}: "
              f"{ {split: len(rows) for split, rows in loaded.items()} }")


if __name__ == "__main__":
    main()
