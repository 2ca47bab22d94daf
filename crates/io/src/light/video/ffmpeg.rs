//! All video formats except y4m. An installed `ffmpeg` decodes the video.
//!
//! ffprobe reports the encoding of the samples. ffmpeg decodes the samples without conversion and writes y4m to a
//! pipe. Interlaced frames are deinterlaced. No frame is duplicated or dropped. If the frame rate is not constant, the
//! frame times are read as well.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::capture_rate::CaptureRate;
use super::damage::{Damage, LogLine};
use super::probe::{VideoProbe, missing_program_error, single_file_args};
use super::y4m::Y4mSource;
use crate::light::images::linearization::Linearization;
use crate::light::resize_mode::ResizeMode;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::threads;

/// Maximum number of ffmpeg's last error lines that are reported.
const MAX_ERROR_LINES: usize = 4;

/// What ffmpeg reports while it decodes.
#[derive(Debug, Default)]
struct DecodingLog {
    last_errors: VecDeque<String>,
    damage: Damage,
    /// Names of the decoder and of the demuxer.
    names: Vec<String>,
    /// Whether the frames that are marked as corrupt are complete.
    ignores_corrupt_marks: bool,
    /// Width, height and pixel format of the frames.
    frame_format: Option<String>,
    /// The first other frame format.
    changed_format: Option<String>,
}

impl DecodingLog {
    fn add(&mut self, line: &str) {
        let parsed = LogLine::parse(line);
        let is_ignored = self.ignores_corrupt_marks && parsed.is_corrupt_mark();
        if parsed.is_damage(&self.names) && !is_ignored {
            self.damage.add(parsed.message);
        }
        if parsed.is_error() {
            if self.last_errors.len() == MAX_ERROR_LINES {
                self.last_errors.pop_front();
            }
            self.last_errors.push_back(parsed.message.to_owned());
        }
        let format = parsed.frame_format();
        match &self.frame_format {
            None => self.frame_format = format,
            Some(first) => {
                let changed = format.filter(|format| format != first);
                self.changed_format = self.changed_format.take().or(changed);
            }
        }
    }
}

/// A running ffmpeg process. The process is killed when this value is dropped.
struct FfmpegProcess {
    path: PathBuf,
    child: Child,
    log: Arc<Mutex<DecodingLog>>,
    log_thread: Option<JoinHandle<()>>,
}

impl FfmpegProcess {
    fn start(path: &Path, program: &str, probe: &VideoProbe) -> Result<Self> {
        let mut child = Command::new(program)
            // The format of the frames is in lines of the level verbose.
            .args(["-nostdin", "-nostats", "-v", "level+verbose"])
            .args(single_file_args(path))
            .args(["-map", "0:v:0", "-vf", &probe.filters()])
            .args(passthrough_args(program)?)
            // Strict y4m does not permit depths above 8 bits and some gray formats, so the strict mode is disabled.
            .args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| missing_program_error(program, e))?;
        let stderr = child.stderr.take();
        let log = Arc::new(Mutex::new(DecodingLog {
            damage: probe.damage.clone(),
            names: probe.log_names.clone(),
            ignores_corrupt_marks: probe.are_corrupt_only_at_joins,
            ..DecodingLog::default()
        }));
        let written = Arc::clone(&log);
        // A separate thread reads standard error. If nothing read the pipe, the pipe would become full and ffmpeg
        // would block.
        let read_log = move || {
            for line in stderr.into_iter().flat_map(|s| BufReader::new(s).split(b'\n')) {
                let Ok(line) = line else { break };
                locked(&written).add(&String::from_utf8_lossy(&line));
            }
        };
        let thread = std::thread::Builder::new().name("ffmpeg".into()).spawn(read_log);
        let mut process = Self { path: path.to_owned(), child, log, log_thread: None };
        process.log_thread =
            Some(thread.map_err(|_| threads::no_thread_error("read the messages of ffmpeg"))?);
        Ok(process)
    }

    /// Waits for the end of the process. Returns an error if the process failed.
    fn finish(&mut self) -> Result<()> {
        let status = self.child.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        let _ = self.log_thread.take().map(JoinHandle::join);
        if status.success() {
            return Ok(());
        }
        let lines: Vec<_> = locked(&self.log).last_errors.iter().cloned().collect();
        Err(Error::new(ErrorKind::Tool, self.path.display())
            .found(format_args!("ffmpeg ended with {status}: {}", lines.join(" | ")))
            .expected("a video that ffmpeg can decode")
            .remedy("check whether ffplay plays the video"))
    }

    /// Returns an error if the size or the pixel format of the frames changed.
    fn check_format(&self) -> Result<()> {
        let log = locked(&self.log);
        let (Some(first), Some(changed)) = (&log.frame_format, &log.changed_format) else { return Ok(()) };
        Err(Error::new(ErrorKind::Input, self.path.display())
            .found(format_args!("frames of {changed} after frames of {first}"))
            .expected("one size and one pixel format in the whole video")
            .remedy(
                "split the video where they change, or convert it with ffmpeg -vf scale=W:H,format=yuv420p",
            ))
    }
}

