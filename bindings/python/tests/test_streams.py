"""Streams in files and in memory, compared with NumPy and with the program."""

from __future__ import annotations

import json
import subprocess

import numpy as np
import pytest

import spikelane as sl

LAYOUTS = ["dat", "dat-top", "npy-bits", "npy-bytes"]


@pytest.fixture
def bits() -> np.ndarray:
    return np.random.default_rng(5).integers(0, 2, (30, 7, 13), np.uint8)


def test_packing_and_unpacking_equal_numpy(bits):
    packed = sl.pack(bits)
    np.testing.assert_array_equal(packed, np.packbits(bits.reshape(30, -1), axis=1, bitorder="little"))
    np.testing.assert_array_equal(sl.unpack(packed, 7, 13), bits)
    batch = np.stack([bits, 1 - bits])
    np.testing.assert_array_equal(sl.unpack(sl.pack(batch), 7, 13), batch)
    out = np.empty((30, 7, 13), np.uint8)
    assert sl.unpack(packed, 7, 13, out=out) is out
    bits[4, 2, 5] = 2
    with pytest.raises(sl.SpikelaneError, match="readout 4, row 2, col 5"):
        sl.pack(bits)
    for wrong in (packed[0], packed[:, :-1].copy(), packed.astype(np.int16), packed[::2]):
        with pytest.raises(sl.SpikelaneError):
            sl.unpack(wrong, 7, 13)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_reads_back_equal(bits, tmp_path, layout):
    path = tmp_path / ("a.npy" if layout.startswith("npy") else "a.dat")
    digest = sl.write_stream(path, bits, layout=layout, readout_hz=20_000)
    assert digest.startswith("blake3:")
    with sl.open_stream(path) as stream:
        assert stream.shape == (30, 7, 13) and stream.layout == layout and len(stream) == 30
        packed = sl.pack(bits)
        np.testing.assert_array_equal(stream[:], packed)
        np.testing.assert_array_equal(stream[3:9], packed[3:9])
        np.testing.assert_array_equal(stream[-4:], packed[-4:])
        np.testing.assert_array_equal(stream[-1], packed[-1])
        assert stream[9:3].shape == (0, 12)
        np.testing.assert_array_equal(stream.read_dense(2, 5), bits[2:5])
        np.testing.assert_array_equal(stream.read_dense(), bits)
    assert json.loads((tmp_path / "a.json").read_text())["digest"] == digest


