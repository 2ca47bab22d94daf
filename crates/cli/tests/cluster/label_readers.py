"""Reads the labels of a data set with common tools and compares each result with the arrays that the program wrote.

    pip install pycocotools motmetrics trackeval pykitti mlcroissant numpy pillow
    python3 crates/cli/tests/cluster/label_readers.py SET [--spikecv CLONE]

The tools are pycocotools, motmetrics, TrackEval's readers of MOTChallenge and KITTI, pykitti's reader of calibrations and
mlcroissant. With a clone of SpikeCV, also tests SpikeCV's data_parameter_dict. Skips a missing tool and prints its name.
"""

import argparse
import contextlib
import importlib.util
import io
import json
import math
import os
import sys
import tempfile
import warnings
from importlib.metadata import version
from pathlib import Path

import numpy as np

# Packages older than NumPy 1.24 or 2 use names that NumPy has removed.
for name, kind in [("float", float), ("int", int), ("bool", bool)]:
    if name not in np.__dict__:
        setattr(np, name, kind)
if not hasattr(np, "asfarray"):
    np.asfarray = lambda a, dtype=float: np.asarray(a, dtype)


def main() -> int:
    arguments = argparse.ArgumentParser()
    arguments.add_argument("dataset", type=Path)
    arguments.add_argument("--spikecv", type=Path, metavar="CLONE")
    given = arguments.parse_args()
    root = given.dataset.resolve()
    sets = splits(root)
    for module, check in [
        ("pycocotools", with_coco),
        ("motmetrics", with_motmetrics),
        ("trackeval", with_trackeval),
        ("pykitti", with_pykitti),
        ("mlcroissant", with_croissant),
    ]:
        if importlib.util.find_spec(module) is None:
            print(f"{module}: not installed, left out")
            continue
        print(f"{module} {version(module)}: {check(root, sets)}")
    if given.spikecv:
        print(f"SpikeCV: {with_spikecv(root, sets, given.spikecv.resolve())}")
    return 0


def splits(root: Path) -> dict[str, list[Path]]:
    """Returns the folders of the sequences of each split."""
    found: dict[str, list[Path]] = {}
    for line in (root / "manifest.jsonl").read_text().splitlines()[1:]:
        entry = json.loads(line)
        place = root / "shards" / entry["shard"] if "shard" in entry else root
        found.setdefault(entry["split"], []).append(place / "sequences" / entry["id"])
    return found


def frames(sequence: Path) -> list[dict]:
    return json.loads((sequence / "labels/labels.json").read_text())["frames"]


def seen(frame: dict) -> list[dict]:
    return [b for b in frame["boxes"] if b["visible_pixels"] > 0]


def with_coco(root: Path, sets: dict[str, list[Path]]) -> str:
    """Asserts that masks equal the instance maps, boxes enclose the masks tightly, and every image exists."""
    from PIL import Image
    from pycocotools.coco import COCO

    images = masks = 0
    for split, sequences in sets.items():
        with contextlib.redirect_stdout(io.StringIO()):
            coco = COCO(str(root / split / "coco.json"))
        by_place = {(i["sequence"], i["readout"]): i for i in coco.dataset["images"]}
        assert len(by_place) == len(coco.dataset["images"]) == len(coco.imgs)
        for sequence in sequences:
            for frame in frames(sequence):
                image = by_place[(sequence.name, frame["readout"])]
                with Image.open(root / image["file_name"]) as picture:
                    assert picture.size == (image["width"], image["height"])
                instance = np.load(sequence / f"labels/{frame['readout']:06}.instance.npy")
                own = coco.loadAnns(coco.getAnnIds(imgIds=image["id"]))
                assert sorted(a["track_id"] for a in own) == sorted(b["track_id"] for b in seen(frame))
                for annotation in own:
                    mask = coco.annToMask(annotation)
                    assert np.array_equal(mask == 1, instance == annotation["track_id"])
                    rows, columns = np.nonzero(mask)
                    x, y, w, h = annotation["bbox"]
                    assert [x, y, x + w, y + h] == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
                    masks += 1
                images += 1
    return f"{images} images, {masks} masks equal the instance maps, boxes are tight"


