//! Writes pictures as a video with the installed ffmpeg.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::storage::PartialFile;

/// Encoding of the frames that are sent to ffmpeg.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FrameEncoding {
    /// 8-bit gray levels, row-major.
    Gray(Geometry),
    /// 8-bit red, green and blue of each pixel, row-major.
    Color(Geometry),
    /// PNG files.
    Png,
}

/// A running ffmpeg process. It writes to a hidden file name until all frames were sent.
pub(crate) struct VideoWriter {
    ffmpeg: Ffmpeg,
    stdin: Option<ChildStdin>,
    // This field is declared after the process, so that ffmpeg ends before its file is removed.
    partial: PartialFile,
    path: PathBuf,
}

/// The ffmpeg process. It is killed on drop.
struct Ffmpeg(Child);

impl VideoWriter {
    /// Starts ffmpeg with `fps` frames per second.
    pub(crate) fn start(path: &Path, pictures: FrameEncoding, fps: f64, force: bool) -> Result<Self> {
        // ffmpeg selects the container by the extension, so the hidden name must have the same extension.
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let partial = PartialFile::create_with_suffix(path, force, &format!(".{ending}"))?;
        let mut command = Command::new("ffmpeg");
        command.args(["-nostdin", "-v", "error", "-y"]);
        let rate = fps.to_string();
        match pictures {
            FrameEncoding::Gray(size) => {
                let size = size.to_string();
                command.args(["-f", "rawvideo", "-pix_fmt", "gray", "-s", &size, "-r", &rate]);
            }
            FrameEncoding::Color(size) => {
                let size = size.to_string();
                command.args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size, "-r", &rate]);
            }
            FrameEncoding::Png => {
                command.args(["-f", "image2pipe", "-c:v", "png", "-framerate", &rate]);
            }
        }
        let mut child = command
            // Most players require even side lengths and the pixel format 4:2:0.
            .args(["-i", "pipe:0", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"])
            .args(encoder_speed(&ending))
            .arg(Path::new(".").join(partial.hidden_path()))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(ffmpeg_error)?;
        Ok(Self { stdin: child.stdin.take(), ffmpeg: Ffmpeg(child), partial, path: path.to_owned() })
    }

    /// Sends the next frame to ffmpeg.
    pub(crate) fn push(&mut self, picture: &[u8]) -> Result<()> {
        match self.stdin.as_mut().map(|pipe| pipe.write_all(picture)) {
            Some(Err(e)) => Err(self.write_error(e)),
            _ => Ok(()),
        }
    }

    /// Waits until ffmpeg ends, and renames the file to its final name.
    pub(crate) fn finish(mut self) -> Result<()> {
        drop(self.stdin.take());
        let status = self.ffmpeg.0.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        if !status.success() {
            return Err(self.write_error(status));
        }
        self.partial.commit().map(drop)
    }

    fn write_error(&self, why: impl std::fmt::Display) -> Error {
        Error::new(ErrorKind::Tool, self.path.display())
            .found(why)
            .expected("ffmpeg to encode the video")
            .remedy("see the messages of ffmpeg above, or write images")
    }
}

/// Returns options of ffmpeg for fast encoders. The default settings take five to thirty times as long per frame, and the
/// noise of spikes hardly compresses better with them.
fn encoder_speed(ending: &str) -> &'static [&'static str] {
    match ending.to_lowercase().as_str() {
        "mp4" | "mov" | "mkv" => &["-preset", "ultrafast"],
        "webm" => &["-deadline", "realtime", "-cpu-used", "8"],
        _ => &[],
    }
}

fn ffmpeg_error(error: std::io::Error) -> Error {
    let found =
        if error.kind() == io::ErrorKind::NotFound { "no such program".into() } else { error.to_string() };
    Error::new(ErrorKind::Tool, "ffmpeg")
        .found(found)
        .expected("ffmpeg, which encodes video")
        .remedy("install ffmpeg (apt install ffmpeg, brew install ffmpeg), or write images")
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // If ffmpeg has already ended, both calls have no effect.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
