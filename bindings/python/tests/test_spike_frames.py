"""Streams of packed frames in memory, compared with NumPy."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import spikelane as sl


@pytest.fixture
def dense() -> np.ndarray:
    return np.random.default_rng(8).integers(0, 2, (9, 7, 13), np.uint8)


@pytest.fixture
def frames(dense) -> sl.SpikeFrames:
    return sl.SpikeFrames.from_dense(dense)


def test_sizes_and_counts_are_those_of_the_dense_array(dense, frames):
    assert (frames.readouts, frames.height, frames.width) == frames.shape == dense.shape
    assert len(frames) == 9 and frames.packed.shape == (9, 12) and frames.packed.dtype == np.uint8
    assert frames.spike_count == dense.sum()
    assert repr(frames) == "<spikelane.SpikeFrames, 9 readouts of 7 x 13 pixels>"


def test_dense_and_packed_arrays_convert_as_in_numpy(dense, frames):
    packed = np.packbits(dense.reshape(9, -1), axis=1, bitorder="little")
    np.testing.assert_array_equal(frames.packed, packed)
    np.testing.assert_array_equal(frames.to_dense(), dense)
    assert sl.SpikeFrames.from_packed(packed, 7, 13) == frames
    assert sl.SpikeFrames.from_dense(dense.astype(bool)) == frames
    assert sl.SpikeFrames.from_dense(dense * np.uint8(255)) == frames


def test_spikes_are_readout_row_and_column_in_order(dense, frames):
    found = frames.spikes()
    assert found.dtype == np.int64
    np.testing.assert_array_equal(found, np.argwhere(dense))
    assert frames[:0].spikes().shape == (0, 3)


def test_an_index_gives_a_dense_frame_and_a_slice_gives_frames(dense, frames):
    for i in (0, 8, -1, -9, np.int64(3)):
        np.testing.assert_array_equal(frames[i], dense[i])
    for part in (slice(2, 5), slice(None), slice(-4, None), slice(5, 2), slice(None, None, 3), slice(None, None, -1)):
        found = frames[part]
        assert isinstance(found, sl.SpikeFrames)
        np.testing.assert_array_equal(found.to_dense(), dense[part])
    np.testing.assert_array_equal(np.stack(list(frames)), dense)
    for i in (9, -10):
        with pytest.raises(IndexError, match=f"readout {i}"):
            frames[i]
    for index in ((0, 1), "a", 1.0, None):
        with pytest.raises(TypeError, match="to_dense"):
            frames[index]


def test_packed_is_the_memory_of_the_stream(dense):
    packed = np.packbits(dense.reshape(9, -1), axis=1, bitorder="little")
    frames = sl.SpikeFrames.from_packed(packed, 7, 13)
    assert frames.packed is packed and np.shares_memory(frames[2:5].packed, packed)
    packed[4] = 0
    assert frames[4].sum() == 0 and frames[2:5].spike_count == dense[2:4].sum()


def test_numpy_converts_to_the_dense_array(dense, frames):
    np.testing.assert_array_equal(np.asarray(frames), dense)
    assert np.asarray(frames).dtype == np.uint8
    floats = np.asarray(frames, dtype=np.float32)
    assert floats.dtype == np.float32
    np.testing.assert_array_equal(floats, dense)
    np.testing.assert_array_equal(frames.__array__(copy=True), dense)
    with pytest.raises(ValueError, match="copy"):
        frames.__array__(copy=False)
    assert np.mean(frames) == dense.mean()


def test_frames_are_equal_if_their_sizes_and_bits_are(dense, frames):
    assert frames == sl.SpikeFrames.from_dense(dense) and not frames != copy.deepcopy(frames)
    assert frames != frames[:8] and frames != 3
    assert frames != sl.SpikeFrames.from_packed(frames.packed, 13, 7)
    dense[3, 2, 1] ^= 1
    assert frames != sl.SpikeFrames.from_dense(dense)
    with pytest.raises(TypeError, match="hash"):
        hash(frames)


def test_frames_can_be_pickled(frames):
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        assert pickle.loads(pickle.dumps(frames[1:4], protocol)) == frames[1:4]


def test_functions_accept_frames_instead_of_packed_spikes_and_a_size(dense, frames, tmp_path):
    packed, size = frames.packed, {"height": 7, "width": 13}
    for function, options in [
        (sl.tfp, {"at": 4, "half_window": 2}),
        (sl.tfi, {"at": 4}),
        (sl.span_rates, {"at": 4, "half_window": 2}),
        (sl.unpack, {}),
    ]:
        expected = function(packed, **size, **options)
        np.testing.assert_array_equal(function(frames, **options), expected)
        np.testing.assert_array_equal(function(frames, 7, 13, **options), expected)
        with pytest.raises(sl.SpikelaneError, match="height and width"):
            function(packed, **options)
        with pytest.raises(sl.SpikelaneError, match=r"width: found 12.*omit width"):
            function(frames, width=12, **options)
    out = np.empty((9, 7, 13), np.uint8)
    assert sl.unpack(frames, out=out) is out
    np.testing.assert_array_equal(out, dense)
    digests = {
        sl.write_stream(tmp_path / "a.dat", frames),
        sl.write_stream(tmp_path / "b.dat", packed, **size),
        sl.write_stream(tmp_path / "c.dat", dense),
        sl.write_stream(tmp_path / "d.dat", frames, **size),
    }
    assert len(digests) == 1
    with pytest.raises(sl.SpikelaneError, match="height: found 8"):
        sl.write_stream(tmp_path / "e.dat", frames, height=8, width=13)
    with sl.open_stream(tmp_path / "a.dat") as stream:
        assert sl.SpikeFrames.from_packed(stream[:], 7, 13) == frames


def test_wrong_arrays_are_rejected(dense, frames):
    for wrong in (frames.packed[:, :-1].copy(), frames.packed[0], frames.packed[::2], dense):
        with pytest.raises(sl.SpikelaneError, match="packed"):
            sl.SpikeFrames.from_packed(wrong, 7, 13)
    for wrong in (dense[0], dense[:, :, ::2]):
        with pytest.raises(sl.SpikelaneError, match="array"):
            sl.SpikeFrames.from_dense(wrong)
    for wrong in (None, [[[0]]], dense.astype(np.int64), dense.astype(np.float32)):
        with pytest.raises(sl.SpikelaneTypeError):
            sl.SpikeFrames.from_dense(wrong)
        with pytest.raises(sl.SpikelaneTypeError):
            sl.SpikeFrames.from_packed(wrong, 7, 13)
    dense[4, 2, 5] = 2
    with pytest.raises(sl.SpikelaneError, match="readout 4, row 2, col 5"):
        sl.SpikeFrames.from_dense(dense)