/// Locks the log. A panic of another thread cannot leave the log in an invalid state.
fn locked(log: &Mutex<DecodingLog>) -> MutexGuard<'_, DecodingLog> {
    log.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for FfmpegProcess {
    fn drop(&mut self) {
        // The errors of `kill` and `wait` are ignored, because the process may have ended already and `drop` cannot
        // report errors.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = self.log_thread.take().map(JoinHandle::join);
    }
}

/// Returns the arguments that prevent ffmpeg from duplicating or dropping frames. The name of the option changed in
/// ffmpeg 5.1.
fn passthrough_args(program: &str) -> Result<[&'static str; 2]> {
    let ran =
        Command::new(program).arg("-version").output().map_err(|e| missing_program_error(program, e))?;
    let text = String::from_utf8_lossy(&ran.stdout);
    Ok(if is_before_5_1(&text) { ["-vsync", "passthrough"] } else { ["-fps_mode", "passthrough"] })
}

/// Returns whether `text`, the output of `ffmpeg -version`, is from a version before 5.1. Development builds have no
/// version number and count as version 5.1 or later.
fn is_before_5_1(text: &str) -> bool {
    let word = text.split_whitespace().nth(2).unwrap_or_default().trim_start_matches('n');
    let mut numbers = word.split(|c: char| !c.is_ascii_digit()).map(str::parse::<u32>);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor) < (5, 1),
        (Some(Ok(major)), _) => major < 5,
        _ => false,
    }
}

/// A video that ffmpeg decodes, as a source of frames at the camera's size.
pub struct FfmpegSource {
    video: Y4mSource,
    process: FfmpegProcess,
    announced_frames: Option<u64>,
    times: Option<Vec<u64>>,
    capture_rate: Option<Rate>,
    /// Notes about tags of the file.
    notes: Vec<String>,
    accept_damage: bool,
    has_ended: bool,
}

impl FfmpegSource {
    /// Starts ffmpeg on a file and reads the header that ffmpeg writes. If `accept_damage` is set, damaged pictures are
    /// used as ffmpeg decodes them, and notes describe the damage.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`] if the file is damaged and `accept_damage` is not set.
    /// * [`ErrorKind::Io`] if the file cannot be read.
    /// * [`ErrorKind::Tool`] if ffmpeg is missing or cannot decode the file.
    /// * Errors of [`crate::light::y4m::Y4mReader::new`], which reads the output of ffmpeg.
    pub fn open(
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
        accept_damage: bool,
    ) -> Result<Self> {
        Self::open_with("ffmpeg", path, camera, resize_mode, linear, accept_damage)
    }

