//! The summary that `simulate` prints at the end: files, length of the stream, and speed.

use indicatif::DecimalBytes;
use serde_json::{Value, json};
use spikelane::Result;
use spikelane::unstable::Count;
use spikelane_io::formats::StreamSummary;
use spikelane_io::simulate::{RunOptions, RunSummary, Sidecar};

use crate::common::{Console, OutputNames};

/// Light level, in thresholds per readout, at which an ordinary pixel fires at every readout. Clipping light above this
/// level does not change the stream.
const SATURATION_THRESHOLDS: f64 = 1.5;

/// A finished simulation.
pub(crate) struct RunReport<'a> {
    pub options: &'a RunOptions,
    /// Description of the light in one line.
    pub light: String,
    pub outcome: &'a RunSummary,
    pub sidecar: &'a Sidecar,
    pub names: &'a OutputNames,
    /// Wall time in seconds between the first and the last file.
    pub seconds: f64,
}

impl RunReport<'_> {
    pub(crate) fn print(&self, out: &Console) -> Result<()> {
        let (o, names) = (self.outcome, self.names);
        let line = |what: &str, w: &StreamSummary, rate: f64| {
            format!("{what}  {}  {}, mean rate {rate:.4}", w.path.display(), DecimalBytes(w.bytes))
        };
        // The first line describes the light, because its transfer function is the most frequent cause of a wrong
        // brightness.
        let noisy = line("noisy  ", &o.noisy, self.sidecar.stream.mean_rate);
        out.print_message(format_args!("{noisy}; light: {}", self.light));
        if let (Some(written), Some(facts)) = (&o.clean, &self.sidecar.clean) {
            out.print_message(line("clean  ", written, facts.mean_rate));
        }
        out.print_message(format_args!(
            "sidecar  {}\npicture  {}",
            names.sidecar.display(),
            names.picture.display()
        ));
        out.print_message(self.time_summary());
        out.print_detail(self.timing_details());
        self.notes(out);
        out.print_event(&self.done_event())
    }

    fn streams(&self) -> u64 {
        1 + u64::from(self.outcome.clean.is_some())
    }

    /// Returns the duration of the recorded time, in seconds of the camera.
    fn camera_seconds(&self) -> f64 {
        self.outcome.readouts as f64 / self.options.camera.sensor.readout_hz
    }

    /// Returns the length of the stream and the run time as text.
    fn time_summary(&self) -> String {
        let sensor = &self.options.camera.sensor;
        format!(
            "{} of {}: {} of camera time at {} Hz in {:.2} s",
            Count(self.outcome.readouts, "readout"),
            sensor.geometry,
            format_duration(self.camera_seconds()),
            sensor.readout_hz,
            self.seconds,
        )
    }

    fn timing_details(&self) -> String {
        let (o, job) = (self.outcome, self.options);
        let kernel = o.kernel_time.as_secs_f64();
        format!(
            "speed    whole run {}, kernel alone {}\ntime     {:.2} s waiting for light, {kernel:.3} s in the kernels ({:.2} Gpixel-readouts/s: {}, {}, {}), {:.2} s writing to disk\nlight    {}, of which {} contain light above {} times full scale, which was clipped",
            format_pace(self.camera_seconds(), self.seconds),
            format_pace(self.camera_seconds(), kernel),
            o.wait_time.as_secs_f64(),
            self.gigapixels(kernel),
            job.backend,
            Count(job.threads, "thread"),
            Count(self.streams(), "stream"),
            o.sync_time.as_secs_f64(),
            Count(o.frames, "frame"),
            o.frames_above_max_light,
            o.max_light,
        )
    }

    fn gigapixels(&self, seconds: f64) -> f64 {
        let pixels = self.options.camera.sensor.geometry.pixels() as f64 * self.outcome.readouts as f64;
        pixels * self.streams() as f64 / seconds.max(1e-9) / 1e9
    }

    /// Prints notes that may require an action of the user.
    fn notes(&self, out: &Console) {
        let (o, names) = (self.outcome, self.names);
        let left = |path: &std::path::Path, flag: &str| {
            out.print_message(format_args!(
                "note: {} is from an earlier run and was not changed; {flag}",
                path.display()
            ));
        };
        if o.clean.is_none() && names.clean_stream.exists() {
            left(&names.clean_stream, "--clean generates a new clean stream");
        }
        if self.sidecar.images.is_none() && names.images.exists() {
            left(&names.images, "--images-every generates new images");
        }
        if let Some(wanted) = self.options.readouts.filter(|&n| n > o.readouts) {
            out.print_message(format_args!(
                "note: the input ended after {} of {}",
                o.readouts,
                Count(wanted, "readout"),
            ));
        }
        if let Some(fault) = o.exposure_fault {
            out.print_message(format_args!("warning: {}", fault.warning(names.stream.display())));
        }
        let thresholds = o.max_light * self.options.camera.sensor.thresholds_at_full_scale;
        if o.frames_above_max_light > 0 && thresholds < SATURATION_THRESHOLDS {
            out.print_message(format_args!(
                "note: {} of {} contained light above {} times full scale. This light was clipped, although it does not saturate the pixels; to simulate this light, set --max-light to {}",
                o.frames_above_max_light,
                Count(o.frames, "frame"),
                o.max_light,
                2.0 * o.max_light
            ));
        }
    }

    fn done_event(&self) -> Value {
        let (o, names) = (self.outcome, self.names);
        let (waited, kernel) = (o.wait_time.as_secs_f64(), o.kernel_time.as_secs_f64());
        let mut event = json!({
            "event": "done", "readouts": o.readouts, "seconds": self.seconds, "camera_seconds": self.camera_seconds(),
            "simulation_seconds": o.simulation_time.as_secs_f64(), "sync_seconds": o.sync_time.as_secs_f64(),
            "light_seconds": waited, "kernel_seconds": kernel,
            "gigapixel_readouts_per_second": self.gigapixels(kernel),
            "real_time_factor": self.camera_seconds() / self.seconds.max(1e-9),
            "kernel_real_time_factor": self.camera_seconds() / kernel.max(1e-9),
            "backend": self.options.backend.name(), "threads": self.options.threads,
            "stream": names.stream.display().to_string(), "digest": o.noisy.digest,
            "sidecar": names.sidecar.display().to_string(), "picture": names.picture.display().to_string(),
            "frames": o.frames, "frames_above_max_light": o.frames_above_max_light,
        });
        if let Some(clean) = &o.clean {
            event["clean"] = json!(clean.path.display().to_string());
            event["clean_digest"] = json!(clean.digest);
        }
        event
    }
}

