"""Cameras: their effects, maps and windows, and conversion to files, bytes and pickles."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import spikelane as sl


def test_every_preset_simulates():
    assert "physical" in sl.presets()
    for name in sl.presets():
        camera = sl.Camera.preset(name).with_shape(10, 16)
        assert camera.name == name and camera.shape == (10, 16)
        spikes = sl.Simulator(camera).run_dense(np.full((10, 16), 128, np.uint8), 50)
        assert 0.1 < spikes.mean() < 0.9, name


def test_the_repr_of_a_camera_is_one_line_of_name_size_and_rate(camera):
    whole = camera.with_maps(gain=np.ones((12, 20)))
    assert repr(camera) == '<spikelane.Camera "physical", 12 x 20 pixels, 20000 readouts/s, 10 effects>'
    assert repr(whole.window(2, 3, 5, 7)).endswith("10 effects, window at row 2, col 3, maps: gain>")
    assert "0 effects" in repr(sl.Camera.ideal(3, 4))


def test_a_printed_camera_lists_its_sensor_effects_with_values_maps_and_source(camera):
    text = str(camera.with_maps(gain=np.ones((12, 20))).window(2, 3, 5, 7))
    lines = text.splitlines()
    assert lines[0] == 'Camera "physical"'
    for line in (
        "  size       5 x 7 pixels (height x width)",
        "  window     row 2, col 3 of 12 x 20 pixels",
        "  readouts   20000 per second",
        "  full scale 1 thresholds per readout",
        "  maps       gain",
        f"  source     {camera.source}",
    ):
        assert line in lines, text
    # A choice is printed as its word, and a quantity with its unit.
    assert "    dark_current: mean = 0.469 pA, sigma = 0 pA, negative = kept" in lines
    assert [line.strip().split(":")[0] for line in lines if line.startswith("    ")] == list(camera.effects)
    assert "  effects    none" in str(sl.Camera.ideal(3, 4)).splitlines()


def test_equal_cameras_are_equal_and_hash_alike(camera):
    other = sl.Camera.preset("physical").with_shape(12, 20)
    assert other == camera and hash(other) == hash(camera) and len({other, camera}) == 1
    assert camera != camera.with_effect("prnu", sigma=0.03) and camera != 3
    assert camera.with_effect("prnu", sigma=0.02) == camera


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_copies_of_a_camera_keep_maps_and_window(camera, again):
    gain = np.linspace(0.9, 1.1, 240).reshape(12, 20)
    whole = camera.with_maps(gain=gain)
    for one in (camera, whole, whole.window(2, 3, 5, 7)):
        assert again(one) == one
    np.testing.assert_array_equal(again(whole).maps["gain"], gain)
    assert again(whole.window(2, 3, 5, 7)).window_crop == (2, 3, 5, 7)


def test_a_saved_camera_with_maps_can_be_loaded(camera, tmp_path):
    whole = camera.with_maps(swing_v=np.full((12, 20), 1.05)).window(1, 1, 4, 8)
    path = whole.save(tmp_path / "camera")
    assert sl.Camera.load(path) == whole
    with pytest.raises(FileExistsError):
        whole.save(tmp_path / "camera")
    whole.save(tmp_path / "camera", force=True)
    assert sl.Camera.from_toml(whole.to_toml(), path.parent) == whole


def test_pickles_of_other_versions_and_truncated_pickles_are_rejected(camera):
    data = camera.to_bytes()
    for wrong in (b"", b"spkcam99" + data[8:], data[:-1], data[:20], b"x" * 100):
        with pytest.raises(sl.SpikelaneError, match="camera bytes"):
            sl.Camera.from_bytes(wrong)
    pickled = pickle.dumps(camera).replace(b"spkcam01", b"spkcam02")
    with pytest.raises(sl.SpikelaneError, match="another version"):
        pickle.loads(pickled)


def test_a_new_effect_is_neutral_and_omitted_parameters_do_not_change(camera):
    ideal = sl.Camera.ideal(4, 4)
    assert ideal.effects == {}
    changed = ideal.with_effect("dark_current", mean="500 fA")
    assert changed.effects["dark_current"] == {"mean": 0.5, "sigma": 0.0, "negative": "kept"}
    assert changed.with_effect("dark_current", negative="zero").effects["dark_current"]["mean"] == 0.5
    assert changed.without_effect("dark_current") == ideal
    for name, values in [("prnoo", {}), ("prnu", {"sigmma": 1}), ("prnu", {"sigma": -1})]:
        with pytest.raises(sl.SpikelaneError):
            ideal.with_effect(name, **values)
    for value in ("2 V", None, [1]):
        with pytest.raises(sl.SpikelaneError):
            ideal.with_effect("prnu", sigma=value)
    with pytest.raises(sl.SpikelaneError):
        ideal.without_effect("prnoo")


def test_effects_list_units_ranges_and_sources():
    all_ = sl.effects()
    assert all_["prnu"]["parameters"]["sigma"]["high"] == 1.0
    assert all_["dark_current"]["parameters"]["mean"]["unit"] == "pA"
    assert all_["shot_noise"]["parameters"]["counts"]["choices"] == ["electrons", "photons"]


def test_maps_of_another_size_or_not_finite_are_rejected(camera):
    for wrong in (np.ones((12, 19)), np.full((12, 20), np.nan)):
        with pytest.raises(sl.SpikelaneError, match="gain"):
            camera.with_maps(gain=wrong)
    with pytest.raises(TypeError):
        camera.with_maps(gain=np.ones((12, 20), np.float32))
    with pytest.raises(sl.SpikelaneError):
        camera.with_maps(gain=np.ones((12, 20))).with_shape(4, 4)


def test_a_window_has_the_pattern_of_its_position():
    # The camera has no random noise at readouts, so the window has the same spikes as this part of the whole sensor.
    camera = sl.Camera.ideal(30, 40).with_effect("prnu", sigma=0.05).with_effect("vignetting", strength=0.4)
    light = np.random.default_rng(0).integers(0, 256, (30, 40), np.uint8)
    whole = sl.Simulator(camera, camera_seed=3).run_dense(light, 300)
    part = sl.Simulator(camera.window(7, 11, 12, 17), camera_seed=3)
    found = part.run_dense(light[7:19, 11:28], 300)
    np.testing.assert_array_equal(found, whole[:, 7:19, 11:28])


def test_the_clean_twin_has_no_noise(camera):
    twin = camera.clean_twin()
    light = np.full((12, 20), 128, np.uint8)
    a = sl.Simulator(twin, seed=1, sequence=5).run(light, 40)
    b = sl.Simulator(twin, seed=1, sequence=5, camera_seed=9).run(light, 40)
    assert a == b
    assert set(twin.effects) <= {"start_phase", "saturation_clamp"}


def test_a_distribution_draws_the_same_camera_for_the_same_seed():
    cameras = sl.CameraDistribution()
    assert cameras.draw(3) == cameras.draw(3) != cameras.draw(4)
    assert pickle.loads(pickle.dumps(cameras)) == cameras
    low, high, unit, law = cameras.ranges["effects.shot_noise.photons_at_full_scale"]
    assert (low, high, unit, law) == (200.0, 30000.0, "electrons", "log_uniform")
    exposures = [cameras.draw(seed).thresholds_at_full_scale for seed in range(300)]
    assert 0.02 <= min(exposures) < 0.03 and 0.4 < max(exposures) <= 0.6
    # The median of a log-uniform law is the geometric mean of its bounds, here 0.1095. With 300 draws, the error is 17 %.
    assert 0.065 < np.median(exposures) < 0.185
    spreads = [cameras.draw(seed).effects["prnu"]["sigma"] for seed in range(300)]
    assert 0 <= min(spreads) and max(spreads) <= 0.07 and 0.025 < np.mean(spreads) < 0.045
    with pytest.raises(sl.SpikelaneError):
        sl.CameraDistribution("[effects.prnu]\nsigma = { uniform = [1, 0] }")


def test_a_mosaic_survives_files_and_pickles_and_shifts_with_a_window():
    camera = sl.Camera.ideal(8, 8).with_mosaic("RGGB")
    assert camera.mosaic == "RGGB" and sl.Camera.ideal(8, 8).mosaic is None
    assert camera.window(0, 1, 4, 4).mosaic == "GRBG"
    for other in (pickle.loads(pickle.dumps(camera)), sl.Camera.from_toml(camera.to_toml())):
        assert other == camera and other.mosaic == "RGGB"
    assert camera.with_mosaic(None) == sl.Camera.ideal(8, 8)
    with pytest.raises(sl.SpikelaneError, match="RGGB"):
        camera.with_mosaic("rggb")
