"""Child processes by fork, spawn and forkserver, arrays that change during a call, and Ctrl-C."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import spikelane as sl

HEIGHT, WIDTH = 24, 32
# A child process runs this long only if it hangs.
PATIENCE_S = 300

posix = pytest.mark.skipif(os.name != "posix", reason="processes and signals as POSIX has them")


def _simulator(threads: int = 1) -> sl.Simulator:
    return sl.Simulator(sl.Camera.preset("physical").with_shape(HEIGHT, WIDTH), seed=7, threads=threads)


def _light() -> np.ndarray:
    return np.full((HEIGHT, WIDTH), 90, np.uint8)


def _everything(folder: str) -> None:
    """Calls every function that uses several threads."""
    # The sensor is large enough for several bands and tiles.
    camera = sl.Camera.preset("physical").with_shape(72, 128)
    light = np.full((72, 128), 90, np.uint8)
    spikes = sl.Simulator(camera, threads=2).run(light, 300)
    sl.measure(spikes)
    path = Path(folder) / f"{os.getpid()}.dat"
    sl.write_stream(path, spikes, readout_hz=20_000)
    sl.measure(path)
    clips = np.stack([light[None], light[None]])
    sl.simulate_batch(camera, clips, 20, sequences=range(2), threads=2)
    scene = sl.Scene(3, 32, 48)
    scene.render(0.1, threads=2)
    scene.clip(0.1, 2, 100.0, threads=2)
    sl.tfp(spikes, at=100, half_window=20)


@posix
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_children_run_all_parallel_work_after_the_parent(tmp_path):
    _everything(str(tmp_path))
    context = multiprocessing.get_context("fork")
    children = [context.Process(target=_everything, args=(str(tmp_path),)) for _ in range(2)]
    for child in children:
        child.start()
    for child in children:
        child.join(PATIENCE_S)
    codes = [child.exitcode for child in children]
    for child in children:
        child.kill()
    assert codes == [0, 0]


def _mean_rate(spikes: sl.SpikeFrames) -> float:
    return sl.measure(spikes)["mean-rate"].value


@posix
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_pool_of_three_measures(tmp_path):
    spikes = _simulator().run(_light(), 400)
    expected = _mean_rate(spikes)
    with multiprocessing.get_context("fork").Pool(3) as pool:
        assert pool.map_async(_mean_rate, [spikes] * 6).get(PATIENCE_S) == [expected] * 6


def _used(objects: tuple[sl.Stream, sl.Scene, sl.Simulator]) -> list[np.ndarray]:
    stream, scene, simulator = objects
    return [stream[3:9], scene.render(0.2).light, simulator.run(_light(), 10)]


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_other_processes_can_use_a_stream_a_scene_and_a_simulator(method, tmp_path):
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {method} here")
    path = tmp_path / "a.dat"
    simulator = _simulator()
    sl.write_stream(path, simulator.run(_light(), 20))
    scene = sl.Scene(5, 32, 48, lighting="dusk", duration_s=1.0, vehicles=2)
    objects = (sl.open_stream(path), scene, simulator)
    with multiprocessing.get_context(method).Pool(2) as pool:
        found = pool.map_async(_used, [objects, objects]).get(PATIENCE_S)
    expected = _used(objects)
    for arrays in found:
        for array, right in zip(arrays, expected, strict=True):
            np.testing.assert_array_equal(array, right)


class _Readouts:
    """A typical Dataset of a user, which contains an open stream."""

    def __init__(self, path: Path) -> None:
        self.stream = sl.open_stream(path)

    def __len__(self) -> int:
        return len(self.stream)

    def __getitem__(self, index: int) -> np.ndarray:
        return self.stream[index]


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_a_dataset_with_an_open_stream_works_in_workers_of_torch(method, tmp_path):
    data = pytest.importorskip("torch.utils.data")
    path = tmp_path / "a.dat"
    packed = _simulator().run(_light(), 12).packed
    sl.write_stream(path, packed, height=HEIGHT, width=WIDTH)
    loader = data.DataLoader(_Readouts(path), batch_size=4, num_workers=2, multiprocessing_context=method)
    np.testing.assert_array_equal(np.concatenate([batch.numpy() for batch in loader]), packed)


def test_a_pickled_simulator_continues_with_the_same_bits():
    simulator = sl.Simulator(
        sl.Camera.preset("physical").with_shape(HEIGHT, WIDTH), seed=2, camera_seed=3, threads=2, max_light=2.0
    )
    simulator.run(_light(), 33)
    simulator.restart(sequence=9)
    simulator.run(_light(), 17)
    for other in (pickle.loads(pickle.dumps(simulator)), copy.deepcopy(simulator)):
        assert (other.seeds, other.next_readout) == ((3, 2, 9), 17)
        before = simulator.state()
        assert other.run(_light(), 50) == simulator.run(_light(), 50)
        simulator.restore(before)


def test_a_pickled_stream_keeps_its_options_and_a_closed_stream_is_rejected(tmp_path, monkeypatch):
    packed = _simulator().run(_light(), 12).packed
    sl.write_stream(tmp_path / "a.dat", packed, height=HEIGHT, width=WIDTH, layout="dat-top", sidecar=False)
    monkeypatch.chdir(tmp_path)
    stream = sl.open_stream("a.dat", layout="dat-top", height=HEIGHT, width=WIDTH)
    text = pickle.dumps(stream)
    monkeypatch.chdir("/")
    np.testing.assert_array_equal(pickle.loads(text)[:], packed)
    stream.close()
    with pytest.raises(sl.SpikelaneError, match="closed stream"):
        pickle.dumps(stream)


def test_a_pickled_scene_is_the_same_scene():
    scene = sl.Scene(4, 32, 48, fov_deg=60.0, lighting="night", speed_kmh=50.0, flicker_hz=100.0)
    other = pickle.loads(pickle.dumps(scene))
    np.testing.assert_array_equal(other.render(0.5).rgb, scene.render(0.5).rgb)


def _views(frame: np.ndarray) -> dict[str, np.ndarray]:
    """Returns the same frame in kinds of memory that Rust must not borrow."""
    raw = np.zeros(frame.nbytes + 1, np.uint8)
    unaligned = raw[1:].view(frame.dtype).reshape(frame.shape)
    unaligned[:] = frame
    wide = np.zeros((frame.shape[0], 2 * frame.shape[1]), frame.dtype)
    wide[:, ::2] = frame
    return {
        "unaligned": unaligned,
        "with gaps": wide[:, ::2],
        "in Fortran order": np.asfortranarray(frame),
        "turned over": frame[::-1].copy()[::-1],
        "read-only": np.frombuffer(frame.tobytes(), frame.dtype).reshape(frame.shape),
    }


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("copied", [True, False])
def test_light_in_any_memory_gives_the_same_bits(dtype, copied):
    scale = {np.uint8: 255, np.uint16: 65535, np.float32: 1}[dtype]
    frame = (np.linspace(0.05, 0.9, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH) * scale).astype(dtype)
    expected = _simulator().run(frame, 60)
    for name, view in _views(frame).items():
        assert _simulator().run(view, 60) == expected, name
        one = sl.simulate_batch(_simulator().camera, [view[None]], 60, sequences=[0], seed=7, dense=False, copy=copied)
        np.testing.assert_array_equal(one[0], expected.packed, err_msg=name)
        np.testing.assert_array_equal(sl.light_at(view, [0]), sl.light_at(frame, [0]), err_msg=name)


@pytest.mark.parametrize("dtype", [">u2", ">f4"])
def test_light_of_the_other_byte_order_is_rejected(dtype):
    with pytest.raises(sl.SpikelaneTypeError, match="astype"):
        _simulator().run(np.zeros((HEIGHT, WIDTH), dtype), 10)


def test_light_that_changes_during_a_call_does_not_change_the_call():
    light = np.full((250, 400), 0.3, np.float32)
    camera = sl.Camera.preset("physical")
    expected = sl.Simulator(camera).run(light.copy(), 1500)

    def spoil(done: float, total: float) -> None:
        light[:] = np.nan

    assert sl.Simulator(camera).run(light, 1500, progress=spoil) == expected
    assert np.isnan(light).all()


def _interrupt_when_called(delay_s: float) -> threading.Timer:
    timer = threading.Timer(delay_s, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    return timer


@posix
def test_ctrl_c_stops_a_clip_of_a_batch_between_its_readouts():
    clips = np.full((2, 1, 250, 400), 90, np.uint8)
    out = np.empty((2, 100_000, 12_500), np.uint8)
    for threads in (1, 2):
        timer = _interrupt_when_called(0.3)
        with pytest.raises(KeyboardInterrupt):
            camera = sl.Camera.preset("physical")
            sl.simulate_batch(camera, clips, 100_000, sequences=range(2), threads=threads, dense=False, out=out)
        timer.join()


@posix
@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_stops_the_rendering_of_a_picture(threads):
    scene = sl.Scene(3, 3000, 4000)
    timer = _interrupt_when_called(0.2)
    with pytest.raises(KeyboardInterrupt):
        scene.render(0.1, samples=16, threads=threads)
    timer.join()


@posix
def test_ctrl_c_ends_the_program_with_code_130_and_no_traceback(tmp_path):
    # 375 MB: long enough for the signal, small enough for a nearly full disk.
    words = ["simulate", "--builtin-light", "chart", "--readouts", "30000", "-o", "r/a"]
    child = subprocess.Popen(
        [sys.executable, "-m", "spikelane", "--json", *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Without this line, a background job would ignore Ctrl-C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert child.stdout is not None
    assert any('"progress"' in line for line in iter(child.stdout.readline, ""))
    child.send_signal(signal.SIGINT)
    _, output = child.communicate()
    assert child.returncode == 130, output
    assert "stopped on request" in output and "Traceback" not in output
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


COMMAND = """
import os, signal, sys
from spikelane import _native
if sys.argv[1] == "handler":
    signal.signal(signal.SIGTERM, lambda *_: print("handled", flush=True))
if sys.argv[1] == "ignored":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
for _ in range(2):
    assert _native.command(["spikelane", "--json", "record", "-o", sys.argv[2], "--readouts", "200", "--force",
                            "--width", "8", "--height", "8"]) == 0
os.kill(os.getpid(), signal.SIGTERM)
print("alive", flush=True)
"""


@posix
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows the actions of signals")
@pytest.mark.parametrize("action", ["default", "handler", "ignored"])
def test_a_command_does_not_change_the_sigterm_handler(tmp_path, action):
    words = [sys.executable, "-c", COMMAND, action, str(tmp_path / "set")]
    child = subprocess.run(words, capture_output=True, text=True, check=False)
    output = child.stdout.splitlines()[-2:]
    if action == "default":
        assert child.returncode == -signal.SIGTERM and "alive" not in output, child.stderr
    else:
        assert child.returncode == 0 and output[-1] == "alive", child.stderr
        assert ("handled" in output) == (action == "handler")
