//! Benchmarks of the digest, and of writing a stream to a new mapped file. Before the measurement, the digest of one
//! written file is checked.
//!
//! Two further benchmarks measure the limits of the operating system: writing one byte to each page of a mapped file, and
//! writing the same bytes with system calls.

use criterion::{Criterion, Throughput};
use spikelane::spikes::Geometry;
use spikelane_io::formats::{Layout, StreamWriter};
use spikelane_io::storage::{Digest, FileWriter};

const FRAMES: usize = 4000;

/// Smallest page size of current CPUs.
const PAGE_BYTES: usize = 4096;

/// Number of bytes per call.
const PIECE_BYTES: usize = 128 << 10;

fn main() {
    let geometry = Geometry::new(400, 250).unwrap();
    let bytes: Vec<u8> =
        (0..FRAMES * geometry.frame_bytes()).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 13) as u8).collect();
    let directory = tempfile::tempdir_in(".").unwrap();
    let path = directory.path().join("stream.dat");
    let write = || {
        let mut writer = StreamWriter::create(&path, Layout::DatTop, geometry, FRAMES as u64, true).unwrap();
        for (i, piece) in bytes.chunks(256 * geometry.frame_bytes()).enumerate() {
            writer.write_frames(256 * i as u64, piece).unwrap();
        }
        writer
    };
    let done = write().finish().unwrap();
    assert_eq!(done.digest, Digest::hash_file(&path).unwrap());
    assert_eq!(done.digest, Digest::hash_bytes(&bytes));
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    let mut group = criterion.benchmark_group("storage");
    group.throughput(Throughput::Bytes(bytes.len() as u64));
    group.bench_function("digest", |b| b.iter(|| Digest::hash_bytes(&bytes)));
    group.bench_function("write without sync", |b| b.iter(|| drop(write())));
    let limit = directory.path().join("limit");
    let create = || FileWriter::create(&limit, bytes.len() as u64, true).unwrap();
    group.bench_function("limit: one byte per page", |b| {
        b.iter(|| {
            let mut writer = create();
            for at in (0..bytes.len()).step_by(PIECE_BYTES) {
                let window = writer.window(at as u64, PIECE_BYTES.min(bytes.len() - at)).unwrap();
                window.iter_mut().step_by(PAGE_BYTES).for_each(|byte| *byte = 1);
            }
        });
    });
    group.bench_function("limit: system calls", |b| {
        b.iter(|| {
            let mut writer = create();
            bytes.chunks(PIECE_BYTES).for_each(|piece| writer.write_all(piece).unwrap());
        });
    });
    group.bench_function("write, sync, rename", |b| b.iter(|| write().finish().unwrap()));
    group.finish();
    criterion.final_summary();
}