/// Formats a duration in ms or s with three digits.
fn format_duration(seconds: f64) -> String {
    let (value, unit) = if seconds < 1.0 { (1000.0 * seconds, "ms") } else { (seconds, "s") };
    let digits = 2 - (value.max(1.0).log10().floor() as usize).min(2);
    let text = format!("{value:.digits$}");
    let text = if digits > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} {unit}")
}

/// Formats a speed as a multiple of the camera's speed.
fn format_pace(lasts_s: f64, took_s: f64) -> String {
    let ratio = lasts_s / took_s.max(1e-9);
    let (factor, word) = if ratio >= 1.0 { (ratio, "faster") } else { (1.0 / ratio.max(1e-12), "slower") };
    if factor < 1.05 {
        return "as fast as the camera".to_owned();
    }
    let digits = if factor < 10.0 { 1 } else { 0 };
    format!("{factor:.digits$} times {word} than the camera")
}

#[cfg(test)]
mod tests {
    use super::{format_duration, format_pace};

    #[test]
    fn times_have_three_digits_at_most() {
        assert_eq!([0.025, 0.0001, 0.1234, 1.0].map(format_duration), ["25 ms", "0.1 ms", "123 ms", "1 s"]);
        assert_eq!([1.555, 60.0, 1234.0].map(format_duration), ["1.55 s", "60 s", "1234 s"]);
    }

    #[test]
    fn slow_runs_are_reported_as_slower() {
        assert_eq!(format_pace(0.025, 2.5), "100 times slower than the camera");
        assert_eq!(format_pace(0.025, 0.005), "5.0 times faster than the camera");
        assert_eq!(format_pace(1.0, 1.01), "as fast as the camera");
    }
}
