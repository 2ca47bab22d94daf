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

    from spikelane.torch import SpikeClips, SpikeClipStream
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
