"""A simulator gives the same bits for every way to pass the same light."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

import spikelane as sl


def bits_of(packed: np.ndarray, height: int, width: int) -> np.ndarray:
    """Unpacks spikes with NumPy."""
    flat = np.unpackbits(packed, axis=-1, bitorder="little")[..., : height * width]
    return flat.reshape(*packed.shape[:-1], height, width)


@pytest.mark.parametrize("interpolation", ["hold", "linear", "flow"])
def test_packed_and_unpacked_spikes_are_the_same(camera, clip, interpolation):
    how = {"readouts_per_frame": 7, "interpolation": interpolation}
    packed = sl.Simulator(camera, seed=3).run(clip, **how).packed
    bits = sl.Simulator(camera, seed=3).run_dense(clip, **how)
    assert packed.shape == (35, 30) and bits.shape == (35, 12, 20)
    assert packed.dtype == bits.dtype == np.uint8
    np.testing.assert_array_equal(bits_of(packed, 12, 20), bits)
    assert 0.02 < bits.mean() < 0.98


def test_an_ideal_pixel_counts_its_light_exactly():
    # Light g / 255 adds g / 255 thresholds per readout, so a pixel has fired floor(t g / 255) times after t readouts.
    light = np.arange(256, dtype=np.uint8).reshape(16, 16)
    bits = sl.Simulator(sl.Camera.ideal(16, 16)).run_dense(light, 1000)
    np.testing.assert_array_equal(bits.sum(axis=0), 1000 * light.astype(int) // 255)


def test_one_call_per_frame_equals_one_call_for_all_frames(camera, clip):
    together = sl.Simulator(camera).run(clip, readouts_per_frame=4, interpolation="hold")
    single = sl.Simulator(camera)
    apart = np.concatenate([single.run(frame, 4) for frame in clip])
    np.testing.assert_array_equal(together, apart)
    # Linear interpolation needs the next frame, so consecutive calls share one frame.
    how = {"readouts_per_frame": 4, "interpolation": "linear"}
    together = sl.Simulator(camera).run(clip, **how)
    chunks = sl.Simulator(camera)
    first = chunks.run(clip[:3], 8, **how)
    np.testing.assert_array_equal(np.concatenate([first, chunks.run(clip[2:], **how)]), together)


def test_equal_light_gives_equal_bits_for_every_sample_type():
    camera = sl.Camera.ideal(2, 3)
    light = np.array([[0, 51, 102], [153, 204, 255]], np.uint8)
    expected = sl.Simulator(camera).run(light, 500)
    wide = light.astype(np.uint16) * 257
    assert sl.Simulator(camera).run(wide, 500) == expected


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_and_backends_change_no_bit(clip, threads):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip, (1, 21, 20))[:, :250, :400]
    how = {"readouts_per_frame": 3, "interpolation": "linear"}
    expected = sl.Simulator(camera, seed=1).run(light, **how)
    found = sl.Simulator(camera, seed=1, threads=threads, backend="portable").run(light, **how)
    assert found == expected


@pytest.mark.parametrize("interpolation", ["hold", "linear", "flow"])
def test_run_fill_and_run_dense_give_the_same_bits(camera, clip, interpolation):
    how = {"readouts_per_frame": 7, "interpolation": interpolation}
    expected = sl.Simulator(camera).run(clip, **how)
    assert isinstance(expected, sl.SpikeFrames) and expected.shape == (35, 12, 20)
    out = np.full((35, 30), 255, np.uint8)
    assert sl.Simulator(camera).fill(clip, out, **how) is None
    np.testing.assert_array_equal(out, expected.packed)
    dense = np.full((35, 12, 20), 9, np.uint8)
    assert sl.Simulator(camera).run_dense(clip, out=dense, **how) is dense
    np.testing.assert_array_equal(dense, expected.to_dense())
    np.testing.assert_array_equal(sl.Simulator(camera).run_dense(clip, 8, **how), dense[:8])
    sl.Simulator(camera).fill(clip, out[:8], **how)
    np.testing.assert_array_equal(out, expected.packed)


def test_one_frame_is_held_for_all_readouts(camera, clip):
    expected = sl.Simulator(camera).run(clip[:1], readouts_per_frame=300)
    simulator = sl.Simulator(camera)
    parts = [simulator.run(clip[0], 130), simulator.run(clip[0], 0), simulator.run(clip[0], 170)]
    assert [part.readouts for part in parts] == [130, 0, 170]
    np.testing.assert_array_equal(np.concatenate(parts), expected)
    out = np.empty((300, 30), np.uint8)
    sl.Simulator(camera).fill(clip[0], out)
    np.testing.assert_array_equal(out, expected.packed)
    np.testing.assert_array_equal(sl.Simulator(camera).run_dense(clip[0], 300), expected)


def test_a_dropped_readout_does_not_shift_the_light(clip):
    camera = sl.Camera.ideal(12, 20).with_effect("dropped_readouts", probability=0.2)
    simulator = sl.Simulator(camera)
    assert simulator.run(clip, readouts_per_frame=20).readouts == 100
    assert simulator.next_readout > 100


def test_views_with_gaps_equal_contiguous_copies(camera, clip):
    wide = np.zeros((5, 15, 31), np.uint8)
    wide[:, 2:14, 4:24] = clip
    expected = sl.Simulator(camera).run(clip, readouts_per_frame=3)
    views = [wide[:, 2:14, 4:24], np.asfortranarray(clip), np.repeat(clip, 2, axis=0)[::2], clip[::-1][::-1]]
    for view in views:
        assert sl.Simulator(camera).run(view, readouts_per_frame=3) == expected
    turned = [sl.Simulator(camera).run(c, readouts_per_frame=3) for c in (clip[:, ::-1], clip[:, ::-1].copy())]
    assert turned[0] == turned[1] != expected


def test_a_restored_state_continues_with_the_same_bits(camera, clip):
    whole = sl.Simulator(camera, seed=2).run(clip, readouts_per_frame=6, interpolation="hold")
    first = sl.Simulator(camera, seed=2)
    first.run(clip[:2], readouts_per_frame=6, interpolation="hold")
    second = sl.Simulator(camera, seed=2)
    second.restore(first.state())
    assert second.next_readout == 12
    assert second.run(clip[2:], readouts_per_frame=6, interpolation="hold") == whole[12:]


def test_a_restart_equals_a_new_simulator(camera, clip):
    used = sl.Simulator(camera, seed=2)
    used.run(clip[0], 5)
    used.restart(7)
    assert used.seeds == (0, 2, 7) and used.next_readout == 0
    new = sl.Simulator(camera, seed=2, sequence=7)
    assert used.run(clip, readouts_per_frame=20) == new.run(clip, readouts_per_frame=20)
    used.restart(seed=9)
    assert used.seeds == (0, 9, 7)


def test_other_python_threads_run_during_a_call(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    simulator, ticks = sl.Simulator(camera), 0
    worker = threading.Thread(target=lambda: simulator.run(light, 3000))
    worker.start()
    while worker.is_alive():
        ticks += 1
        time.sleep(0.001)
    worker.join()
    assert ticks > 3


def test_a_running_simulator_rejects_a_second_call(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    simulator, seen = sl.Simulator(camera), []

    def from_progress(done: float, total: float) -> None:
        with pytest.raises(sl.SpikelaneError, match="one call at a time"):
            simulator.run(light, 1)
        seen.append(done / total)

    simulator.run(light, 2000, progress=from_progress)
    assert seen and seen[-1] == 1.0 and seen == sorted(seen)


def test_an_error_of_the_callback_ends_the_call_between_two_readouts(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]

    def stop(done: float, total: float) -> None:
        raise RuntimeError("enough")

    simulator = sl.Simulator(camera)
    with pytest.raises(RuntimeError, match="enough"):
        simulator.run(light, 3000, progress=stop)
    done = simulator.next_readout
    assert 0 < done <= 3000
    rest = sl.Simulator(camera)
    rest.run(light, done)
    assert simulator.run(light, 5) == rest.run(light, 5)


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_ctrl_c_stops_a_run(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    out = np.empty((400_000, 12_500), np.uint8)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        sl.Simulator(camera).fill(light, out)
    timer.join()
