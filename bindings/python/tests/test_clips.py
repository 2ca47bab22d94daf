"""Training items: (seed, epoch, index) determines a stream, with and without torch."""

from __future__ import annotations

import hashlib
import pickle

import numpy as np
import pytest

import spikelane as sl

try:
    import torch
    from torch.utils.data import DataLoader

    from spikelane.torch import SpikeClips, SpikeClipStream, SpikeLoader, unpack
except ImportError as why:
    needs_torch = pytest.mark.skip(reason=f"torch is not here ({why}); install python3-torch or torch")
else:
    needs_torch = pytest.mark.skipif(False, reason="")


@pytest.fixture(scope="module")
def clips() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (7, 4, 30, 36), np.uint8)


@pytest.fixture(scope="module")
def physical() -> sl.Camera:
    return sl.Camera.preset("physical").with_shape(30, 36)


def digest(item: dict) -> str:
    return hashlib.sha256(np.ascontiguousarray(item["spikes"]).tobytes()).hexdigest()


def test_seed_epoch_and_index_determine_an_item(clips, physical):
    def sampler(seed: int) -> sl.ClipSampler:
        return sl.ClipSampler(clips, physical, 5, crop=(16, 16), seed=seed)

    one = sampler(3)
    names = {digest(sampler(3).item(i, e)) for i in range(7) for e in range(3)}
    assert len(names) == 21
    assert digest(one.item(4, 2)) == digest(sampler(3).item(4, 2)) == digest(one.item(-3, 2))
    assert digest(one.item(4, 2)) != digest(sampler(4).item(4, 2))
    assert digest(one[4]) == digest(one.item(4, 0))
    with pytest.raises(IndexError):
        one.item(7)
    assert len(list(one)) == 7


def test_a_crop_is_a_window_of_the_one_camera(clips, physical):
    sampler = sl.ClipSampler(clips, physical, 5, crop=(16, 12), seed=3, target_readouts=[0, 7, 19], clean=True)
    seeds, places = set(), set()
    for index in range(7):
        item = sampler.item(index)
        row, col = item["row"], item["col"]
        part = physical.window(row, col, 16, 12)
        light = clips[index][:, row : row + 16, col : col + 12]
        arguments = {"seed": 3, "sequence": item["sequence"], "camera_seed": item["camera_seed"]}
        np.testing.assert_array_equal(item["spikes"], sl.Simulator(part, **arguments).run(light, readouts_per_frame=5))
        clean = sl.Simulator(part.clean_twin(), **arguments).run(light, readouts_per_frame=5)
        np.testing.assert_array_equal(item["clean"], clean)
        np.testing.assert_array_equal(item["light"], sl.light_at(light, [0, 7, 19], 5))
        seeds.add(item["camera_seed"])
        places.add((row, col))
    assert len(seeds) == 1 and len(places) > 4


def test_a_distribution_draws_a_camera_for_each_clip(clips):
    cameras = sl.CameraDistribution()
    sampler = sl.ClipSampler(clips, cameras, 5, crop=(16, 16), seed=3)
    items = [sampler.item(i, e) for i in range(7) for e in (0, 1)]
    assert len({item["camera_seed"] for item in items}) == 14
    assert len({item["thresholds_at_full_scale"] for item in items}) == 14
    for item in items:
        camera = cameras.draw(item["camera_seed"]).with_shape(16, 16)
        assert item["thresholds_at_full_scale"] == camera.thresholds_at_full_scale
        row, col = item["row"], item["col"]
        light = clips[item["index"]][:, row : row + 16, col : col + 16]
        arguments = {"seed": 3, "sequence": item["sequence"], "camera_seed": item["camera_seed"]}
        expected = sl.Simulator(camera, **arguments).run(light, readouts_per_frame=5)
        np.testing.assert_array_equal(item["spikes"], expected)
    listed = sl.ClipSampler(clips, cameras, 5, crop=[16, 16], seed=3)
    assert digest(listed.item(6, 1)) == digest(items[-1])
    few = sl.ClipSampler(clips, cameras, 5, seed=3, camera_count=3)
    assert len({few.item(i, e)["camera_seed"] for i in range(7) for e in range(4)}) == 3


