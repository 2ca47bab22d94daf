//! Benchmarks of rendering and labeling a driving scene at 400x250, on one thread and on two threads.

use criterion::{Criterion, criterion_group, criterion_main};
use spikelane_scene::{Lighting, SamplesPerPixel, Scene, SceneOptions, Warp};

fn scene(lighting: Lighting) -> Scene {
    let options = SceneOptions::default().with_lighting(Some(lighting));
    Scene::from_seed(1, &options).expect("the default options are valid")
}

fn frames(c: &mut Criterion) {
    let mut group = c.benchmark_group("scene 400x250");
    group.sample_size(20);
    for lighting in [Lighting::Noon, Lighting::Overcast, Lighting::Night] {
        let scene = scene(lighting);
        for threads in [1, 2] {
            group.bench_function(format!("render {} 2x2, {threads} threads", lighting.name()), |b| {
                b.iter(|| scene.render(1.0, SamplesPerPixel::Four, threads));
            });
        }
    }
    let noon = scene(Lighting::Noon);
    group.bench_function("render noon 4x4, 2 threads", |b| {
        b.iter(|| noon.render(1.0, SamplesPerPixel::Sixteen, 2))
    });
    group.bench_function("labels noon, 2 threads", |b| b.iter(|| noon.labels(1.0, 2)));
    let (a, b) = (noon.render(1.0, SamplesPerPixel::Four, 2), noon.render(1.0005, SamplesPerPixel::Four, 2));
    let (a, b) = (a.expect("within the drive"), b.expect("within the drive"));
    group.bench_function("flow noon, 2 threads", |x| x.iter(|| noon.flow(&a.labels, &b.labels, 2)));
    group.bench_function("boxes noon", |x| x.iter(|| noon.boxes(&a.labels)));
    let warp = Warp::new(&noon, &a, &b).expect("in order");
    group.bench_function("warp noon", |x| x.iter(|| warp.light(1.0002)));
    group.finish();
}

fn build(c: &mut Criterion) {
    c.bench_function("build a scene of 4 s", |b| b.iter(|| scene(Lighting::Noon)));
}

criterion_group!(benches, frames, build);
criterion_main!(benches);