def with_motmetrics(root: Path, sets: dict[str, list[Path]]) -> str:
    """Asserts that boxes equal those of labels.json, and that the ground truth as tracker output scores 1."""
    import motmetrics as mm

    boxes = 0
    for split, sequences in sets.items():
        for sequence in sequences:
            path = root / split / "mot" / sequence.name / "gt/gt.txt"
            if not path.read_text():
                assert not any(seen(f) for f in frames(sequence))
                continue
            for fmt in ["mot16", "mot15-2D"]:
                table = mm.io.loadtxt(str(path), fmt=fmt, min_confidence=0.5)
            for n, frame in enumerate(frames(sequence), 1):
                for box in seen(frame):
                    row = table.loc[(n, box["track_id"])]
                    x0, y0, x1, y1 = box["clipped_amodal_box"]
                    expected = [x0, y0, x1 - x0, y1 - y0]
                    # The text file rounds to two decimal places.
                    assert np.allclose(row[["X", "Y", "Width", "Height"]].astype(float), expected, atol=0.0051)
                    assert math.isclose(row["Visibility"], 1 - box["occlusion"], abs_tol=6e-5)
                    boxes += 1
            matched = mm.utils.compare_to_groundtruth(table, table, "iou", distth=0.5)
            summary = mm.metrics.create().compute(matched, metrics=["mota", "idf1"], name="own")
            assert summary["mota"]["own"] == 1 and summary["idf1"]["own"] == 1
    return f"{boxes} boxes equal labels.json; the truth against itself: MOTA 1, IDF1 1"


def with_trackeval(root: Path, sets: dict[str, list[Path]]) -> str:
    """Asserts that the readers of MOTChallenge and KITTI return every vehicle with a supported class."""
    import trackeval

    quiet = {"PRINT_CONFIG": False, "TRACKERS_TO_EVAL": ["own"]}
    mot = kitti = 0
    with tempfile.TemporaryDirectory() as place:
        for split, sequences in sets.items():
            names = [s.name for s in sequences]
            trackers = Path(place) / split / "own/data"
            trackers.mkdir(parents=True)
            for name in names:
                (trackers / f"{name}.txt").write_text((root / split / "mot" / name / "gt/gt.txt").read_text())
            read = trackeval.datasets.MotChallenge2DBox(quiet | {
                "GT_FOLDER": str(root / split / "mot"), "TRACKERS_FOLDER": str(Path(place) / split),
                "SEQ_INFO": dict.fromkeys(names), "SKIP_SPLIT_FOL": True,
            })
            for sequence in sequences:
                raw = read.get_raw_seq_data("own", sequence.name)
                counts = [len(ids) for ids in raw["gt_ids"]]
                assert counts == [len(seen(f)) for f in frames(sequence)], sequence
                assert all((classes == 3).all() for classes in raw["gt_classes"])
                mot += sum(counts)
            own = Path(place) / split / "kitti"
            (own / "label_02").mkdir(parents=True)
            rows = [f"{s.name} empty 000000 {len(frames(s)):06}\n" for s in sequences]
            (own / "evaluate_tracking.seqmap.training").write_text("".join(rows))
            for name in names:
                text = (root / split / "kitti/label_02" / f"{name}.txt").read_text()
                (own / "label_02" / f"{name}.txt").write_text(text)
                (trackers / f"{name}.txt").write_text("".join(line + " 1.0\n" for line in text.splitlines()))
            read = trackeval.datasets.Kitti2DBox(quiet | {
                "GT_FOLDER": str(own), "TRACKERS_FOLDER": str(Path(place) / split), "CLASSES_TO_EVAL": ["car"],
            })
            for sequence in sequences:
                raw = read.get_raw_seq_data("own", sequence.name)
                rows = zip(frames(sequence), raw["gt_ids"], raw["gt_classes"], raw["gt_dets"], strict=True)
                for frame, ids, kinds, boxes in rows:
                    # The reader of KITTI also returns vehicles of other classes.
                    there = {b["track_id"]: b for b in seen(frame)}
                    assert sorted(ids) == sorted(there), sequence
                    for track, kind, box in zip(ids, kinds, boxes, strict=True):
                        assert kind == {"Car": 1, "Van": 2, "Truck": 3, "Misc": 8}[there[track]["class"]]
                        x0, y0, x1, y1 = there[track]["clipped_amodal_box"]
                        assert np.allclose(box, [x0, y0, x1 - 1, y1 - 1], atol=0.0051)
                        kitti += 1
    return f"MotChallenge2DBox {mot} boxes, Kitti2DBox {kitti}, equal labels.json"


