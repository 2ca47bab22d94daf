"""Invalid input raises the matching exception with found, expected and remedy, and changes no state."""

from __future__ import annotations

import os
import pickle

import numpy as np
import pytest

import spikelane as sl


def error_of(camera: sl.Camera, method: str, *args: object, **kwargs: object) -> sl.SpikelaneError:
    """Returns the error of a simulator call, and asserts that the call did not change the simulator."""
    simulator = sl.Simulator(camera)
    before = simulator.state()
    with pytest.raises(sl.SpikelaneError) as raised:
        getattr(simulator, method)(*args, **kwargs)
    assert simulator.state() == before
    assert raised.value.subject and raised.value.found
    return raised.value


@pytest.mark.parametrize("dtype", ["float64", "int8", "int32", "bool", "complex64", "float16", ">u2", ">f4"])
def test_other_dtypes_are_type_errors_that_name_the_remedy(camera, dtype):
    error = error_of(camera, "run", np.zeros((12, 20), dtype), 1)
    assert isinstance(error, TypeError) and isinstance(error, ValueError)
    assert "astype" in error.remedy and "uint8" in error.expected


@pytest.mark.parametrize("thing", [None, 3, "light", [[0] * 20] * 12, object(), np.array(["a"])])
def test_objects_other_than_arrays_are_type_errors(camera, thing):
    with pytest.raises(sl.SpikelaneTypeError):
        sl.Simulator(camera).run(thing, 1)


@pytest.mark.parametrize("shape", [(12,), (20, 12), (1, 1, 12, 20), (11, 20), (2, 12, 21), (0, 0), ()])
def test_wrong_shapes_are_rejected(camera, shape):
    error = error_of(camera, "run", np.zeros(shape, np.uint8), 1)
    assert error.kind == "usage" and error.subject == "light"
    assert str(shape) in error.found


@pytest.mark.parametrize("shape", [(12, 20, 3), (12, 20, 4), (5, 12, 20, 3)])
def test_the_error_for_color_images_names_the_conversion(camera, shape):
    error = error_of(camera, "run", np.zeros(shape, np.uint8), 1)
    assert error.found == f"shape {shape}: an RGB image?" and "@ [0.2126, 0.7152, 0.0722]" in error.remedy


@pytest.mark.parametrize("method", ["run", "run_dense"])
def test_the_number_of_readouts_follows_the_shape_of_the_light(camera, clip, method):
    error = error_of(camera, method, clip[0])
    assert error.subject == "readouts" and "run(light, 1000)" in error.remedy
    for arguments in ((clip,), (clip, 20)):
        error = error_of(camera, method, *arguments)
        assert error.subject == "readouts_per_frame" and "readouts_per_frame=20" in error.remedy
    error = error_of(camera, method, clip[0], 10, readouts_per_frame=2)
    assert (error.subject, error.found) == ("readouts_per_frame", "2") and "(H, W)" in error.expected


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1e-6])
def test_the_error_for_invalid_light_names_the_pixel(camera, value):
    light = np.full((2, 12, 20), 0.5, np.float32)
    light[1, 3, 4] = value
    error = error_of(camera, "run", light, readouts_per_frame=1)
    assert error.subject == "light[1, 3, 4]" and "light" in error.remedy


def test_light_without_frames_is_rejected(camera):
    error = error_of(camera, "run", np.zeros((0, 12, 20), np.uint8), readouts_per_frame=1)
    assert error.subject == "light"


def test_buffers_of_the_wrong_size_are_rejected(camera, clip):
    def refused(out: object) -> sl.SpikelaneError:
        return error_of(camera, "fill", clip, out, readouts_per_frame=7)

    for shape in ((35, 31), (35,), (35, 12, 20)):
        error = refused(np.empty(shape, np.uint8))
        assert error.subject == "out" and str(shape) in error.found and "(readouts, 30)" in error.expected
    assert "at most 35" in refused(np.empty((36, 30), np.uint8)).expected
    refused(np.empty((35, 30), np.int8))
    refused(np.empty((35, 60), np.uint8)[:, ::2])
    refused(np.asfortranarray(np.empty((35, 30), np.uint8)))
    locked = np.empty((35, 30), np.uint8)
    locked.flags.writeable = False
    refused(locked)
    refused([0])
    dense = np.empty((34, 12, 20), np.uint8)
    error = error_of(camera, "run_dense", clip, readouts_per_frame=7, out=dense)
    assert error.subject == "out" and "(35, 12, 20)" in error.expected
    light = np.zeros((1, 160), np.uint8)
    with pytest.raises(sl.SpikelaneError, match="out"):
        sl.Simulator(sl.Camera.ideal(1, 160)).fill(light, light.reshape(8, 20))
    assert light.sum() == 0


def test_numbers_out_of_range_are_rejected(camera, clip):
    for number in (-1, 0):
        assert error_of(camera, "run", clip, readouts_per_frame=number).subject == "readouts_per_frame"
    assert error_of(camera, "run", clip[0], -1).subject == "readouts"
    assert "at most 35" in error_of(camera, "run", clip, 36, readouts_per_frame=7).expected
    assert error_of(camera, "run", clip[0], 1, interpolation="cubic").subject == "interpolation"
    error_of(camera, "run", clip, readouts_per_frame=2**62)
    with pytest.raises(sl.SpikelaneError, match="seed: found -1"):
        sl.Simulator(camera, seed=-1)
    for threads in (0, 100_000):
        with pytest.raises(sl.SpikelaneError, match="threads"):
            sl.Simulator(camera, threads=threads)
    for light in (np.nan, -1.0, np.inf):
        with pytest.raises(sl.SpikelaneError, match="max light"):
            sl.Simulator(camera, max_light=light)
    with pytest.raises(sl.SpikelaneError, match="backend"):
        sl.Simulator(camera, backend="mmx")


