"""A batch of clips gives the same bits as one simulation per clip."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest

import spikelane as sl


@pytest.fixture
def clips(clip) -> np.ndarray:
    return np.stack([np.roll(clip, k, axis=2) for k in range(6)])


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_a_batch_equals_one_simulation_per_clip(camera, clips, threads, interpolation):
    sequences = [5, 1, 2**63, 0, 9, 9]
    bits = sl.simulate_batch(
        camera, clips, 3, sequences=sequences, seed=4, camera_seed=2, interpolation=interpolation, threads=threads
    )
    packed = sl.simulate_batch(
        camera,
        clips,
        3,
        sequences=sequences,
        seed=4,
        camera_seed=2,
        interpolation=interpolation,
        threads=threads,
        dense=False,
    )
    for i, sequence in enumerate(sequences):
        simulator = sl.Simulator(camera, seed=4, camera_seed=2, sequence=sequence)
        expected = simulator.run(clips[i], readouts_per_frame=3, interpolation=interpolation)
        np.testing.assert_array_equal(packed[i], expected.packed)
        np.testing.assert_array_equal(bits[i], expected)


def test_cameras_and_camera_seeds_may_differ_from_clip_to_clip(camera, clips):
    cameras = [camera, camera.clean_twin(), camera.with_effect("prnu", sigma=0.3)] * 2
    found = sl.simulate_batch(cameras, clips, sequences=range(6), camera_seed=range(6), threads=2)
    for i, one in enumerate(cameras):
        alone = sl.Simulator(one, sequence=i, camera_seed=i).run_dense(clips[i], readouts_per_frame=1)
        np.testing.assert_array_equal(found[i], alone)


@pytest.mark.parametrize("dense", [True, False])
def test_windows_select_pixels_of_the_camera(clips, dense):
    camera = sl.Camera.preset("physical").with_shape(40, 50)
    places = np.array([(0, 0), (28, 30), (3, 7), (3, 7), (5, 6), (0, 1)])
    found = sl.simulate_batch(camera, list(clips), 2, sequences=range(6), windows=places, dense=dense, threads=2)
    for i, (row, col) in enumerate(places):
        part = sl.Simulator(camera.window(int(row), int(col), 12, 20), sequence=i)
        expected = part.run(clips[i], readouts_per_frame=2)
        np.testing.assert_array_equal(found[i], expected.to_dense() if dense else expected.packed)


def test_the_callers_buffer_is_filled(camera, clips):
    out = np.full((6, 5, 12, 20), 7, np.uint8)
    assert sl.simulate_batch(camera, clips, sequences=range(6), out=out) is out
    np.testing.assert_array_equal(out, sl.simulate_batch(camera, clips, sequences=range(6)))


@pytest.mark.parametrize("threads", [1, 2])
def test_progress_counts_clips_and_a_callback_error_stops_the_batch(camera, clips, threads):
    reports: list[tuple[float, float]] = []
    record = lambda done, total: reports.append((done, total))  # noqa: E731
    sl.simulate_batch(camera, clips, sequences=range(6), threads=threads, progress=record)
    assert reports[-1] == (6, 6)

    def stop(done: float, total: float) -> None:
        raise LookupError

    with pytest.raises(LookupError):
        sl.simulate_batch(camera, clips, sequences=range(6), threads=threads, progress=stop)


@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_stops_a_batch(camera, clips, threads):
    many = [clips[0]] * 200_000
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            sl.simulate_batch(camera, many, 20, sequences=range(200_000), dense=False, threads=threads)
    timer.join()


def test_progress_is_a_bar_if_tqdm_is_installed(camera, clips, capsys):
    tqdm = pytest.importorskip("tqdm")
    assert tqdm
    sl.simulate_batch(camera, clips, sequences=range(6), progress=True)
    assert "6.0/6.0" in capsys.readouterr().err
    sl.simulate_batch(camera, clips, sequences=range(6), progress=False)
    assert capsys.readouterr().err == ""
    with pytest.raises(sl.SpikelaneTypeError, match="progress"):
        sl.simulate_batch(camera, clips, sequences=range(6), progress=3)


def test_light_at_a_readout_equals_the_light_of_the_sensor(clip):
    at = [0, 3, 4, 9, 16, 19]
    found = sl.light_at(clip, at, 4, interpolation="linear")
    full = clip.astype(np.float32) / 255
    for light, t in zip(found, at, strict=True):
        k, w = min(t // 4, 4), (t % 4) / 4
        k, w = (4, 0) if t >= 16 else (k, w)
        expected = full[k] if w == 0 else full[k] + np.float32(w) * (full[k + 1] - full[k])
        np.testing.assert_allclose(light, expected, atol=1e-6)
    np.testing.assert_array_equal(sl.light_at(clip, [6], 4, interpolation="hold")[0], full[1])
    with pytest.raises(sl.SpikelaneError, match="readout 20"):
        sl.light_at(clip, [20], 4)


def test_light_at_names_a_wrong_shape_before_a_readout(clip):
    for light in (clip[None], np.stack([clip] * 3, axis=-1), np.zeros((20, 30, 3), np.uint8)):
        with pytest.raises(sl.SpikelaneError, match=r"frames: found shape"):
            sl.light_at(light, [10**6])


def test_light_at_checks_only_the_frames_of_the_readouts(clip):
    light = clip.astype(np.float32) / 255
    expected = sl.light_at(light, [6, 9], 4)
    light[0, 3, 2] = np.nan
    np.testing.assert_array_equal(sl.light_at(light, [6, 9], 4), expected)
    light[2, 3, 4] = np.nan
    # The name of the value is an expression of the caller's array.
    with pytest.raises(sl.SpikelaneError, match=r"frames\[1:4\]\[1, 3, 4\]"):
        sl.light_at(light, [6, 9], 4)
