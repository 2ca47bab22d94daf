//! What `simulate --dry-run` says: frames, readouts, bytes and time, and nothing is written.

use std::time::Instant;

use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::{Result, Simulator};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{FrameRef, Run};

use super::light::Light;
use crate::shared::output::Out;
use spikelane::unstable::inputs;

/// Seconds for which light is read, and spikes are made, to learn how long each takes.
const TRIAL_S: f64 = 0.3;

/// Tells what the run would take.
pub(crate) fn forecast(clean: bool, job: &Run, mut light: Light, free: Option<u64>, out: &Out) -> Result<()> {
    let frames = light.source.announced_frames();
    let readouts = job.expected(frames).or(job.readouts);
    let streams = 1 + u64::from(clean);
    let (frame_s, readout_s) = (frame_seconds(&mut light)?, readout_seconds(job)? * streams as f64);
    let about = format!("{}; light: {}", light.source.describe(), light.source.front_end());
    let space = free
        .map_or("free space unknown".to_owned(), |free| format!("{} free on the disk", DecimalBytes(free)));
    let Some(readouts) = readouts else {
        let bytes = job.layout.file_bytes(job.camera.sensor.geometry, 1_000_000)?.saturating_mul(streams);
        let event = json!({"event": "dry-run", "free_bytes": free, "seconds_per_readout": readout_s,
            "seconds_per_frame": frame_s, "bytes_per_million_readouts": bytes});
        let known = format!(
            "as many readouts as the input lasts; {} and {:.1} s of kernel time for each million",
            DecimalBytes(bytes),
            readout_s * 1e6
        );
        return out.result(&event, &format!("{about}\n{known}; {space}\n"));
    };
    let bytes = job.layout.file_bytes(job.camera.sensor.geometry, readouts)?.saturating_mul(streams);
    let needed = job.timeline.at(readouts.saturating_sub(1)).frame + 1;
    let read = frames.map_or(needed, |frames| frames.min(needed));
    let (light_s, kernel_s) = (read as f64 * frame_s, readouts as f64 * readout_s);
    // Light is read ahead while spikes are made.
    let seconds = light_s.max(kernel_s);
    let mut event = json!({
        "event": "dry-run", "readouts": readouts, "bytes": bytes, "seconds": seconds, "free_bytes": free,
        "light_seconds": light_s, "kernel_seconds": kernel_s,
    });
    if let Some(frames) = frames {
        event["frames"] = json!(frames);
    }
    let most = if job.expected(frames).is_some() { "" } else { "at most " };
    let frames =
        frames.map_or(String::new(), |n| format!("{n} {}, ", if n == 1 { "frame" } else { "frames" }));
    let known = format!(
        "{most}{frames}{readouts} readouts, {}, about {seconds:.1} s ({light_s:.1} s to read the light, {kernel_s:.2} s \
         in the kernels)",
        DecimalBytes(bytes)
    );
    out.result(&event, &format!("{about}\n{known}; {space}\n"))
}

/// Seconds to read one frame of the light.
fn frame_seconds(light: &mut Light) -> Result<f64> {
    let mut frame = Frame::dark(light.source.geometry());
    let (start, mut read) = (Instant::now(), 0_u32);
    while (read == 0 || start.elapsed().as_secs_f64() < TRIAL_S) && light.source.next_frame(&mut frame)? {
        read += 1;
    }
    Ok(start.elapsed().as_secs_f64() / f64::from(read.max(1)))
}

/// Seconds per readout of one stream under grey light.
fn readout_seconds(job: &Run) -> Result<f64> {
    let simulator = Simulator::new(&job.camera, job.seeds)?.with_backend(job.backend)?;
    let mut simulator = simulator.with_threads(job.threads)?;
    let geometry = job.camera.sensor.geometry;
    let mut light = inputs::zeroed::<u8>("light of a frame", geometry.pixels())?;
    light.fill(100);
    let readouts = ((32 << 20) / geometry.frame_bytes()).clamp(1, 128);
    let mut packed = inputs::zeroed("simulated readouts", readouts * geometry.frame_bytes())?;
    let (start, mut done) = (Instant::now(), 0);
    while done == 0 || start.elapsed().as_secs_f64() < TRIAL_S {
        simulator.push(FrameRef::u8(&light, geometry), &mut packed)?;
        done += readouts;
    }
    Ok(start.elapsed().as_secs_f64() / done as f64)
}
