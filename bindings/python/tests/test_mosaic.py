"""Color cameras: RGB light, the phase of crops, and demosaicing."""

import subprocess

import numpy as np
import pytest

import spikelane as sl


def _colors(frames, height, width, seed=3):
    return np.random.default_rng(seed).random((frames, height, width, 3), dtype=np.float32)


def _expected_light(rgb, pattern):
    """The light behind the filters of a 2x2 pattern, by indexing."""
    light = np.empty(rgb.shape[:-1], np.float32)
    for i, letter in enumerate(pattern):
        rows, cols = slice(i // 2, None, 2), slice(i % 2, None, 2)
        light[..., rows, cols] = rgb[..., rows, cols, "RGB".index(letter)]
    return light


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_a_pixel_receives_the_color_of_its_filter(pattern):
    camera = sl.Camera.ideal(7, 10).with_mosaic(pattern)
    rgb = _colors(3, 7, 10)
    np.testing.assert_array_equal(camera.filter_light(rgb), _expected_light(rgb, pattern))
    bytes_ = (255 * rgb).astype(np.uint8)
    np.testing.assert_array_equal(camera.filter_light(bytes_), _expected_light(bytes_ / np.float32(255), pattern))
    np.testing.assert_array_equal(camera.filter_light(2 * rgb, full_scale=2), _expected_light(rgb, pattern))


def test_rgb_light_gives_the_spikes_of_the_light_behind_the_filters():
    camera = sl.Camera.ideal(8, 12).with_mosaic("GRBG")
    rgb = _colors(4, 8, 12)
    colored = sl.Simulator(camera).run(rgb, readouts_per_frame=25)
    filtered = sl.Simulator(camera).run(_expected_light(rgb, "GRBG"), readouts_per_frame=25)
    assert colored == filtered and colored.packed.any()
    one = sl.Simulator(camera).run(rgb[0], 50)
    assert one == sl.Simulator(camera).run(_expected_light(rgb[0], "GRBG"), 50)


def test_clips_of_colors_give_the_spikes_of_the_light_behind_the_filters():
    camera = sl.Camera.ideal(8, 12).with_mosaic("GRBG")
    rgb = np.stack([_colors(4, 8, 12), _colors(4, 8, 12)[::-1]])
    found = sl.simulate_batch(camera, rgb, 25, sequences=range(2))
    light = np.stack([_expected_light(clip, "GRBG") for clip in rgb])
    np.testing.assert_array_equal(found, sl.simulate_batch(camera, light, 25, sequences=range(2)))
    bytes_ = (255 * rgb).astype(np.uint8)
    scaled = sl.simulate_batch(camera, bytes_, 25, sequences=range(2), full_scale=255)
    np.testing.assert_array_equal(scaled, sl.simulate_batch(camera, bytes_, 25, sequences=range(2)))


@pytest.mark.parametrize(("row", "col", "pattern"), [(0, 0, "RGGB"), (0, 3, "GRBG"), (5, 0, "GBRG"), (1, 1, "BGGR")])
def test_a_window_has_the_phase_of_its_first_pixel(row, col, pattern):
    camera = sl.Camera.ideal(16, 16).with_mosaic("RGGB")
    rgb = _colors(2, 8, 10)
    found = sl.simulate_batch(camera, [rgb], 25, sequences=[0], windows=[(row, col)])
    light = _expected_light(rgb, pattern)
    np.testing.assert_array_equal(found, sl.simulate_batch(camera, [light], 25, sequences=[0], windows=[(row, col)]))


def test_a_batch_of_cameras_accepts_colors_only_for_cameras_with_a_mosaic():
    gray = sl.Camera.ideal(16, 16)
    rgb = _colors(2, 16, 16)
    found = sl.simulate_batch([gray.with_mosaic("RGGB"), gray], [rgb, rgb[..., 0]], 25, sequences=range(2))
    assert found.shape == (2, 50, 16, 16)
    with pytest.raises(sl.SpikelaneError, match=r"clips\[1\].*RGB"):
        sl.simulate_batch([gray.with_mosaic("RGGB"), gray], [rgb, rgb], 25, sequences=range(2))


def test_the_program_gives_the_same_spikes(tmp_path, program):
    rgb = _colors(4, 16, 24)
    np.save(tmp_path / "light.npy", rgb)
    arguments = ["--camera", "ideal", "--mosaic", "BGGR", "--size-from-input", "--readouts-per-frame", "25"]
    command = [*program, "simulate", str(tmp_path / "light.npy"), *arguments]
    subprocess.run([*command, "-o", str(tmp_path / "out")], check=True, capture_output=True)
    with sl.open_stream(tmp_path / "out.dat") as stream:
        expected = stream.read_dense()
    # The preset has a random start phase, which the constructor does not have.
    camera = sl.Camera.ideal(16, 24).with_effect("start_phase", share=1).with_mosaic("BGGR")
    found = sl.Simulator(camera).run_dense(rgb, readouts_per_frame=25)
    np.testing.assert_array_equal(found, expected)


def test_rates_of_a_uniform_color_are_demosaiced_to_this_color():
    camera = sl.Camera.ideal(16, 16).with_mosaic("RGGB")
    orange = np.broadcast_to(np.float32([0.5, 0.25, 0.125]), (16, 16, 3))
    for method in ("bilinear", "malvar", "menon"):
        colors = camera.demosaic(camera.filter_light(orange), method=method)
        assert colors.dtype == np.float32 and colors.shape == (16, 16, 3)
        # Menon's border has one-sided filters.
        np.testing.assert_allclose(colors[3:-3, 3:-3], orange[3:-3, 3:-3], atol=1e-5)
    stack = camera.demosaic(np.stack([camera.filter_light(orange)] * 2), color="none")
    assert stack.shape == (2, 16, 16, 3)


def test_gray_cameras_and_wrong_arguments_are_errors():
    gray, rgb = sl.Camera.ideal(8, 8), _colors(1, 8, 8)[0]
    for call in (lambda: gray.filter_light(rgb), lambda: gray.demosaic(rgb[..., 0])):
        with pytest.raises(sl.SpikelaneError, match="no mosaic"):
            call()
    camera = gray.with_mosaic("RGGB")
    with pytest.raises(sl.SpikelaneError, match="RGB light"):
        camera.filter_light(rgb[..., :2])
    with pytest.raises(sl.SpikelaneError, match="matrix"):
        camera.demosaic(rgb[..., 0], color="white")
    with pytest.raises(sl.SpikelaneError, match="without a mosaic"):
        sl.ClipSampler([_colors(2, 8, 8)], gray).item(0)


def test_crops_of_color_clips_start_at_one_phase_of_the_pattern():
    # In red light only the red pixels fire, which are at even rows and columns of every crop.
    red = np.zeros((4, 20, 22, 3), np.float32)
    red[..., 0] = 0.5
    camera = sl.Camera.ideal(20, 22).with_mosaic("RGGB")
    clips = sl.ClipSampler([red] * 12, camera, 10, crop=(8, 8))
    corners = set()
    for index in range(len(clips)):
        item = clips.item(index)
        assert item["light"].shape == (1, 8, 8, 3) and item["spikes"].shape == (40, 8, 8)
        fires = item["spikes"].any(axis=0)
        assert fires[::2, ::2].all() and fires.sum() == 16
        corners.add((item["row"], item["col"]))
    assert len(corners) > 3 and all(row % 2 == 0 and col % 2 == 0 for row, col in corners)
