"""Wrong calls of a beginner: each message names the value, the expected value and the call that mends it."""

from __future__ import annotations

import inspect
from types import SimpleNamespace

import numpy as np
import pytest

import spikelane as sl


class Tensor:
    """An object with the methods of a torch tensor that the package uses."""

    def __init__(self, array: np.ndarray, device: str = "cpu", requires_grad: bool = False) -> None:
        self.array, self.device, self.requires_grad = array, SimpleNamespace(type=device), requires_grad
        self.dtype = array.dtype

    def __array__(self, dtype: object = None, copy: bool | None = None) -> np.ndarray:
        if self.requires_grad or self.device.type != "cpu":
            raise RuntimeError("Can't call numpy()")
        return self.array

    def numpy(self) -> np.ndarray:
        return self.array


class Exporter:
    """An array of another library. NumPy before version 2 reads the methods of the type only."""

    def __init__(self, array: np.ndarray, device: tuple[int, int]) -> None:
        self.array, self.device = array, device

    def __dlpack__(self, **options: object) -> object:
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.device


class Image:
    """An object with the methods of a Pillow image that the package uses."""

    mode = "RGB"

    def getbands(self) -> tuple[str, ...]:
        return ("R", "G", "B")


GRAY = np.full((48, 64), 51, np.uint8)
FLOAT = GRAY.astype(np.float32) / 255
CAMERA = sl.Camera.preset("physical").with_shape(48, 64)
WEIGHTS = "[0.2126, 0.7152, 0.0722]"
CLIPS = np.full((2, 3, 48, 64), 51, np.uint8)
USUAL = (sl.SpikelaneError, ValueError)
KIND = (sl.SpikelaneTypeError, TypeError)
MISSING = (sl.SpikelaneFileNotFoundError, FileNotFoundError)

NAMES = {
    "sl": sl,
    "np": np,
    "camera": CAMERA,
    "gray": GRAY,
    "clips": CLIPS,
    "Tensor": Tensor,
    "Image": Image,
    "simulator": lambda: sl.Simulator(CAMERA),
    "spikes": lambda: sl.Simulator(CAMERA).run(GRAY, 10),
}