def with_pykitti(root: Path, sets: dict[str, list[Path]]) -> str:
    """Asserts that the projection of each 3-D box by P2 covers the 2-D box of the same line."""
    from pykitti.utils import read_calib_file

    checked = 0
    worst = 0.0
    for split, sequences in sets.items():
        for sequence in sequences:
            calib = read_calib_file(str(root / split / "kitti/calib" / f"{sequence.name}.txt"))
            projection = calib["P2"].reshape(3, 4)
            assert np.array_equal(calib["R0_rect"].reshape(3, 3), np.eye(3))
            turn = calib["Tr_velo_to_cam"].reshape(3, 4)[:, :3]
            assert np.allclose(turn @ turn.T, np.eye(3)) and np.allclose(turn @ [1, 0, 0], [0, 0, 1])
            for line in (root / split / "kitti/label_02" / f"{sequence.name}.txt").read_text().splitlines():
                words = line.split()
                truncated = int(words[3])
                box = np.array(words[6:10], float)
                h, w, l, x, y, z, turned = map(float, words[10:17])
                if truncated or z < 8:
                    continue
                corners = np.array([[sx * l / 2, sy * h, sz * w / 2] for sx in (-1, 1) for sy in (-1, 0) for sz in (-1, 1)])
                c, s = math.cos(turned), math.sin(turned)
                placed = corners @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + [x, y, z]
                seen_at = np.c_[placed, np.ones(8)] @ projection.T
                pixels = seen_at[:, :2] / seen_at[:, 2:]
                around = np.r_[pixels.min(0), pixels.max(0)]
                # Vehicles have rounded corners, so the projected 3-D box is slightly larger than the 2-D box. The 2-D box
                # encloses whole pixels, but only the center of a pixel must show the vehicle.
                slack = around - (box + [-0.5, -0.5, 0.5, 0.5])
                size = max(box[2] - box[0], box[3] - box[1])
                outside = max(slack[0], slack[1], -slack[2], -slack[3])
                inside = max(-slack[0], -slack[1], slack[2], slack[3])
                # The text file rounds to 0.01 m and 0.01 rad.
                rounding = projection[0, 0] * (0.01 + 0.005 * max(l, h)) / (z - l / 2)
                assert outside <= rounding + 0.52 and inside <= 0.2 * size + rounding + 1, (sequence, line, slack)
                worst = max(worst, inside / size)
                checked += 1
    return f"{checked} vehicles: the 3-D box through P2 covers the 2-D box to half a pixel, and is larger by {100 * worst:.0f} % of it at most"


def with_croissant(root: Path, sets: dict[str, list[Path]]) -> str:
    """Asserts that croissant.json is valid and that its records equal the table lines; mlcroissant checks digests."""
    import mlcroissant as mlc

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        described = mlc.Dataset(jsonld=str(root / "croissant.json"))
    issues = described.metadata.ctx.issues
    assert not issues.errors, issues.report()
    count = 0
    for split, sequences in sets.items():
        rows = list(described.records(record_set=split))
        lines = [json.loads(line) for line in (root / split / "metadata.jsonl").read_text().splitlines()]
        assert len(rows) == len(lines) == len(sequences)
        for row, line in zip(rows, lines, strict=True):
            for key, value in line.items():
                found = row[f"{split}/{key}"]
                found = found.decode() if isinstance(found, bytes) else found
                assert found == value, (key, found, value)
            assert (root / split / line["file_name"]).is_file() and (root / split / line["spike"]).is_file()
        count += len(rows)
    return f"no error, {len(issues.warnings)} warnings; {count} records equal the tables"


def with_spikecv(root: Path, sets: dict[str, list[Path]], clone: Path) -> str:
    """Asserts that data_parameter_dict finds the stream and the labels of each kind, equal to those of the sequence."""
    os.chdir(clone)
    sys.path[:0] = [str(clone), str(clone / "SpikeCV")]
    from spikecv.spkData.load_dat import SpikeStream, data_parameter_dict

    count: dict[str, int] = {}
    for split, sequences in sets.items():
        for sequence in sequences:
            for task, kind in [
                ("detection", "boxes"),
                ("tracking", "boxes"),
                ("mono_depth_estimation", "depth"),
                ("optical_flow", "flow"),
            ]:
                folder = root / "spikecv" / kind / split / "spike" / sequence.name
                with contextlib.redirect_stdout(io.StringIO()):
                    found = data_parameter_dict(str(folder), task)
                    stream = SpikeStream(offline=True, print_dat_detail=False, **found)
                    spikes = stream.get_spike_matrix(flipud=True)
                packed = (sequence / "stream.dat").read_bytes()
                width, height = found["spike_w"], found["spike_h"]
                bits = np.unpackbits(np.frombuffer(packed, np.uint8), bitorder="little").reshape(-1, height, width)
                assert np.array_equal(spikes, bits[:, ::-1]), (task, sequence)
                labels = sorted(found["labeled_data_dir"])
                readouts = [f["readout"] for f in frames(sequence)]
                if kind == "boxes":
                    own = root / split / "mot" / sequence.name / "gt/gt.txt"
                    assert len(labels) == 1 and Path(labels[0]).read_bytes() == own.read_bytes()
                elif kind == "depth":
                    assert len(labels) == len(readouts)
                    for path, readout in zip(labels, readouts, strict=True):
                        assert np.array_equal(np.load(path), np.load(sequence / f"labels/{readout:06}.depth.npy"))
                else:
                    assert len(labels) == len(readouts) - 1
                    for path, readout in zip(labels, readouts[:-1], strict=True):
                        assert Path(path).read_bytes() == (sequence / f"labels/{readout:06}.forward.flo").read_bytes()
                count[task] = count.get(task, 0) + len(labels)
    return ", ".join(f"{task} {n}" for task, n in count.items()) + " labels, streams bit by bit"


if __name__ == "__main__":
    sys.exit(main())
