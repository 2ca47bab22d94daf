//! Benchmarks of encoding and decoding packed frames in every layout, on one thread. Before the measurement, a round
//! trip checks each layout.

use criterion::{BenchmarkId, Criterion, Throughput};
use spikelane::spikes::Geometry;
use spikelane_io::formats::{Codec, Layout};

const FRAMES: usize = 64;

fn main() {
    let mut criterion = Criterion::default().sample_size(20).configure_from_args();
    for layout in Layout::ALL {
        let geometry = layout.fixed_geometry().unwrap_or_else(|| Geometry::new(400, 250).unwrap());
        let codec = Codec::new(layout, geometry).unwrap();
        let size = geometry.frame_bytes();
        let packed: Vec<u8> = (0..FRAMES * size).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 13) as u8).collect();
        let mut file = vec![0; FRAMES * codec.frame_bytes()];
        let mut back = vec![0; packed.len()];
        codec.encode(&packed, &mut file).unwrap();
        codec.decode(&file, &mut back).unwrap();
        assert_eq!(back, packed, "{}", layout.name());
        let mut group = criterion.benchmark_group("formats");
        group.throughput(Throughput::Elements((FRAMES * geometry.pixels()) as u64));
        let id = |what: &str| BenchmarkId::new(what, layout.name());
        group.bench_function(id("encode"), |b| b.iter(|| codec.encode(&packed, &mut file).unwrap()));
        group.bench_function(id("decode"), |b| b.iter(|| codec.decode(&file, &mut back).unwrap()));
        group.finish();
    }
    criterion.final_summary();
}
