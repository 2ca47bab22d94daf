"""Bad input: an exception of the fitting class, with found, expected and remedy; nothing has changed."""

from __future__ import annotations

import os
import pickle

import numpy as np
import pytest

import spikelane as sl


def push(camera: sl.Camera, frames: object, *args: object, **kwargs: object) -> sl.SpikelaneError:
    simulator = sl.Simulator(camera)
    before = simulator.state()
    with pytest.raises(sl.SpikelaneError) as raised:
        simulator.push(frames, *args, **kwargs)
    assert simulator.state() == before
    assert raised.value.subject and raised.value.found
    return raised.value


@pytest.mark.parametrize("dtype", ["float64", "int8", "int32", "bool", "complex64", "float16", ">u2", ">f4"])
def test_other_dtypes_are_type_errors_that_name_the_remedy(camera, dtype):
    error = push(camera, np.zeros((12, 20), dtype))
    assert isinstance(error, TypeError) and isinstance(error, ValueError)
    assert "astype" in error.remedy and "uint8" in error.expected


@pytest.mark.parametrize("thing", [None, 3, "light", [[0] * 20] * 12, object(), np.array(["a"])])
def test_things_that_are_no_arrays_are_type_errors(camera, thing):
    with pytest.raises(sl.SpikelaneTypeError):
        sl.Simulator(camera).push(thing)


@pytest.mark.parametrize("shape", [(12,), (20, 12), (1, 1, 12, 20), (11, 20), (2, 12, 21), (0, 0), ()])
def test_other_shapes_are_refused(camera, shape):
    error = push(camera, np.zeros(shape, np.uint8))
    assert error.kind == "usage"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1e-6])
def test_light_that_is_no_light_is_refused_with_its_place(camera, value):
    light = np.full((2, 12, 20), 0.5, np.float32)
    light[1, 3, 4] = value
    error = push(camera, light)
    assert "frame 1" in error.subject and "row 3, col 4" in error.subject


def test_no_frame_at_all_is_refused(camera):
    push(camera, np.zeros((0, 12, 20), np.uint8))


def test_buffers_that_do_not_fit_are_refused(camera, clip):
    small = np.empty((34, 30), np.uint8)
    assert "(35, 30)" in push(camera, clip, 7, out=small).expected.replace("[", "(").replace("]", ")")
    push(camera, clip, 7, out=np.empty((35, 30), np.int8))
    push(camera, clip, 7, out=np.empty((35, 60), np.uint8)[:, ::2])
    push(camera, clip, 7, out=np.asfortranarray(np.empty((35, 30), np.uint8)))
    locked = np.empty((35, 30), np.uint8)
    locked.flags.writeable = False
    push(camera, clip, 7, out=locked)
    push(camera, clip, 7, out=[0])
    both = np.zeros((12, 20), np.uint8)
    ideal = sl.Camera.ideal(1, 160)
    light = np.zeros((1, 160), np.uint8)
    with pytest.raises(sl.SpikelaneError):
        sl.Simulator(ideal).push(light, 8, out=light.reshape(8, 20))
    assert both.sum() == 0


def test_numbers_out_of_range_are_refused(camera, clip):
    with pytest.raises((sl.SpikelaneError, OverflowError)):
        sl.Simulator(camera).push(clip, -1)
    push(camera, clip, 0)
    push(camera, clip, 7, readouts=36)
    push(camera, clip, insertion="cubic")
    push(camera, clip, 2**62)
    with pytest.raises(OverflowError):
        sl.Simulator(camera, seed=-1)
    for threads in (0, 100_000):
        with pytest.raises(sl.SpikelaneError, match="threads"):
            sl.Simulator(camera, threads=threads)
    for light in (np.nan, -1.0, np.inf):
        with pytest.raises(sl.SpikelaneError, match="greatest light"):
            sl.Simulator(camera, greatest_light=light)
    with pytest.raises(sl.SpikelaneError, match="backend"):
        sl.Simulator(camera, backend="mmx")


def test_an_error_has_its_parts_as_fields_and_can_be_pickled():
    with pytest.raises(sl.SpikelaneError) as raised:
        sl.Camera.preset("phisical")
    error = raised.value
    assert (error.kind, error.subject, error.found) == ("config", "preset", '"phisical"')
    assert "physical" in error.expected
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and again.__dict__ == error.__dict__ and str(again) == str(error)


def test_the_systems_refusals_are_what_python_calls_them(tmp_path):
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


def test_states_of_others_are_refused(camera, clip):
    state = sl.Simulator(camera, seed=1).state()
    others = [
        sl.Simulator(camera, seed=2),
        sl.Simulator(camera, seed=1, greatest_light=1.5),
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


def test_a_batch_names_the_clip_at_fault(camera, clip):
    batch = np.stack([clip] * 3).astype(np.float32) / 255
    batch[2, 1, 5, 6] = np.nan
    for threads in (1, 2):
        with pytest.raises(sl.SpikelaneError, match=r"clips\[2\].*frame 1.*row 5, col 6"):
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
def test_a_fork_goes_on_with_its_copy(clip, threads):
    camera = sl.Camera.preset("physical")
    light = np.tile(clip[0], (21, 20))[:250, :400]
    simulator = sl.Simulator(camera, threads=threads)
    simulator.push(light, 3)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            found = simulator.push(light, 5)
            batch = sl.simulate_batch(camera, [light[None]] * 3, sequences=range(3), threads=2)
            os.write(write, bytes([int(found.any()), int(batch.any()), int(found.sum() % 251)]))
        finally:
            os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert os.read(read, 3) == bytes([1, 1, int(simulator.push(light, 5).sum() % 251)])
