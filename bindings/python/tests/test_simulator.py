"""Laws of a simulator: the same bits whichever way light is pushed."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

import spikelane as sl


def bits_of(packed: np.ndarray, height: int, width: int) -> np.ndarray:
    """Unpacking with NumPy alone."""
    flat = np.unpackbits(packed, axis=-1, bitorder="little")[..., : height * width]
    return flat.reshape(*packed.shape[:-1], height, width)


@pytest.mark.parametrize("insertion", ["hold", "linear", "flow"])
def test_packed_and_unpacked_spikes_are_the_same(camera, clip, insertion):
    packed = sl.Simulator(camera, seed=3).push(clip, 7, insertion=insertion)
    bits = sl.Simulator(camera, seed=3).push_bits(clip, 7, insertion=insertion)
    assert packed.shape == (35, 30) and bits.shape == (35, 12, 20)
    assert packed.dtype == bits.dtype == np.uint8
    np.testing.assert_array_equal(bits_of(packed, 12, 20), bits)
    assert 0.02 < bits.mean() < 0.98


def test_an_ideal_pixel_counts_its_light_exactly():
    # Charge of g / 255 a readout: floor(t g / 255) spikes after t readouts.
    light = np.arange(256, dtype=np.uint8).reshape(16, 16)
    bits = sl.Simulator(sl.Camera.ideal(16, 16)).push_bits(light, 1000)
    np.testing.assert_array_equal(bits.sum(axis=0), 1000 * light.astype(int) // 255)


def test_frames_one_by_one_are_frames_together(camera, clip):
    together = sl.Simulator(camera).push(clip, 4, insertion="hold")
    single = sl.Simulator(camera)
    apart = np.concatenate([single.push(frame, 4, insertion="hold") for frame in clip])
    np.testing.assert_array_equal(together, apart)
    # Linear light needs the next frame: chunks overlap by one.
    together = sl.Simulator(camera).push(clip, 4)
    chunks = sl.Simulator(camera)
    first = chunks.push(clip[:3], 4, readouts=8)
    np.testing.assert_array_equal(np.concatenate([first, chunks.push(clip[2:], 4)]), together)


def test_the_kind_of_samples_does_not_matter_where_light_is_the_same():
    camera = sl.Camera.ideal(2, 3)
    light = np.array([[0, 51, 102], [153, 204, 255]], np.uint8)
    expected = sl.Simulator(camera).push(light, 500)
    wide = light.astype(np.uint16) * 257
    np.testing.assert_array_equal(sl.Simulator(camera).push(wide, 500), expected)


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_and_backends_change_no_bit(clip, threads):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip, (1, 21, 20))[:, :250, :400]
    expected = sl.Simulator(camera, seed=1).push(light, 3)
    found = sl.Simulator(camera, seed=1, threads=threads, backend="portable").push(light, 3)
    np.testing.assert_array_equal(found, expected)


def test_a_buffer_of_the_caller_is_filled_and_returned(camera, clip):
    out = np.full((35, 30), 255, np.uint8)
    found = sl.Simulator(camera).push(clip, 7, out=out)
    assert found is out
    np.testing.assert_array_equal(out, sl.Simulator(camera).push(clip, 7))
    bits = np.full((35, 12, 20), 9, np.uint8)
    assert sl.Simulator(camera).push_bits(clip, 7, out=bits) is bits
    np.testing.assert_array_equal(sl.pack(bits), out)


def test_views_with_gaps_are_read_as_what_they_show(camera, clip):
    wide = np.zeros((5, 15, 31), np.uint8)
    wide[:, 2:14, 4:24] = clip
    expected = sl.Simulator(camera).push(clip, 3)
    views = [wide[:, 2:14, 4:24], np.asfortranarray(clip), np.repeat(clip, 2, axis=0)[::2], clip[::-1][::-1]]
    for view in views:
        np.testing.assert_array_equal(sl.Simulator(camera).push(view, 3), expected)
    np.testing.assert_array_equal(
        sl.Simulator(camera).push(clip[:, ::-1], 3), sl.Simulator(camera).push(clip[:, ::-1].copy(), 3)
    )


def test_a_state_goes_on_with_the_same_bits(camera, clip):
    whole = sl.Simulator(camera, seed=2).push(clip, 6, insertion="hold")
    first = sl.Simulator(camera, seed=2)
    first.push(clip[:2], 6, insertion="hold")
    second = sl.Simulator(camera, seed=2)
    second.restore(first.state())
    assert second.readout == 12
    np.testing.assert_array_equal(second.push(clip[2:], 6, insertion="hold"), whole[12:])


def test_a_restart_is_a_new_simulator(camera, clip):
    used = sl.Simulator(camera, seed=2)
    used.push(clip)
    used.restart(7)
    assert used.seeds == (0, 2, 7) and used.readout == 0
    new = sl.Simulator(camera, seed=2, sequence=7)
    np.testing.assert_array_equal(used.push(clip, 20), new.push(clip, 20))
    used.restart(seed=9)
    assert used.seeds == (0, 9, 7)


def test_other_python_threads_run_meanwhile(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    simulator, ticks = sl.Simulator(camera), 0
    worker = threading.Thread(target=lambda: simulator.push(light, 3000))
    worker.start()
    while worker.is_alive():
        ticks += 1
        time.sleep(0.001)
    worker.join()
    assert ticks > 3


def test_a_simulator_at_work_refuses_a_second_call(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    simulator, seen = sl.Simulator(camera), []

    def from_progress(done: float, total: float) -> None:
        with pytest.raises(sl.SpikelaneError, match="one call at a time"):
            simulator.push(light)
        seen.append(done / total)

    simulator.push(light, 2000, progress=from_progress)
    assert seen and seen[-1] == 1.0 and seen == sorted(seen)


def test_an_error_of_the_callback_ends_the_call_between_two_readouts(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]

    def stop(done: float, total: float) -> None:
        raise RuntimeError("enough")

    simulator = sl.Simulator(camera)
    with pytest.raises(RuntimeError, match="enough"):
        simulator.push(light, 3000, progress=stop)
    done = simulator.readout
    assert 0 < done <= 3000
    rest = sl.Simulator(camera)
    rest.push(light, done)
    np.testing.assert_array_equal(simulator.push(light, 5), rest.push(light, 5))


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_ctrl_c_stops_a_run(clip):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    out = np.empty((400_000, 12_500), np.uint8)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        sl.Simulator(camera).push(light, 400_000, out=out)
    timer.join()