def test_packed_items_and_shorter_ones(clips, physical):
    full = sl.ClipSampler(clips, physical, 5).item(2)["spikes"]
    packed = sl.ClipSampler(clips, physical, 5, dense=False, readouts=8).item(2)["spikes"]
    np.testing.assert_array_equal(sl.unpack(packed, 30, 36), full[:8])


def test_a_sampler_can_be_pickled(clips, physical):
    sampler = sl.ClipSampler(clips, physical, 5, crop=(8, 8))
    again = pickle.loads(pickle.dumps(sampler))
    assert digest(again.item(3, 1)) == digest(sampler.item(3, 1))


def test_wrong_arguments_are_rejected(clips, physical):
    for make in (
        lambda: sl.ClipSampler(clips, "physical"),
        lambda: sl.ClipSampler([], physical),
        lambda: sl.ClipSampler(clips, physical, camera_count=0),
        lambda: sl.ClipSampler(clips, physical, crop=(31, 8))[0],
        lambda: sl.ClipSampler(clips, physical.with_shape(8, 8))[0],
        lambda: sl.ClipSampler(clips[0], physical)[0],
        lambda: sl.ClipSampler(clips, physical, target_readouts=[4])[0],
    ):
        with pytest.raises(sl.SpikelaneError):
            make()


@needs_torch
@pytest.mark.parametrize("start", ["fork", "spawn"])
@pytest.mark.parametrize("workers", [0, 1, 4])
def test_workers_give_the_same_streams(clips, physical, workers, start):
    data = SpikeClips(clips, physical, 5, crop=(16, 16), seed=3)
    context = start if workers else None
    loader = DataLoader(data, batch_size=2, num_workers=workers, multiprocessing_context=context)
    data.set_epoch(1)
    sampler = sl.ClipSampler(clips, physical, 5, crop=(16, 16), seed=3)
    expected = [digest(sampler.item(i, 1)) for i in range(7)]
    found = [digest({"spikes": one.numpy()}) for batch in loader for one in batch["spikes"]]
    assert found == expected


@needs_torch
def test_persistent_workers_see_the_epoch(clips, physical):
    data = SpikeClips(clips, physical, 5, seed=3)
    loader = DataLoader(data, batch_size=None, num_workers=2, persistent_workers=True)
    sampler = sl.ClipSampler(clips, physical, 5, seed=3)
    for epoch in (0, 1, 5):
        data.set_epoch(epoch)
        found = [digest({"spikes": item["spikes"].numpy()}) for item in loader]
        assert found == [digest(sampler.item(i, epoch)) for i in range(7)]


@needs_torch
@pytest.mark.parametrize("workers", [0, 1, 4])
def test_a_pass_has_each_item_once_with_any_number_of_workers(clips, physical, workers):
    data = SpikeClipStream(clips, physical, 5, seed=3)
    sampler = sl.ClipSampler(clips, physical, 5, seed=3)
    data.set_epoch(2)
    found = {
        int(item["index"]): digest({"spikes": item["spikes"].numpy()})
        for item in DataLoader(data, batch_size=None, num_workers=workers)
    }
    assert found == {i: digest(sampler.item(i, 2)) for i in range(7)}
    parts = [SpikeClipStream(clips, physical, 5, seed=3, rank=r, ranks=3) for r in range(3)]
    assert sorted(item["index"] for part in parts for item in part) == list(range(7))
    assert [len(part) for part in parts] == [3, 2, 2]
    orders = {tuple(item["index"] for item in data) for _ in range(2)}
    data.set_epoch(3)
    assert len(orders) == 1 and tuple(item["index"] for item in data) not in orders


def assert_equal_batches(found: dict, expected: dict) -> None:
    assert set(found) == set(expected)
    for key, value in expected.items():
        if torch.is_tensor(value):
            assert found[key].dtype == value.dtype and torch.equal(found[key], value), key
        else:
            assert found[key] == value, key