def test_a_stream_is_not_started_if_another_writer_has_its_sidecar(bits, tmp_path):
    fcntl = pytest.importorskip("fcntl")
    with (tmp_path / ".a.json.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(sl.SpikelaneError, match=r"a\.json"):
            sl.write_stream(tmp_path / "a.dat", bits)
        assert [path.name for path in tmp_path.iterdir()] == [".a.json.lock"]
    sl.write_stream(tmp_path / "new" / "a.dat", bits)
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["a.dat", "a.json"]


@pytest.mark.parametrize(("layout", "shape"), [("rows416", (250, 400)), ("rows1024", (1000, 1000))])
def test_the_layouts_of_cameras_read_back_equal(tmp_path, layout, shape):
    bits = np.random.default_rng(6).integers(0, 2, (3, *shape), np.uint8)
    sl.write_stream(tmp_path / "a.dat", bits, layout=layout, sidecar=False)
    found = sl.open_stream(tmp_path / "a.dat", layout=layout)
    np.testing.assert_array_equal(found.read_dense(), bits)
    with pytest.raises(sl.SpikelaneError, match="layout"):
        sl.write_stream(tmp_path / "b.dat", bits[:, 1:].copy(), layout=layout)


def test_numpy_reads_dat_with_the_bottom_row_first(bits, tmp_path):
    sl.write_stream(tmp_path / "a.dat", bits)
    raw = np.fromfile(tmp_path / "a.dat", np.uint8).reshape(30, 12)
    frames = np.unpackbits(raw, axis=1, bitorder="little")[:, :91].reshape(30, 7, 13)
    np.testing.assert_array_equal(frames[:, ::-1], bits)


def test_the_program_and_python_read_each_others_files(bits, tmp_path, program):
    sl.write_stream(tmp_path / "a.dat", bits)

    def run(*arguments: object) -> None:
        subprocess.run([*program, *map(str, arguments)], capture_output=True, text=True, check=True)

    run("verify", tmp_path / "a.dat")
    run("convert", tmp_path / "a.dat", tmp_path / "b.npy", "--to", "npy-bytes")
    np.testing.assert_array_equal(np.load(tmp_path / "b.npy"), bits)
    np.testing.assert_array_equal(sl.open_stream(tmp_path / "b.npy").read_dense(), bits)


def test_the_error_of_a_closed_stream_names_the_cause(bits, tmp_path):
    sl.write_stream(tmp_path / "a.dat", bits)
    stream = sl.open_stream(tmp_path / "a.dat")
    stream.close()
    stream.close()
    assert stream.closed and "closed" in repr(stream)
    for use in (lambda: stream[0], lambda: stream[:], stream.read_dense, lambda: len(stream), lambda: stream.shape):
        with pytest.raises(sl.SpikelaneError, match="closed stream"):
            use()


def test_indices_beyond_the_end_and_steps_are_rejected(bits, tmp_path):
    sl.write_stream(tmp_path / "a.dat", bits)
    stream = sl.open_stream(tmp_path / "a.dat")
    for index in (30, -31):
        with pytest.raises(IndexError):
            stream[index]
    assert len(list(stream)) == 30
    with pytest.raises(sl.SpikelaneError, match="step"):
        stream[::2]
    with pytest.raises(sl.SpikelaneError):
        stream.read_dense(20, 31)
    with pytest.raises(TypeError):
        stream["a"]


def test_a_truncated_file_is_read_up_to_its_end(bits, tmp_path):
    sl.write_stream(tmp_path / "a.dat", bits)
    data = (tmp_path / "a.dat").read_bytes()
    (tmp_path / "a.dat").write_bytes(data[:-1])
    np.testing.assert_array_equal(sl.open_stream(tmp_path / "a.dat").read_dense(), bits[:-1])


def test_files_without_a_size_and_empty_files_are_rejected(bits, tmp_path):
    sl.write_stream(tmp_path / "a.dat", bits)
    data = (tmp_path / "a.dat").read_bytes()
    (tmp_path / "b.dat").write_bytes(data)
    (tmp_path / "c.dat").write_bytes(b"")
    for name in ("b", "c"):
        with pytest.raises(sl.SpikelaneError) as raised:
            sl.open_stream(tmp_path / f"{name}.dat")
        assert f"{name}.dat" in raised.value.subject
    with pytest.raises(sl.SpikelaneError, match="height and width"):
        sl.open_stream(tmp_path / "b.dat", height=7)


def test_a_failed_write_leaves_no_file(bits, tmp_path):
    with pytest.raises(sl.SpikelaneError):
        sl.write_stream(tmp_path / "a.dat", sl.pack(bits), height=7, width=30)
    with pytest.raises(sl.SpikelaneError):
        sl.write_stream(tmp_path / "a.dat", bits[:0])

    def stop(done: float, total: float) -> None:
        raise KeyError

    with pytest.raises(KeyError):
        sl.write_stream(tmp_path / "a.dat", bits, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_reconstructions_equal_a_plain_loop(bits):
    packed, at, half = sl.pack(bits), 12, 6
    window = bits[at - half : at + half + 1]
    np.testing.assert_allclose(sl.tfp(packed, 7, 13, at=at, half_window=half), window.mean(axis=0), rtol=1e-6)
    tfi, span = np.empty((7, 13)), np.empty((7, 13))
    for row in range(7):
        for col in range(13):
            times = np.flatnonzero(bits[:, row, col])
            before, after = times[(times <= at) & (times > at - 21)], times[(times > at) & (times <= at + 20)]
            both = before.size and after.size
            tfi[row, col] = 1 / (after[0] - before[-1]) if both else 1 / 40
            inside = np.flatnonzero(window[:, row, col])
            enough = inside.size > 1
            span[row, col] = (inside.size - 1) / (inside[-1] - inside[0]) if enough else inside.size / window.shape[0]
    np.testing.assert_allclose(sl.tfi(packed, 7, 13, at=at), tfi, rtol=1e-6)
    np.testing.assert_allclose(sl.span_rates(packed, 7, 13, at=at, half_window=half), span, rtol=1e-6)
    for wrong in (lambda: sl.tfp(packed, 7, 13, at=30, half_window=1), lambda: sl.tfi(packed, 7, 13, at=3, search=0)):
        with pytest.raises(sl.SpikelaneError):
            wrong()