# (code, exceptions that it raises, message)
CALLS = [
    (
        "simulator.run(gray.astype('float32'), 100)",
        USUAL,
        "light: found the value 51 in frame 0, expected light with full scale at 1.0; "
        "set full_scale= to 255 if 255 is full scale, or set full_scale= to 1 if the light is this bright",
    ),
    (
        "simulator.run(gray / 255, 100)",
        KIND,
        "light: found an array of float64, expected a NumPy array of uint8, uint16 or float32; "
        "pass light.astype(numpy.float32) if 1.0 is full scale, or else full_scale=, for example full_scale=255",
    ),
    (
        "simulator.run(gray.astype('int64'), 100)",
        KIND,
        "light: found an array of int64, expected a NumPy array of uint8, uint16 or float32; "
        "pass light.astype(numpy.uint8) if the values are 0 to 255, or else full_scale=, for example full_scale=4095",
    ),
    (
        "simulator.run(np.where(np.eye(48, 64) > 0, -0.5, 0.2).astype('float32'), 100)",
        USUAL,
        "light[0, 0]: found -0.5, expected light that is finite and not negative; clip it: numpy.maximum(light, 0)",
    ),
    (
        "simulator.run(np.stack([gray] * 3, axis=-1), 100)",
        USUAL,
        "light: found shape (48, 64, 3): an RGB image?, expected (48, 64) or (N, 48, 64), the size of the camera; "
        f"weight its colors: (light @ {WEIGHTS}).astype(light.dtype)",
    ),
    (
        "simulator.run(np.stack([gray] * 3), 100)",
        USUAL,
        "readouts_per_frame: found none, expected a number for 3 frames of light (N, H, W); pass the readouts that each "
        "frame lasts, for example readouts_per_frame=20; for a color image (3, H, W), pass "
        f"numpy.tensordot({WEIGHTS}, light, 1).astype(light.dtype)",
    ),
    (
        "simulator.run(gray.T, 100)",
        USUAL,
        "light: found shape (64, 48): (width, height)?, expected (48, 64) or (N, 48, 64), the size of the camera; "
        "swap the axes: light.swapaxes(-1, -2)",
    ),
    (
        "simulator.run(gray.tolist(), 100)",
        KIND,
        "light: found a list, expected a NumPy array of uint8, uint16 or float32; "
        "pass numpy.asarray(light, numpy.uint8) for codes of 0 to 255, or numpy.float32 for light of 0 to 1",
    ),
    (
        "simulator.run(Tensor(gray, 'cuda', True), 100)",
        KIND,
        "light: found a Tensor with requires_grad and device 'cuda', expected a NumPy array of uint8, uint16 or float32, "
        "or a tensor on the CPU; call light.detach().cpu()",
    ),
    (
        "simulator.run(Image(), 100)",
        KIND,
        "light: found an Image of mode 'RGB', expected a NumPy array of uint8, uint16 or float32; pass "
        '(numpy.asarray(light.convert("L"), numpy.float32) / 255) ** 2.2, which is linear light',
    ),
    (
        "simulator.run(spikes, 100)",
        KIND,
        "light: found a SpikeFrames, which contains spikes, expected a NumPy array of uint8, uint16 or float32; "
        "pass the light of the scene",
    ),
    (
        "simulator.run(gray, 1.5)",
        KIND,
        "readouts: found 1.5 (a float), expected an integer, 0 or more; pass readouts=int(...)",
    ),
    (
        "simulator.run(gray, -100)",
        USUAL,
        "readouts: found -100, expected an integer, 0 or more; pass the number of readouts, for example 400",
    ),
    (
        "simulator.run(gray, '100')",
        KIND,
        "readouts: found '100' (a str), expected an integer, 0 or more; pass a number without quotes",
    ),
    (
        "simulator.run(gray)",
        USUAL,
        "readouts: found none, expected a number for one frame of light (H, W); "
        "pass readouts, for example run(light, 1000)",
    ),
    (
        "simulator.run(gray, readout=100)",
        KIND,
        'Simulator.run: found an argument "readout", expected light, readouts, readouts_per_frame, interpolation, '
        'full_scale, progress; did you mean "readouts"?',
    ),
    (
        "simulator.run(gray, 100, interpolation='liner')",
        USUAL,
        'interpolation: found \'liner\' (a str), expected "linear", "hold" or "flow"; did you mean "linear"?',
    ),
    (
        "sl.Simulator('physicl')",
        KIND,
        "camera: found 'physicl' (a str), expected a Camera; pass spikelane.Camera.preset(\"physical\")",
    ),
    (
        "sl.Simulator(sl.CameraDistribution())",
        KIND,
        "camera: found a CameraDistribution, expected a Camera; draw a camera: cameras.draw(seed)",
    ),
    (
        "sl.Simulator(camera, threads=0)",
        USUAL,
        "threads: found 0, expected an integer from 1 to 4096; pass the number of cores",
    ),
    (
        "sl.Camera.load('no.toml')",
        MISSING,
        "no.toml: found no such file or folder, expected an existing file or folder; check the path; relative paths start "
        "at ",
    ),
    (
        "sl.open_stream('no.dat', height=48, width=64)",
        MISSING,
        "no.dat: found no such file or folder, expected an existing file or folder; check the path; relative paths start "
        "at ",
    ),
    (
        "simulator.fill(gray, np.zeros((10, 384)))",
        KIND,
        "out: found an array of float64, expected a NumPy array of uint8; "
        "pass numpy.empty((readouts, 384), numpy.uint8)",
    ),
    (
        "simulator.fill(gray, np.frombuffer(bytes(3840), np.uint8).reshape(10, 384))",
        USUAL,
        "out: found a read-only array, expected an array that can be written; pass out.copy()",
    ),
    (
        "sl.tfp(spikes.to_dense(), 48, 64, at=5, half_window=2)",
        USUAL,
        "spikes: found shape (10, 48, 64): dense spikes?, expected (..., readouts, 384) for 64x48 pixels (W x H); "
        "pass SpikeFrames.from_dense(spikes)",
    ),
    (
        "sl.tfp(spikes.packed, at=5, half_window=2)",
        USUAL,
        "spikes: found shape (10, 384), expected SpikeFrames, or packed spikes together with height and width; "
        "pass SpikeFrames.from_packed(spikes, height, width)",
    ),
    (
        "sl.SpikeFrames.from_dense(spikes.packed)",
        USUAL,
        "array: found shape (10, 384), expected (readouts, height, width); pass array[None] for a single frame, or "
        "SpikeFrames.from_packed(array, height, width) for packed spikes",
    ),
    (
        "sl.SpikeFrames.from_packed(spikes.to_dense(), 48, 64)",
        USUAL,
        "packed: found shape (10, 48, 64): dense spikes?, expected (readouts, 384) for 64x48 pixels (W x H); "
        "pass SpikeFrames.from_dense(packed)",
    ),
    (
        "sl.SpikeFrames.from_dense(spikes.to_dense()[:, :, ::2])",
        USUAL,
        "array: found an array with gaps or another order, expected a C-contiguous array; "
        "pass numpy.ascontiguousarray(array)",
    ),
    (
        "sl.simulate_batch(camera, clips, 5, sequences=range(3))",
        USUAL,
        "sequences: found 3, expected 2, one for each clip; pass as many as clips",
    ),
    (
        "sl.simulate_batch(camera, clips, -5, sequences=range(2))",
        USUAL,
        "readouts_per_frame: found -5, expected an integer, 1 or more; "
        "pass the readouts that each frame lasts, for example 20",
    ),
    (
        "sl.ClipSampler(clips, camera, 5, crop=32)",
        KIND,
        "crop: found 32 (an int), expected a tuple (height, width); pass crop=(32, 32)",
    ),
    (
        "sl.ClipSampler(clips.astype('float32'), camera, 5)[1]",
        USUAL,
        "clips[1][1:3]: found the value 51 in frame 0, expected light with full scale at 1.0; "
        "set full_scale= to 255 if 255 is full scale, or set full_scale= to 1 if the light is this bright",
    ),
]