@needs_torch
@pytest.mark.parametrize("cameras", ["one", "drawn", "few"])
@pytest.mark.parametrize("dense", [False, True])
def test_a_batch_of_threads_equals_a_batch_of_workers(clips, physical, cameras, dense):
    camera = physical if cameras == "one" else sl.CameraDistribution()
    count = 3 if cameras == "few" else None
    options = {
        "crop": (16, 12),
        "seed": 3,
        "clean": True,
        "dense": dense,
        "camera_count": count,
        "target_readouts": [2, 9],
    }
    data = SpikeClips(clips, camera, 5, **options)
    for epoch in (0, 4):
        data.set_epoch(epoch)
        expected = list(DataLoader(data, batch_size=3))
        for threads in (1, 3):
            found = list(SpikeLoader(data, 3, threads=threads))
            assert len(found) == len(expected) == len(SpikeLoader(data, 3)) == 3
            for one, other in zip(found, expected, strict=True):
                assert_equal_batches(one, other)


@needs_torch
def test_a_shuffled_pass_has_each_item_once_and_a_new_order_in_each_epoch(clips, physical):
    data = SpikeClips(clips, physical, 5, seed=3)
    orders = []
    for epoch in (0, 0, 1):
        data.set_epoch(epoch)
        parts = [SpikeLoader(data, 2, shuffle=True, rank=rank, ranks=2) for rank in range(2)]
        orders.append([index for part in parts for batch in part for index in batch["index"].tolist()])
        assert sorted(orders[-1]) == list(range(7))
    assert orders[0] == orders[1] != orders[2]
    assert [len(SpikeLoader(data, 2, drop_last=drop)) for drop in (False, True)] == [4, 3]
    assert len(list(SpikeLoader(data, 2, drop_last=True))) == 3


@needs_torch
def test_batches_of_a_loader_are_not_overwritten(clips, physical):
    data = SpikeClips(clips, physical, 5, seed=3)
    kept = list(SpikeLoader(data, 1, ahead=1))
    for index, batch in enumerate(kept):
        np.testing.assert_array_equal(batch["spikes"][0].numpy(), data.sampler.item(index)["spikes"])


@needs_torch
def test_the_end_of_an_iteration_ends_its_thread(clips, physical):
    import threading

    data = SpikeClips(clips, physical, 5, seed=3)
    for _ in SpikeLoader(data, 1, ahead=2):
        break
    assert not any(thread.name == "SpikeLoader" for thread in threading.enumerate())


@needs_torch
def test_an_error_in_a_thread_names_the_clip(clips, physical):
    wrong = [*clips[:3], clips[3].astype(np.float32) * np.nan]
    batches = iter(SpikeLoader(SpikeClips(wrong, physical, 5), 2))
    next(batches)
    with pytest.raises(sl.SpikelaneError, match=r"clips\[3\]"):
        next(batches)
    for wrong_arguments in ({"batch_size": 0}, {"ahead": 0}, {"threads": 0}, {"rank": 1}):
        with pytest.raises(sl.SpikelaneError, match=next(iter(wrong_arguments))):
            SpikeLoader(SpikeClips(clips, physical, 5), **wrong_arguments)
    with pytest.raises(sl.SpikelaneError, match="data"):
        SpikeLoader(clips)


@needs_torch
@pytest.mark.parametrize("size", [(30, 36), (7, 5), (1, 8)])
def test_tensor_operations_unpack_like_the_native_function(size):
    packed = np.random.default_rng(2).integers(0, 256, (2, 3, (size[0] * size[1] + 7) // 8), np.uint8)
    expected = np.stack([sl.unpack(one, *size) for one in packed])
    np.testing.assert_array_equal(unpack(torch.from_numpy(packed), *size).numpy(), expected)
    with pytest.raises(sl.SpikelaneError, match="packed"):
        unpack(torch.from_numpy(packed), size[0] + 8, size[1])


@needs_torch
def test_the_memory_of_a_tensor_can_be_the_buffer(clips, physical):
    out = torch.empty((20, 30, 36), dtype=torch.uint8)
    sl.Simulator(physical).run_dense(clips[0], readouts_per_frame=5, out=out.numpy())
    np.testing.assert_array_equal(out.numpy(), sl.Simulator(physical).run(clips[0], readouts_per_frame=5))


def test_only_spikelane_torch_imports_torch():
    import subprocess
    import sys

    code = "import sys, spikelane; sys.exit('torch' in sys.modules or 'tqdm' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
