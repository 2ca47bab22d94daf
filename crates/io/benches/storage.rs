//! Benchmarks of the digest, and of writing a stream to a new mapped file. Before the measurement, the digest of one
//! written file is checked.

use criterion::{Criterion, Throughput};
use spikelane::spikes::Geometry;
use spikelane_io::formats::{Layout, StreamWriter};
use spikelane_io::storage::Digest;

const FRAMES: usize = 4000;

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
    group.bench_function("write, sync, rename", |b| b.iter(|| write().finish().unwrap()));
    group.finish();
    criterion.final_summary();
}