def evaluate(code: str) -> object:
    """Evaluates a call with fresh simulators and spikes."""
    made = {name: value() if name in ("simulator", "spikes") else value for name, value in NAMES.items()}
    return eval(code, made)


@pytest.mark.parametrize(("code", "exceptions", "message"), CALLS, ids=[call[0] for call in CALLS])
def test_a_wrong_call_gets_a_message_with_its_remedy(code, exceptions, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sl.SpikelaneError) as raised:
        evaluate(code)
    assert all(isinstance(raised.value, kind) for kind in exceptions)
    assert str(raised.value).startswith(message), str(raised.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda light: sl.Simulator(CAMERA).run(light[0, 0], 9),
        lambda light: sl.Simulator(CAMERA).run_dense(light[0], readouts_per_frame=3),
        lambda light: sl.Simulator(CAMERA).fill(light[0, 0], np.empty((9, 384), np.uint8)),
        lambda light: sl.simulate_batch(CAMERA, light, 3, sequences=range(2)),
        lambda light: sl.simulate_batch(CAMERA, light, 3, sequences=range(2), copy=False, dense=False),
        lambda light: sl.light_at(light[0], [1], 3),
        lambda light: sl.ClipSampler(light, CAMERA, 3)[1],
        lambda light: sl.ClipSampler(list(light), sl.CameraDistribution(), 3, crop=(8, 8))[1],
    ],
)
def test_every_call_that_takes_light_rejects_codes_as_floats(call):
    with pytest.raises(sl.SpikelaneError, match=r"with full scale at 1\.0; set full_scale= to 255"):
        call(CLIPS.astype(np.float32))


def test_full_scale_divides_the_light():
    expected = sl.Simulator(CAMERA).run(np.float32(51 / 255) * np.ones((48, 64), np.float32), 200)
    for dtype in ("uint8", "int64", "float32", "float64"):
        assert sl.Simulator(CAMERA).run(GRAY.astype(dtype), 200, full_scale=255) == expected, dtype
    np.testing.assert_array_equal(sl.light_at(CLIPS[0], [0], full_scale=102), np.full((1, 48, 64), 0.5, np.float32))
    batch = sl.simulate_batch(CAMERA, CLIPS.astype(int), 5, sequences=range(2), full_scale=255)
    sampler = sl.ClipSampler(CLIPS.astype(int), CAMERA, 5, full_scale=255)
    assert batch.shape == sampler[0]["spikes"][None].repeat(2, 0).shape
    for wrong in (0, -1, np.nan, "255"):
        with pytest.raises(sl.SpikelaneError, match="full_scale"):
            sl.Simulator(CAMERA).run(GRAY, 5, full_scale=wrong)


