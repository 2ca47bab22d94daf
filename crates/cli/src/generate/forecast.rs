//! The estimate of `simulate --dry-run`: frames, readouts, bytes and time.

use spikelane::SimulatorOptions;
use spikelane::unstable::Count;
use std::time::Instant;

use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::Result;
use spikelane_io::light::Frame;
use spikelane_io::simulate::{LightFacts, RunOptions};

use super::light::RunLight;
use crate::common::Console;
use spikelane::unstable::inputs;

/// Duration in seconds of each of the two speed measurements: reading light, and simulating readouts.
const TRIAL_SECONDS: f64 = 0.3;

/// Prints the estimated size and time of a run.
pub(crate) fn print_forecast(
    clean: bool,
    job: &RunOptions,
    mut light: RunLight,
    free: Option<u64>,
    out: &Console,
) -> Result<()> {
    let frames = light.source.announced_frames();
    let readouts = job.expected_readouts(frames).or(job.readouts);
    let streams = 1 + u64::from(clean);
    let (frame_s, readout_s) = (frame_seconds(&mut light)?, readout_seconds(job)? * streams as f64);
    let (source, summary) = (light.source.describe(), LightFacts::summary(&*light.source));
    let light_text = if source == summary { source } else { format!("{source}; light: {summary}") };
    let space = free
        .map_or("free space unknown".to_owned(), |free| format!("{} free on the disk", DecimalBytes(free)));
    let Some(readouts) = readouts else {
        let bytes = job.layout.file_bytes(job.camera.sensor.geometry, 1_000_000)?.saturating_mul(streams);
        let event = json!({"event": "dry-run", "free_bytes": free, "seconds_per_readout": readout_s,
            "seconds_per_frame": frame_s, "bytes_per_million_readouts": bytes});
        let known = format!(
            "readouts until the input ends; {} and {:.1} s of kernel time per million readouts",
            DecimalBytes(bytes),
            readout_s * 1e6
        );
        return out.print_result(&event, &format!("{light_text}\n{known}; {space}\n"));
    };
    let bytes = job.layout.file_bytes(job.camera.sensor.geometry, readouts)?.saturating_mul(streams);
    let needed = job.timeline.position(readouts.saturating_sub(1)).frame + 1;
    let read = frames.map_or(needed, |frames| frames.min(needed));
    let (light_s, kernel_s) = (read as f64 * frame_s, readouts as f64 * readout_s);
    // Reading light and simulating run in parallel, so the slower of the two determines the time.
    let seconds = light_s.max(kernel_s);
    let mut event = json!({
        "event": "dry-run", "readouts": readouts, "bytes": bytes, "seconds": seconds, "free_bytes": free,
        "light_seconds": light_s, "kernel_seconds": kernel_s,
    });
    if let Some(frames) = frames {
        event["frames"] = json!(frames);
    }
    let bound = if job.expected_readouts(frames).is_some() { "" } else { "at most " };
    let frames = frames.map_or(String::new(), |n| format!("{}, ", Count(n, "frame")));
    let known = format!(
        "{bound}{frames}{}, {}, about {seconds:.1} s ({light_s:.1} s to read the light, {kernel_s:.2} s \
         in the kernels)",
        Count(readouts, "readout"),
        DecimalBytes(bytes),
    );
    out.print_result(&event, &format!("{light_text}\n{known}; {space}\n"))
}

/// Measures the seconds that reading one frame of the light takes.
fn frame_seconds(light: &mut RunLight) -> Result<f64> {
    let mut frame = Frame::dark(light.source.geometry());
    let (start, mut read, mut last_s) = (Instant::now(), 0_u32, 0.0);
    // Some sources compute many frames with the first of them. Reading continues while frames are ready.
    let is_ready = |read: u32, last_s: f64| last_s < 0.1 * start.elapsed().as_secs_f64() / f64::from(read);
    while read == 0 || start.elapsed().as_secs_f64() < TRIAL_SECONDS || is_ready(read, last_s) {
        let begin = Instant::now();
        if !light.source.next_frame(&mut frame)? {
            break;
        }
        last_s = begin.elapsed().as_secs_f64();
        read += 1;
    }
    Ok(start.elapsed().as_secs_f64() / f64::from(read.max(1)))
}

/// Measures the seconds per readout of simulating one stream in gray light.
fn readout_seconds(job: &RunOptions) -> Result<f64> {
    let options = SimulatorOptions::new().seeds(job.seeds).backend(job.backend).threads(job.threads);
    let mut simulator = options.build(&job.camera)?;
    let geometry = job.camera.sensor.geometry;
    let mut light = inputs::zeroed_vec::<u8>("light of a frame", geometry.pixels())?;
    light.fill(100);
    let readouts = ((32 << 20) / geometry.frame_bytes()).clamp(1, 128);
    let mut packed = inputs::zeroed_vec("simulated readouts", readouts * geometry.frame_bytes())?;
    let (start, mut done) = (Instant::now(), 0);
    while done == 0 || start.elapsed().as_secs_f64() < TRIAL_SECONDS {
        simulator.fill(&light, &mut packed)?;
        done += readouts;
    }
    Ok(start.elapsed().as_secs_f64() / done as f64)
}