    /// As [`FfmpegSource::open`]. `program` is the name or path of ffmpeg.
    ///
    /// # Errors
    /// As [`FfmpegSource::open`].
    pub fn open_with(
        program: &str,
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
        accept_damage: bool,
    ) -> Result<Self> {
        // If the path were a pipe, ffmpeg would block. `InputFile::open` accepts only regular files.
        InputFile::open(path)?;
        let probe = VideoProbe::from_file(path, program)?;
        let name = path.display().to_string();
        if let Some(damage) = probe.damage.text().filter(|_| !accept_damage) {
            return Err(damage_error(&name, &damage));
        }
        let mut process = FfmpegProcess::start(path, program, &probe)?;
        let mut output = BufReader::new(
            process
                .child
                .stdout
                .take()
                .ok_or_else(|| Error::new(ErrorKind::Tool, program).found("no output pipe"))?,
        );
        // If ffmpeg fails, its output is empty. The error message of ffmpeg is then more informative than an error of
        // the y4m reader.
        if output.fill_buf().map_err(|e| Error::io(&name, e))?.is_empty() {
            process.finish()?;
            return Err(Error::new(ErrorKind::Tool, name)
                .found("no image from ffmpeg")
                .expected("a file with a video stream"));
        }
        let output: Box<dyn Read + Send> = Box::new(output);
        let mut notes = probe.notes.clone();
        let video = Y4mSource::with_sample_encoding(
            output,
            &name,
            camera,
            resize_mode,
            linear,
            probe.sample_encoding(),
        )?;
        if let Some((width, height)) = probe.visible_size
            && ![(width, height), (height, width)].contains(&video.coded_size())
        {
            notes.push(format!(
                "the file states that {width}x{height} pixels are visible, which is not used: whole frames are shown"
            ));
        }
        let notes = notes.iter().map(|note| format!("{name}: {note}")).collect();
        let used_rate = probe.capture_rate.filter(|rate| rate.is_used());
        let times = probe.times.map(|times| match used_rate {
            Some(rate) => rate.capture_times(&times),
            None => times,
        });
        Ok(Self {
            video,
            process,
            announced_frames: probe.frames,
            times,
            capture_rate: used_rate.and_then(CaptureRate::rate),
            notes,
            accept_damage,
            has_ended: false,
        })
    }

    /// Returns an error if ffmpeg has reported damage that is not accepted, or a change of the frames.
    fn check_log(&self) -> Result<()> {
        self.process.check_format()?;
        let damage = locked(&self.process.log).damage.text();
        match damage.filter(|_| !self.accept_damage) {
            Some(damage) => Err(damage_error(&self.process.path.display().to_string(), &damage)),
            None => Ok(()),
        }
    }
}

fn damage_error(name: &str, damage: &str) -> Error {
    Error::new(ErrorKind::Input, name)
        .found(format_args!("a damaged video: {damage}"))
        .expected("a video without damage")
        .remedy(format_args!(
            "copy or record the video again; to use the frames that ffmpeg decodes, set {}",
            Setting("accept_damage")
        ))
}

impl Source for FfmpegSource {
    fn geometry(&self) -> Geometry {
        self.video.geometry()
    }

    fn frames(&self) -> Option<u64> {
        None
    }

    fn announced_frames(&self) -> Option<u64> {
        self.announced_frames
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.has_ended {
            return Ok(false);
        }
        let next = self.video.next_frame(into);
        if matches!(next, Ok(true)) {
            self.check_log()?;
            return next;
        }
        self.has_ended = true;
        // If both ffmpeg and the reader fail, the error of ffmpeg is returned, because it explains why the frame is
        // truncated.
        self.process.finish()?;
        self.check_log()?;
        next
    }

    fn rate(&self) -> Option<Rate> {
        // If the frame rate varies, the declared rate is only an estimate and is not returned.
        self.capture_rate.or(self.video.rate()).filter(|_| self.times.is_none())
    }

    fn front_end(&self) -> FrontEnd {
        self.video.front_end()
    }

    fn full_scale(&self) -> FullScale {
        self.video.full_scale()
    }

    fn describe(&self) -> String {
        let rate = if self.times.is_some() { " at a variable rate" } else { "" };
        format!("{}{rate}, decoded by ffmpeg", self.video.describe())
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        self.video.stored_geometry()
    }

    fn frame_times(&self) -> Option<&[u64]> {
        self.times.as_deref()
    }

    fn notes(&self) -> Vec<String> {
        let damage = locked(&self.process.log).damage.text().filter(|_| self.accept_damage).map(|text| {
            format!(
                "{}: damaged: {text}; the frames are used as ffmpeg decodes them",
                self.process.path.display()
            )
        });
        self.notes.iter().cloned().chain(self.video.notes()).chain(damage).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_of_ffmpeg_are_distinguished() {
        for (text, before) in [
            ("ffmpeg version 5.1.9-0+deb12u1 Copyright", false),
            ("ffmpeg version 4.4.2-0ubuntu0.22.04.1 Copyright", true),
            ("ffmpeg version n6.0 Copyright", false),
            ("ffmpeg version 5.0 Copyright", true),
            ("ffmpeg version N-110223-gb18a9c2971 Copyright", false),
            ("", false),
        ] {
            assert_eq!(is_before_5_1(text), before, "{text}");
        }
    }
}
