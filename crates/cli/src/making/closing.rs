//! What `simulate` says at its end: the files, how long the stream is, and how fast it was made.

use indicatif::DecimalBytes;
use serde_json::{Value, json};
use spikelane::Result;
use spikelane::sensor::FrontEnd;
use spikelane_io::simulate::{Outcome, Run, Sidecar, Written};

use super::names::Names;
use crate::shared::output::Out;

/// Thresholds in one readout from which on every usual pixel fires at every readout: light that is cut
/// above them leaves the stream as it is.
const SATURATED: f64 = 1.5;

/// A run that is done.
pub(crate) struct Closing<'a> {
    pub job: &'a Run,
    pub light: FrontEnd,
    pub outcome: &'a Outcome,
    pub sidecar: &'a Sidecar,
    pub names: &'a Names,
    /// From the first file to the last.
    pub seconds: f64,
}

impl Closing<'_> {
    pub(crate) fn tell(&self, out: &Out) -> Result<()> {
        let (o, names) = (self.outcome, self.names);
        let line = |what: &str, w: &Written, rate: f64| {
            format!("{what}  {}  {}, mean rate {rate:.4}", w.path.display(), DecimalBytes(w.bytes))
        };
        // The first line: which curve was used is what a wrong brightness is most often due to.
        let noisy = line("noisy  ", &o.noisy, self.sidecar.stream.mean_rate);
        out.say(format_args!("{noisy}; light: {}", self.light));
        if let (Some(written), Some(facts)) = (&o.clean, &self.sidecar.clean) {
            out.say(line("clean  ", written, facts.mean_rate));
        }
        out.say(format_args!("sidecar  {}\npicture  {}", names.sidecar.display(), names.picture.display()));
        out.say(self.achieved());
        out.detail(self.telemetry());
        self.notes(out);
        out.event(&self.event())
    }

    fn streams(&self) -> u64 {
        1 + u64::from(self.outcome.clean.is_some())
    }

    /// The time that the stream lasts in the camera.
    fn lasts_s(&self) -> f64 {
        self.outcome.readouts as f64 / self.job.camera.sensor.readout_hz
    }

    /// What was made, and how long that took.
    fn achieved(&self) -> String {
        let sensor = &self.job.camera.sensor;
        format!(
            "{} readouts of {}: {} of camera time at {} Hz in {:.2} s",
            self.outcome.readouts,
            sensor.geometry,
            duration(self.lasts_s()),
            sensor.readout_hz,
            self.seconds,
        )
    }

    fn telemetry(&self) -> String {
        let (o, job) = (self.outcome, self.job);
        let kernel = o.kernel.as_secs_f64();
        format!(
            "pace     the whole run {}, the kernel alone {}\n\
             time     {:.2} s waiting for light, {kernel:.3} s in the kernels ({:.2} Gpixel-readouts/s: {}, {} {}, \
             {} {}), {:.2} s to bring the files to the disk\n\
             light    {} frames, {} of them with light beyond {} full scales, which was cut",
            pace(self.lasts_s(), self.seconds),
            pace(self.lasts_s(), kernel),
            o.waited.as_secs_f64(),
            self.gigapixels(kernel),
            job.backend,
            job.threads,
            if job.threads == 1 { "thread" } else { "threads" },
            self.streams(),
            if self.streams() == 1 { "stream" } else { "streams" },
            o.synced.as_secs_f64(),
            o.frames,
            o.too_bright,
            o.greatest_light,
        )
    }

    fn gigapixels(&self, seconds: f64) -> f64 {
        let pixels = self.job.camera.sensor.geometry.pixels() as f64 * self.outcome.readouts as f64;
        pixels * self.streams() as f64 / seconds.max(1e-9) / 1e9
    }

    /// Only what a user may want to do something about.
    fn notes(&self, out: &Out) {
        let (o, names) = (self.outcome, self.names);
        let left = |path: &std::path::Path, flag: &str| {
            out.say(format_args!(
                "note: {} is of an earlier run and was left as it was; {flag}",
                path.display()
            ));
        };
        if o.clean.is_none() && names.clean.exists() {
            left(&names.clean, "--clean makes a new one");
        }
        if self.sidecar.images.is_none() && names.images.exists() {
            left(&names.images, "--images-every makes new ones");
        }
        if let Some(wanted) = self.job.readouts.filter(|&n| n > o.readouts) {
            out.say(format_args!("note: the input ended after {} of {wanted} readouts", o.readouts));
        }
        let thresholds = o.greatest_light * self.job.camera.sensor.thresholds_at_full_scale;
        if o.too_bright > 0 && thresholds < SATURATED {
            out.say(format_args!(
                "note: {} of {} frames held light beyond {} full scales, which was cut though no pixel is \
                 saturated there; --greatest-light {} keeps it",
                o.too_bright,
                o.frames,
                o.greatest_light,
                2.0 * o.greatest_light
            ));
        }
    }

    fn event(&self) -> Value {
        let (o, names) = (self.outcome, self.names);
        let (waited, kernel) = (o.waited.as_secs_f64(), o.kernel.as_secs_f64());
        let mut event = json!({
            "event": "done", "readouts": o.readouts, "seconds": self.seconds, "lasts_seconds": self.lasts_s(),
            "simulation_seconds": o.simulated.as_secs_f64(), "sync_seconds": o.synced.as_secs_f64(),
            "light_seconds": waited, "kernel_seconds": kernel,
            "gigapixel_readouts_per_second": self.gigapixels(kernel),
            "times_real_time": self.lasts_s() / self.seconds.max(1e-9),
            "kernel_times_real_time": self.lasts_s() / kernel.max(1e-9),
            "backend": self.job.backend.name(), "threads": self.job.threads,
            "noisy": names.noisy.display().to_string(), "digest": o.noisy.digest,
            "sidecar": names.sidecar.display().to_string(), "picture": names.picture.display().to_string(),
            "frames": o.frames, "frames_beyond_greatest_light": o.too_bright,
        });
        if let Some(clean) = &o.clean {
            event["clean"] = json!(clean.path.display().to_string());
            event["clean_digest"] = json!(clean.digest);
        }
        event
    }
}

/// A time with three digits, in ms or s.
fn duration(seconds: f64) -> String {
    let (value, unit) = if seconds < 1.0 { (1000.0 * seconds, "ms") } else { (seconds, "s") };
    let digits = 2 - (value.max(1.0).log10().floor() as usize).min(2);
    let text = format!("{value:.digits$}");
    let text = if digits > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} {unit}")
}

/// A pace in words: how often faster or slower than the camera.
fn pace(lasts_s: f64, took_s: f64) -> String {
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
    use super::{duration, pace};

    #[test]
    fn times_have_three_digits_at_most() {
        assert_eq!([0.025, 0.0001, 0.1234, 1.0].map(duration), ["25 ms", "0.1 ms", "123 ms", "1 s"]);
        assert_eq!([1.555, 60.0, 1234.0].map(duration), ["1.55 s", "60 s", "1234 s"]);
    }

    #[test]
    fn slower_is_said_as_slower() {
        assert_eq!(pace(0.025, 2.5), "100 times slower than the camera");
        assert_eq!(pace(0.025, 0.005), "5.0 times faster than the camera");
        assert_eq!(pace(1.0, 1.01), "as fast as the camera");
    }
}
