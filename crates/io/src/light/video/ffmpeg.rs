//! Any other video, through the user's own `ffmpeg`.
//!
//! ffprobe says how the codes are meant; ffmpeg decodes and writes them as they are, as y4m into a pipe.
//! Interlaced frames are deinterlaced. Every frame comes once: where they come at no one rate, their times say when.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

use super::probe::{Probe, missing, one_file};
use super::y4m::Video;
use crate::light::fit::Fit;
use crate::light::pictures::picture::Linear;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::threads;

/// The last lines of ffmpeg's complaints that an error repeats.
const LAST_LINES: usize = 4;

/// A running ffmpeg; it ends when this is dropped.
struct Process {
    path: PathBuf,
    child: Child,
    complaints: Option<JoinHandle<VecDeque<String>>>,
}

impl Process {
    fn start(path: &Path, program: &str, filters: &str) -> Result<Self> {
        let mut child = Command::new(program)
            .args(["-nostdin", "-v", "error"])
            .args(one_file(path))
            .args(["-map", "0:v:0", "-vf", filters])
            .args(each_frame_once(program)?)
            // More than 8 bits, and other names of grey, are not strict y4m.
            .args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| missing(program, e))?;
        let stderr = child.stderr.take();
        // Read on a thread of its own: a full pipe of complaints would stop ffmpeg, and then us.
        let complaints = move || {
            let mut last = VecDeque::new();
            for line in stderr.into_iter().flat_map(|s| BufReader::new(s).split(b'\n')) {
                let Ok(line) = line else { break };
                if last.len() == LAST_LINES {
                    last.pop_front();
                }
                last.push_back(String::from_utf8_lossy(&line).trim_end().to_owned());
            }
            last
        };
        let thread = std::thread::Builder::new().name("ffmpeg".into()).spawn(complaints);
        let mut process = Self { path: path.to_owned(), child, complaints: None };
        process.complaints = Some(thread.map_err(|_| threads::no_thread("read what ffmpeg prints"))?);
        Ok(process)
    }

    /// Waits for the end and says whether it was a good one.
    fn finish(&mut self) -> Result<()> {
        let status = self.child.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        let complaints = self.complaints.take().and_then(|c| c.join().ok());
        if status.success() {
            return Ok(());
        }
        let lines: Vec<_> = complaints.unwrap_or_default().into();
        Err(Error::new(Kind::Tool, self.path.display())
            .found(format_args!("ffmpeg ended with {status}: {}", lines.join(" | ")))
            .expected("a video that ffmpeg can decode")
            .remedy("try to play it with ffplay"))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may be over already, and there is nobody left to tell.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Some(complaints) = self.complaints.take() {
            let _ = complaints.join();
        }
    }
}

/// The arguments after which frames are neither repeated nor left out: they changed their name with ffmpeg 5.1.
fn each_frame_once(program: &str) -> Result<[&'static str; 2]> {
    let ran = Command::new(program).arg("-version").output().map_err(|e| missing(program, e))?;
    let text = String::from_utf8_lossy(&ran.stdout);
    Ok(if is_before_5_1(&text) { ["-vsync", "passthrough"] } else { ["-fps_mode", "passthrough"] })
}

/// What `ffmpeg -version` begins with; builds between releases have no such number, and are new.
fn is_before_5_1(text: &str) -> bool {
    let word = text.split_whitespace().nth(2).unwrap_or_default().trim_start_matches('n');
    let mut numbers = word.split(|c: char| !c.is_ascii_digit()).map(str::parse::<u32>);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor) < (5, 1),
        (Some(Ok(major)), _) => major < 5,
        _ => false,
    }
}

/// A video that ffmpeg decodes, as frames at the camera's size.
pub struct Decoded {
    video: Video,
    process: Process,
    announced: Option<u64>,
    times: Option<Vec<u64>>,
    over: bool,
}

impl Decoded {
    /// Starts ffmpeg on a file and reads the header of what it writes.
    ///
    /// # Errors
    /// [`Kind::Io`] when the file cannot be read, [`Kind::Tool`] when ffmpeg is missing or cannot decode
    /// it; otherwise as [`crate::light::y4m::Reader::new`].
    pub fn open(path: &Path, camera: Geometry, fit: Fit, linear: Linear) -> Result<Self> {
        Self::open_with("ffmpeg", path, camera, fit, linear)
    }

    /// As [`Decoded::open`], with the name or path of the program.
    ///
    /// # Errors
    /// As [`Decoded::open`].
    pub fn open_with(program: &str, path: &Path, camera: Geometry, fit: Fit, linear: Linear) -> Result<Self> {
        // ffmpeg would wait for a pipe without end.
        InputFile::open(path)?;
        let probe = Probe::of(path, program)?;
        let mut process = Process::start(path, program, &probe.filters())?;
        let name = path.display().to_string();
        let mut output = BufReader::new(
            process
                .child
                .stdout
                .take()
                .ok_or_else(|| Error::new(Kind::Tool, program).found("no output pipe"))?,
        );
        // An ffmpeg that fails writes nothing at all, and its own words say more than ours.
        if output.fill_buf().map_err(|e| Error::io(&name, e))?.is_empty() {
            process.finish()?;
            return Err(Error::new(Kind::Tool, name)
                .found("no picture from ffmpeg")
                .expected("a file with a video stream"));
        }
        let output: Box<dyn Read + Send> = Box::new(output);
        let video = Video::with_known_codes(output, &name, camera, fit, linear, probe.known())?;
        Ok(Self { video, process, announced: probe.frames, times: probe.times, over: false })
    }
}

impl Source for Decoded {
    fn geometry(&self) -> Geometry {
        self.video.geometry()
    }

    fn frames(&self) -> Option<u64> {
        None
    }

    fn announced_frames(&self) -> Option<u64> {
        self.announced
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.over {
            return Ok(false);
        }
        let next = self.video.next_frame(into);
        if matches!(next, Ok(true)) {
            return next;
        }
        self.over = true;
        // Where both have something to say, ffmpeg knows why the frame was cut short.
        self.process.finish()?;
        next
    }

    fn rate(&self) -> Option<Rate> {
        // What the stream says of a variable rate is a guess.
        self.video.rate().filter(|_| self.times.is_none())
    }

    fn front_end(&self) -> FrontEnd {
        self.video.front_end()
    }

    fn describe(&self) -> String {
        let rate = if self.times.is_some() { " at a variable rate" } else { "" };
        format!("{}{rate}, decoded by ffmpeg", self.video.describe())
    }

    fn stored(&self) -> Option<Geometry> {
        self.video.stored()
    }

    fn times(&self) -> Option<&[u64]> {
        self.times.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_of_ffmpeg_are_told_apart() {
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