def test_light_that_is_mostly_clipped_warns_and_lamps_do_not(recwarn):
    with pytest.warns(
        sl.SpikelaneWarning, match=r"light above 1 in most of a frame, expected at most max_light=1,.*255"
    ):
        sl.Simulator(CAMERA).run(np.full((48, 64), 20, np.float32), 5)
    with pytest.warns(sl.SpikelaneWarning, match="most of a frame"):
        sl.simulate_batch(CAMERA, CLIPS.astype(np.float32), sequences=range(2), full_scale=10)
    recwarn.clear()
    lamps = np.where(np.eye(48, 64) > 0, 4000, 0.2).astype(np.float32)
    sl.Simulator(CAMERA).run(lamps, 5)
    sl.Simulator(CAMERA).run(np.ones((48, 64), np.float32), 5)
    assert not recwarn.list


def test_a_mask_as_light_warns_and_a_dark_frame_does_not(recwarn):
    with pytest.warns(sl.SpikelaneWarning, match=r"integers of 0 and 1 only, .* pass full_scale=1 if 1 is full scale"):
        sl.Simulator(CAMERA).run((GRAY > 0).astype(np.uint8), 5)
    recwarn.clear()
    sl.Simulator(CAMERA).run(np.zeros((48, 64), np.uint8), 5)
    sl.Simulator(CAMERA).run(np.zeros((48, 64), np.float32), 5)
    assert not recwarn.list


def test_a_tensor_on_the_cpu_is_light_and_spikes():
    expected = sl.Simulator(CAMERA).run(GRAY, 20)
    assert sl.Simulator(CAMERA).run(Tensor(GRAY), 20) == expected
    assert sl.SpikeFrames.from_dense(Tensor(expected.to_dense())) == expected
    assert sl.ClipSampler([Tensor(clip) for clip in CLIPS], CAMERA)[0]["spikes"].shape == (3, 48, 64)
    with pytest.raises(sl.SpikelaneTypeError, match=r"pass out\.numpy\(\)"):
        sl.Simulator(CAMERA).fill(GRAY, Tensor(np.empty((20, 384), np.uint8)))


def test_an_array_of_another_library_is_read_through_dlpack():
    assert sl.Simulator(CAMERA).run(Exporter(GRAY, GRAY.__dlpack_device__()), 20) == sl.Simulator(CAMERA).run(GRAY, 20)
    with pytest.raises(sl.SpikelaneTypeError, match=r"on another device.* copy it to the CPU first"):
        sl.Simulator(CAMERA).run(Exporter(GRAY, (2, 0)), 20)


@pytest.mark.parametrize(("axis", "remedy"), [(1, r"array\[:, 0\]"), (3, r"array\[\.\.\., 0\]")])
def test_dense_spikes_with_a_channel_axis_name_the_index(axis, remedy):
    with pytest.raises(sl.SpikelaneError, match=remedy):
        sl.SpikeFrames.from_dense(np.expand_dims(np.zeros((5, 4, 6), np.uint8), axis))


def test_a_torch_tensor_is_light_and_its_state_names_the_call():
    torch = pytest.importorskip("torch")
    expected = sl.Simulator(CAMERA).run(GRAY, 20)
    assert sl.Simulator(CAMERA).run(torch.from_numpy(GRAY), 20) == expected
    assert sl.Simulator(CAMERA).run(torch.from_numpy(GRAY).long(), 20, full_scale=255).readouts == 20
    for tensor, call in (
        (torch.zeros(48, 64, requires_grad=True), r"with requires_grad.* call light\.detach\(\)"),
        (torch.zeros(48, 64, dtype=torch.bfloat16), r"Tensor of torch\.bfloat16.* call light\.float\(\)"),
        (torch.zeros(48, 64, device="meta"), r"device 'meta'.* call light\.cpu\(\)"),
        (torch.zeros(48, 64, dtype=torch.int64), r"array of int64.* light\.astype"),
    ):
        with pytest.raises(sl.SpikelaneTypeError, match=call):
            sl.Simulator(CAMERA).run(tensor, 20)


