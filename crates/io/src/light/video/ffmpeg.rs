//! All video formats except y4m. An installed `ffmpeg` decodes the video.
//!
//! ffprobe reports the encoding of the samples. ffmpeg decodes the samples without conversion and writes y4m to a
//! pipe. Interlaced frames are deinterlaced. No frame is duplicated or dropped. If the frame rate is not constant, the
//! frame times are read as well.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

use super::probe::{VideoProbe, missing_program_error, single_file_args};
use super::y4m::Y4mSource;
use crate::light::images::linearization::Linearization;
use crate::light::resize_mode::ResizeMode;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::threads;

/// Maximum number of ffmpeg's last error lines that are reported.
const MAX_ERROR_LINES: usize = 4;

/// A running ffmpeg process. The process is killed when this value is dropped.
struct FfmpegProcess {
    path: PathBuf,
    child: Child,
    stderr_lines: Option<JoinHandle<VecDeque<String>>>,
}

impl FfmpegProcess {
    fn start(path: &Path, program: &str, filters: &str) -> Result<Self> {
        let mut child = Command::new(program)
            .args(["-nostdin", "-v", "error"])
            .args(single_file_args(path))
            .args(["-map", "0:v:0", "-vf", filters])
            .args(passthrough_args(program)?)
            // Strict y4m does not permit depths above 8 bits and some gray formats, so the strict mode is disabled.
            .args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| missing_program_error(program, e))?;
        let stderr = child.stderr.take();
        // A separate thread reads standard error. If nothing read the pipe, the pipe would become full and ffmpeg
        // would block.
        let complaints = move || {
            let mut last = VecDeque::new();
            for line in stderr.into_iter().flat_map(|s| BufReader::new(s).split(b'\n')) {
                let Ok(line) = line else { break };
                if last.len() == MAX_ERROR_LINES {
                    last.pop_front();
                }
                last.push_back(String::from_utf8_lossy(&line).trim_end().to_owned());
            }
            last
        };
        let thread = std::thread::Builder::new().name("ffmpeg".into()).spawn(complaints);
        let mut process = Self { path: path.to_owned(), child, stderr_lines: None };
        process.stderr_lines =
            Some(thread.map_err(|_| threads::no_thread_error("read the messages of ffmpeg"))?);
        Ok(process)
    }

    /// Waits for the end of the process. Returns an error if the process failed.
    fn finish(&mut self) -> Result<()> {
        let status = self.child.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        let complaints = self.stderr_lines.take().and_then(|c| c.join().ok());
        if status.success() {
            return Ok(());
        }
        let lines: Vec<_> = complaints.unwrap_or_default().into();
        Err(Error::new(ErrorKind::Tool, self.path.display())
            .found(format_args!("ffmpeg ended with {status}: {}", lines.join(" | ")))
            .expected("a video that ffmpeg can decode")
            .remedy("check whether ffplay plays the video"))
    }
}

impl Drop for FfmpegProcess {
    fn drop(&mut self) {
        // The errors of `kill` and `wait` are ignored, because the process may have ended already and `drop` cannot
        // report errors.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Some(complaints) = self.stderr_lines.take() {
            let _ = complaints.join();
        }
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
    /// Notes about tags of the file that are not used.
    notes: Vec<String>,
    has_ended: bool,
}

impl FfmpegSource {
    /// Starts ffmpeg on a file and reads the header that ffmpeg writes.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if the file cannot be read.
    /// * [`ErrorKind::Tool`] if ffmpeg is missing or cannot decode the file.
    /// * Errors of [`crate::light::y4m::Y4mReader::new`], which reads the output of ffmpeg.
    pub fn open(
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
    ) -> Result<Self> {
        Self::open_with("ffmpeg", path, camera, resize_mode, linear)
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
    ) -> Result<Self> {
        // If the path were a pipe, ffmpeg would block. `InputFile::open` accepts only regular files.
        InputFile::open(path)?;
        let probe = VideoProbe::from_file(path, program)?;
        let mut process = FfmpegProcess::start(path, program, &probe.filters())?;
        let name = path.display().to_string();
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
        let notes = probe.notes.iter().map(|note| format!("{name}: {note}")).collect();
        let video = Y4mSource::with_sample_encoding(
            output,
            &name,
            camera,
            resize_mode,
            linear,
            probe.sample_encoding(),
        )?;
        let (announced_frames, times) = (probe.frames, probe.times);
        Ok(Self { video, process, announced_frames, times, notes, has_ended: false })
    }
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
            return next;
        }
        self.has_ended = true;
        // If both ffmpeg and the reader fail, the error of ffmpeg is returned, because it explains why the frame is
        // truncated.
        self.process.finish()?;
        next
    }

    fn rate(&self) -> Option<Rate> {
        // If the frame rate varies, the declared rate is only an estimate and is not returned.
        self.video.rate().filter(|_| self.times.is_none())
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
        self.notes.iter().cloned().chain(self.video.notes()).collect()
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