def test_an_error_has_fields_and_can_be_pickled():
    with pytest.raises(sl.SpikelaneError) as raised:
        sl.Camera.preset("phisical")
    error = raised.value
    assert (error.kind, error.subject, error.found) == ("config", "preset", '"phisical"')
    assert "physical" in error.expected
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and again.__dict__ == error.__dict__ and str(again) == str(error)


def test_system_errors_derive_from_the_matching_python_errors(tmp_path):
    with pytest.raises(FileNotFoundError) as raised:
        sl.open_stream(tmp_path / "no.dat", height=2, width=8)
    assert raised.value.errno == 2 and "no.dat" in raised.value.subject
    with pytest.raises(FileNotFoundError):
        sl.Camera.load(tmp_path / "no.toml")
    with pytest.raises(sl.SpikelaneError, match="a directory"):
        sl.open_stream(tmp_path, height=2, width=8)
    spikes = np.zeros((3, 2), np.uint8)
    sl.write_stream(tmp_path / "a.dat", spikes, height=2, width=8)
    with pytest.raises(FileExistsError) as raised:
        sl.write_stream(tmp_path / "a.dat", spikes, height=2, width=8)
    assert isinstance(raised.value, sl.SpikelaneError) and raised.value.kind == "exists"


def test_states_of_other_simulators_are_rejected(camera, clip):
    state = sl.Simulator(camera, seed=1).state()
    others = [
        sl.Simulator(camera, seed=2),
        sl.Simulator(camera, seed=1, max_light=1.5),
        sl.Simulator(camera.with_effect("prnu", sigma=0.03), seed=1),
    ]
    for other in others:
        with pytest.raises(sl.SpikelaneError, match="saved state"):
            other.restore(state)
    same = sl.Simulator(camera, seed=1)
    for bytes_ in (b"", b"spkrun01", state[:-1], state + b"x", b"spkrun99" + state[8:], b"\0" * len(state)):
        with pytest.raises(sl.SpikelaneError):
            same.restore(bytes_)
    same.restore(state)


def test_the_error_of_a_batch_names_the_wrong_clip(camera, clip):
    batch = np.stack([clip] * 3).astype(np.float32) / 255
    batch[2, 1, 5, 6] = np.nan
    for threads in (1, 2):
        with pytest.raises(sl.SpikelaneError, match=r"clips\[2\]\[1, 5, 6\]: found NaN"):
            sl.simulate_batch(camera, batch, sequences=range(3), threads=threads)
    good = np.stack([clip] * 3)
    wrong = [
        {"sequences": range(2)},
        {"sequences": [0, 1, -1]},
        {"sequences": [0, 1, 2**64]},
        {"sequences": [0.5, 1, 2]},
        {"sequences": 3},
        {"sequences": range(3), "windows": [(0, 0), (0, 0)]},
        {"sequences": range(3), "windows": [(0, 0), (0, 1), (0, 0)]},
        {"sequences": range(3), "windows": [0, 0, 0]},
        {"sequences": range(3), "camera_seed": [1]},
        {"sequences": range(3), "threads": 0},
        {"sequences": range(3), "out": np.empty((3, 5, 12, 19), np.uint8)},
    ]
    for arguments in wrong:
        with pytest.raises(sl.SpikelaneError):
            sl.simulate_batch(camera, good, **arguments)
    with pytest.raises(sl.SpikelaneTypeError):
        sl.simulate_batch("physical", good, sequences=range(3))
    with pytest.raises(sl.SpikelaneTypeError):
        sl.simulate_batch([camera, camera, None], good, sequences=range(3))
    with pytest.raises(sl.SpikelaneError):
        sl.simulate_batch([camera, camera], good, sequences=range(3))
    with pytest.raises(sl.SpikelaneError):
        sl.simulate_batch(camera, clip, sequences=range(5))
    with pytest.raises(sl.SpikelaneError):
        sl.simulate_batch(camera, [], sequences=[])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize("threads", [1, 3])
def test_a_forked_child_continues_with_its_copy(clip, threads):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    simulator = sl.Simulator(camera, threads=threads)
    simulator.run(light, 3)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            found = simulator.run(light, 5).packed
            batch = sl.simulate_batch(camera, [light[None]] * 3, sequences=range(3), threads=2)
            os.write(write, bytes([int(found.any()), int(batch.any()), int(found.sum() % 251)]))
        finally:
            os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert os.read(read, 3) == bytes([1, 1, int(simulator.run(light, 5).packed.sum() % 251)])


def test_an_error_names_python_parameters(tmp_path):
    (tmp_path / "bare.dat").write_bytes(bytes(96))
    with pytest.raises(sl.SpikelaneError) as raised:
        sl.open_stream(tmp_path / "bare.dat")
    assert "width=" in raised.value.remedy and "height=" in str(raised.value)