def test_the_data_sets_of_torch_have_named_parameters_and_a_repr():
    pytest.importorskip("torch")
    from spikelane.torch import SpikeClips, SpikeClipStream

    sampler = inspect.signature(sl.ClipSampler).parameters
    for kind in (SpikeClips, SpikeClipStream):
        parameters = inspect.signature(kind).parameters
        assert [p for p in sampler.values() if parameters[p.name].default != p.default] == []
        with pytest.raises(TypeError, match="bits"):
            kind(CLIPS, CAMERA, bits=False)
        data = kind(CLIPS, CAMERA, 5, crop=(8, 8), seed=3)
        data.set_epoch(2)
        for part in (f"spikelane.torch.{kind.__name__}", "epoch 2", "2 clips", "crop=(8, 8)", "seed=3"):
            assert part in repr(data), repr(data)


def test_unaligned_light_is_read(camera):
    raw = np.zeros(12 * 20 * 4 + 1, np.uint8)
    light = raw[1:].view(np.float32).reshape(12, 20)
    light[:] = 0.3
    assert not light.flags.aligned
    assert sl.Simulator(camera).run(light, 50) == sl.Simulator(camera).run(light.copy(), 50)


def test_every_public_class_has_a_repr_of_its_own(tmp_path):
    path = tmp_path / "a.dat"
    spikes = sl.Simulator(CAMERA).run(GRAY, 10)
    sl.write_stream(path, spikes)
    sampler = sl.ClipSampler(CLIPS, CAMERA, 5, crop=(8, 8), seed=3)
    simulator = sl.Simulator(CAMERA, seed=2, sequence=4)
    with sl.open_stream(path) as stream:
        for thing, parts in (
            (simulator, ["physical", "48 x 64", "seed=2", "sequence=4", "next readout 0"]),
            (spikes, ["10 readouts", "48 x 64"]),
            (stream, ["a.dat", "10 readouts", "48 x 64"]),
            (sampler, ["2 clips", "crop=(8, 8)", "seed=3", "physical"]),
            (sl.CameraDistribution(), ["13 ranges", "sensor.thresholds_at_full_scale"]),
            (sl.Scene(11, 24, 32), ["seed 11", "24 x 32"]),
        ):
            text = repr(thing)
            assert text.startswith("<spikelane.") and all(part in text for part in parts), text


def test_every_message_names_what_to_type():
    for _, exceptions, message in CALLS:
        assert ": found " in message
        assert "; " in message and (exceptions is MISSING or ", expected " in message)


def main() -> None:
    """Prints the table of calls and messages."""
    for code, _, _ in CALLS:
        try:
            evaluate(code)
        except sl.SpikelaneError as error:
            print(f"{code}\n    {type(error).__name__}: {error}")


if __name__ == "__main__":
    main()


def test_light_outside_the_range_of_the_camera_warns_once_per_recording(recwarn):
    white, black = np.full((48, 64), 255, np.uint8), np.zeros((48, 64), np.uint8)
    camera = sl.Camera.preset("ideal").with_shape(48, 64)
    simulator = sl.Simulator(camera)
    with pytest.warns(sl.SpikelaneWarning, match="100 % of the pixel readouts saturated"):
        simulator.run(white, 64)
    recwarn.clear()
    simulator.run(white, 64)
    assert not recwarn.list
    simulator.restart(sequence=1)
    with pytest.warns(sl.SpikelaneWarning, match="no spike in 40 readouts"):
        simulator.run(black, 40)
    with pytest.warns(sl.SpikelaneWarning, match="spikes of a clip: found 100 %"):
        sl.simulate_batch(camera, np.stack([white, white])[None], 20, sequences=[0])


def test_16_bit_light_with_values_of_12_bits_warns():
    with pytest.warns(sl.SpikelaneWarning, match="no value above 4095, .* pass full_scale=4095 if the values have 12"):
        sl.Simulator(CAMERA).run(np.full((48, 64), 4000, np.uint16), 5)
