//! Short work: pushes of few readouts, and crops whose recordings last 41.

use std::hint::black_box;
use std::time::Duration;

use spikelane::{Geometry, Plan, Result, Seeds, Simulator, presets, spikes};
use spikelane_io::light::{Insertion, Timeline};
use spikelane_io::simulate::FrameRef;

use super::cameras::{Noise, frames};
use super::report::Fact;
use super::timing::{rate, read_bandwidth};

/// Readouts of 400x250 pixels that are pushed in parts.
const READOUTS: usize = 200;

/// Side and readouts of a crop, as networks are trained on them.
const CROP: (u32, usize) = (96, 41);

/// Bytes that a push of one readout moves for each pixel of a camera with full noise: threshold, half a key, gain, dark current,
/// bound, threshold noise and three numbers of shot noise are read; charge and its fraction are read and written; a grey level is
/// read, and a bit written.
const BYTES: f64 = (2 + 2 + 4 + 4 + 2 + 2 + 3 * 4 + 2 * 4 + 1) as f64 + 0.125;

fn fact(name: String, value: f64, unit: &'static str) -> Fact {
    Fact { name, value, unit }
}

/// 200 readouts, full noise, one thread, in pushes of 16, 4 and one readout: shares of the speed in one push.
pub(crate) fn pushes(budget: Duration) -> Result<Vec<Fact>> {
    let mut simulator = Simulator::new(&Noise::Full.camera()?, Seeds::default())?;
    let geometry = simulator.plan().geometry();
    let light = frames(Noise::Full, READOUTS);
    let refs: Vec<_> = light.iter().map(|f| FrameRef::u8(f, geometry)).collect();
    let mut facts = Vec::new();
    for (lit, moving) in [("held", false), ("a new frame each", true)] {
        let mut whole = 0.0;
        for size in [READOUTS, 16, 4, 1] {
            let speed = pushed(&mut simulator, &refs, size, moving, budget)?;
            if size == READOUTS {
                whole = speed;
                facts.push(fact(
                    format!("200 readouts in one push, {lit}"),
                    speed / 1e9,
                    "Gpixel-readouts/s",
                ));
                continue;
            }
            facts.push(fact(format!("share of it in pushes of {size}, {lit}"), speed / whole, ""));
            if size == 1 && !moving {
                facts.push(fact("bytes moved by pushes of 1, held".into(), speed * BYTES / 1e9, "GB/s"));
            }
        }
    }
    facts.push(fact("reading memory, meanwhile".into(), read_bandwidth(budget) / 1e9, "GB/s"));
    Ok(facts)
}

/// Pixel-readouts a second.
fn pushed(
    simulator: &mut Simulator,
    frames: &[FrameRef<'_>],
    size: usize,
    moving: bool,
    budget: Duration,
) -> Result<f64> {
    let geometry = simulator.plan().geometry();
    let timeline = Timeline::per_frame(1, Insertion::Hold)?;
    let mut out = vec![0; READOUTS * geometry.frame_bytes()];
    let mut result = Ok(());
    let speed = rate(budget, (READOUTS * geometry.pixels()) as f64, || {
        for (part, frames_of_it) in out.chunks_mut(size * geometry.frame_bytes()).zip(frames.chunks(size)) {
            let pushed = if moving {
                simulator.push_frames(frames_of_it, &timeline, part).map(drop)
            } else {
                simulator.push(frames[0], part)
            };
            result = std::mem::replace(&mut result, Ok(())).and(pushed);
        }
    });
    result?;
    black_box(&out);
    Ok(speed)
}

/// Recordings of one planned crop of `physical`, a new one each time, as bytes; and what the plan takes.
pub(crate) fn crops(budget: Duration) -> Result<Vec<Fact>> {
    let (side, readouts) = CROP;
    let mut camera = presets::builtin("physical")?;
    camera.sensor.geometry = Geometry::new(side, side)?;
    let geometry = camera.sensor.geometry;
    let light: Vec<u8> = (0..geometry.pixels()).map(|p| (40 + p * 7 % 40) as u8).collect();
    let mut failed = Ok(());
    let planned =
        rate(budget, 1.0, || failed = Plan::new(&camera, Seeds::default()).map(|p| drop(black_box(p))));
    failed?;
    let mut simulator = Simulator::new(&camera, Seeds::default())?;
    let mut packed = vec![0; readouts * geometry.frame_bytes()];
    let mut bytes = vec![0; readouts * geometry.pixels()];
    let (mut shot, mut failed) = (0, Ok(()));
    let whole = rate(budget, 1.0, || {
        shot += 1;
        let one = simulator
            .restart(Seeds { shot, sequence: shot, ..Seeds::default() })
            .and_then(|()| simulator.push(FrameRef::u8(&light, geometry), &mut packed))
            .and_then(|()| spikes::unpack(geometry, &packed, &mut bytes));
        failed = std::mem::replace(&mut failed, Ok(())).and(one);
    });
    failed?;
    let mut failed = Ok(());
    let restarted = rate(budget, 1.0, || {
        shot += 1;
        failed = simulator.restart(Seeds { shot, sequence: shot, ..Seeds::default() });
    });
    failed?;
    let run = rate(budget, 1.0, || {
        black_box(simulator.push(FrameRef::u8(&light, geometry), &mut packed)).unwrap_or(())
    });
    let name = |what: &str| format!("{what} {side}x{side}x{readouts}, `physical`");
    Ok(vec![
        fact(name("a camera for crops of"), 1e3 / planned, "ms"),
        fact(name("a new recording of it, a byte a pixel,"), whole, "a second"),
        fact(name("of that the start of"), 1e3 / restarted, "ms"),
        fact(name("and the readouts of"), 1e3 / run, "ms"),
    ])
}
