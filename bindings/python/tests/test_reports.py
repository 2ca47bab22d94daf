"""Measurement, calibration, diagnosis and scenes return the results of the program."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import threading

import numpy as np
import pytest

import spikelane as sl


@pytest.fixture(scope="module")
def flat() -> sl.SpikeFrames:
    camera = sl.Camera.preset("physical").with_shape(24, 32)
    return sl.Simulator(camera).run(np.full((24, 32), 60, np.uint8), 3000)


def test_measure_returns_the_result_of_the_program(flat, tmp_path, program):
    sl.write_stream(tmp_path / "a.dat", flat)
    done = subprocess.run(
        [*program, "--json", "measure", tmp_path / "a.dat"], capture_output=True, text=True, check=True
    )
    report = json.loads(done.stdout.splitlines()[-1])
    for stream in (tmp_path / "a.dat", sl.open_stream(tmp_path / "a.dat")):
        found = sl.measure(stream)
        assert found.readouts == 3000 and found.is_moving == report["scene_motion"]["is_moving"]
        for name in ("value", "upper_limit", "recording_error", "sensor_error"):
            numbers = {s.key: getattr(s, name) for s in found.statistics}
            expected = {s["key"]: s[name] for s in report["statistics"] if name in s}
            assert {key: x for key, x in numbers.items() if x == x} == expected, name
    np.testing.assert_allclose(found.rate, flat.to_dense().mean(axis=0))
    assert found["mean-rate"] in found.statistics
    assert found == found and dataclasses.is_dataclass(found)
    with pytest.raises(KeyError, match="mean-rate"):
        found["no such"]


def test_measure_accepts_packed_spikes_and_reports_progress(flat):
    shares: list[float] = []
    found = sl.measure(flat, progress=lambda done, total: shares.append(done / total))
    assert shares[-1] == 1.0
    assert found["mean-rate"].value == pytest.approx(flat.to_dense().mean())
    # The test compares texts, because NaN is not equal to itself.
    assert repr(sl.measure(flat.packed, 24, 32)) == repr(found)
    with pytest.raises(sl.SpikelaneError, match="height and width"):
        sl.measure(flat.packed)


def test_an_error_of_the_callback_ends_a_measurement(flat):
    def stop(done: float, total: float) -> None:
        raise OverflowError

    with pytest.raises(OverflowError):
        sl.measure(flat, progress=stop)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory) -> os.PathLike:
    """Simulates a recording set of a camera in the dark and at several light levels."""
    folder = tmp_path_factory.mktemp("set")
    camera = sl.Camera.preset("physical").with_shape(32, 32).without_effect("hot_pixels")
    rows = ["width = 32", "height = 32", "readout_hz = 20000.0"]
    for i, level in enumerate((0.0, 0.1, 0.3, 0.6)):
        light = np.full((32, 32), level, np.float32)
        spikes = sl.Simulator(camera, sequence=i, camera_seed=3).run(light, 4000)
        sl.write_stream(folder / f"{i}.dat", spikes, readout_hz=20_000)
        rows += ["[[recording]]", f'file = "{i}.dat"', f"light = {level}"]
    (folder / "set.toml").write_text("\n".join(rows))
    return folder / "set.toml"


def test_calibrate_finds_the_camera_that_recorded(recordings, tmp_path):
    found = sl.calibrate(recordings, out=tmp_path / "c")
    # With four levels and 1024 pixels, the uncertainty of the light, 1 %, limits the error of the mean gain.
    assert found.gain.value == pytest.approx(1.0, abs=0.03)
    assert 0.01 < found.gain_spread.value < 0.03
    assert {lamp.stated_light for lamp in found.lamps} == {0.0, 0.1, 0.3, 0.6}
    assert [lamp.pull is None for lamp in found.lamps] == [True, False, False, False]
    # The camera has no falloff and no mosaic, and its noise is constant between resets.
    assert found.corner_falloff is None and found.class_gains == ()
    assert found.redraw_share.value < 4 * found.redraw_share.error and found.noise_sampling == "every-reset"
    assert found.camera.shape == (32, 32) and set(found.camera.maps) == {"gain", "dark_pa", "swing_v"}
    assert sl.Camera.load(tmp_path / "c" / "camera.toml") == found.camera
    assert json.loads((tmp_path / "c" / "calibration.json").read_text())["width"] == 32
    with pytest.raises(FileExistsError):
        sl.calibrate(recordings, out=tmp_path / "c")
    # The calibrated camera can be simulated.
    assert sl.Simulator(found.camera).run_dense(np.full((32, 32), 100, np.uint8), 50).mean() > 0.2


def test_an_existing_report_is_an_error_before_the_set_is_read(tmp_path):
    (tmp_path / "report.html").write_text("mine")
    for function in (sl.calibrate, sl.diagnose):
        with pytest.raises(FileExistsError, match=r"report\.html"):
            function(tmp_path / "no.toml", out=tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_report_of_another_process_is_an_error_before_the_set_is_read(tmp_path):
    fcntl = pytest.importorskip("fcntl")
    with (tmp_path / ".camera.toml.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for function in (sl.calibrate, sl.diagnose):
            with pytest.raises(sl.SpikelaneError, match=r"camera\.toml"):
                function(tmp_path / "no.toml", out=tmp_path)
        with pytest.raises(sl.SpikelaneError, match=r"camera\.toml"):
            sl.Camera.preset("ideal").save(tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == [".camera.toml.lock"]


def test_invalid_sets_are_rejected(tmp_path):
    with pytest.raises(FileNotFoundError):
        sl.calibrate(tmp_path / "no.toml")
    (tmp_path / "bad.toml").write_text("width = 3")
    for function in (sl.calibrate, sl.diagnose):
        with pytest.raises(sl.SpikelaneError, match=r"bad\.toml"):
            function(tmp_path / "bad.toml")


def test_a_time_limit_ends_a_diagnosis(recordings):
    # A nanosecond is over before the first simulation.
    found = sl.diagnose(recordings, time_limit=1e-9)
    assert found.verdict == "undecided" and found.limits == ()
    assert found.undecided == ("whether the recordings agree with the model",)


@pytest.mark.parametrize("limit", [0, -1.0, float("nan"), float("inf")])
def test_a_time_limit_is_a_positive_number(recordings, limit):
    with pytest.raises(sl.SpikelaneError, match=r"time_limit.*a positive number of seconds"):
        sl.diagnose(recordings, time_limit=limit)


def test_ctrl_c_stops_a_diagnosis(recordings):
    timer = threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            sl.diagnose(recordings)
    timer.join()


@pytest.mark.skipif(
    not os.environ.get("SPIKELANE_SLOW"), reason="a whole diagnosis takes minutes; SPIKELANE_SLOW=1 runs it"
)
def test_diagnose_agrees_with_the_camera_that_recorded(recordings, tmp_path):
    found = sl.diagnose(recordings, out=tmp_path / "d")
    assert found.verdict in ("agrees", "explained", "partly-explained", "unknown")
    assert bool(found.limits) == (found.verdict in ("agrees", "explained"))
    assert found.camera.shape == (32, 32) and found.discrepancy.noise_floor > 0
    assert json.loads((tmp_path / "d" / "diagnosis.json").read_text())["verdict"] == found.verdict


def test_a_scene_has_light_and_labels_as_arrays():
    scene = sl.Scene(7, 40, 64, lighting="noon", duration_s=1.0)
    found = scene.render(0.5)
    assert found.light.shape == found.depth.shape == found.instances.shape == (40, 64)
    assert found.light.dtype == np.float32 and found.rgb.shape == (40, 64, 3)
    assert found.flow.shape == (2, 40, 64) and found.occluded.dtype == np.bool_
    assert np.isfinite(found.light).all() and (found.light >= 0).all()
    seen = set(np.unique(found.instances)) - {0}
    assert seen == {box.track_id for box in found.boxes if box.visible_pixels}
    for box in found.boxes:
        if box.visible_box:
            rows, cols = np.nonzero(found.instances == box.track_id)
            assert box.visible_pixels == rows.size
            assert box.visible_box[0] == pytest.approx(cols.min(), abs=1) and box.visible_box[3] == pytest.approx(
                rows.max() + 1, abs=1
            )
    again = sl.Scene(7, 40, 64, lighting="noon", duration_s=1.0).render(0.5, threads=2)
    np.testing.assert_array_equal(again.light, found.light)
    clip = scene.clip(0.1, 3, 1000)
    np.testing.assert_array_equal(clip[2], scene.render(0.102).light)
    assert set(np.unique(found.semantic)) <= set(sl.Scene.semantic_names())
    for wrong in (
        lambda: scene.render(2.0),
        lambda: scene.clip(0.9, 300, 1000),
        lambda: sl.Scene(1, lighting="blue"),
    ):
        with pytest.raises(sl.SpikelaneError):
            wrong()
