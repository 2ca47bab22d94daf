//! Pictures as a video, through the user's own ffmpeg.

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use spikelane::{Error, Geometry, Kind, Result};
use spikelane_io::storage::Partial;

/// What is pushed, picture by picture.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pictures {
    /// 8-bit grey levels, row-major.
    Grey(Geometry),
    /// Whole PNG files.
    Png,
}

/// A running ffmpeg that writes under a hidden name until all pictures are in.
pub(crate) struct Video {
    ffmpeg: Ffmpeg,
    pictures: Option<ChildStdin>,
    // Behind the process that writes it, which ends first.
    partial: Partial,
    path: PathBuf,
}

/// The process; it ends with its owner.
struct Ffmpeg(Child);

impl Video {
    /// Starts ffmpeg; `fps` pictures a second.
    pub(crate) fn start(path: &Path, pictures: Pictures, fps: f64, force: bool) -> Result<Self> {
        // ffmpeg takes the container from the ending, which therefore comes last.
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let partial = Partial::create_ending(path, force, &format!(".{ending}"))?;
        let mut command = Command::new("ffmpeg");
        command.args(["-nostdin", "-v", "error", "-y"]);
        let rate = fps.to_string();
        match pictures {
            Pictures::Grey(size) => {
                let size = size.to_string();
                command.args(["-f", "rawvideo", "-pix_fmt", "gray", "-s", &size, "-r", &rate]);
            }
            Pictures::Png => {
                command.args(["-f", "image2pipe", "-c:v", "png", "-framerate", &rate]);
            }
        }
        let mut child = command
            // Most players want even sides and 4:2:0.
            .args(["-i", "pipe:0", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"])
            .arg(Path::new(".").join(partial.hidden()))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(missing)?;
        Ok(Self { pictures: child.stdin.take(), ffmpeg: Ffmpeg(child), partial, path: path.to_owned() })
    }

    /// Hands over the next picture.
    pub(crate) fn push(&mut self, picture: &[u8]) -> Result<()> {
        match self.pictures.as_mut().map(|pipe| pipe.write_all(picture)) {
            Some(Err(e)) => Err(self.failed(e)),
            _ => Ok(()),
        }
    }

    /// Waits for ffmpeg and gives the file its name.
    pub(crate) fn finish(mut self) -> Result<()> {
        drop(self.pictures.take());
        let status = self.ffmpeg.0.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        if !status.success() {
            return Err(self.failed(status));
        }
        self.partial.commit().map(drop)
    }

    fn failed(&self, why: impl std::fmt::Display) -> Error {
        Error::new(Kind::Tool, self.path.display())
            .found(why)
            .expected("ffmpeg to encode the pictures")
            .remedy("see its words above, or write pictures")
    }
}

fn missing(error: std::io::Error) -> Error {
    let found =
        if error.kind() == ErrorKind::NotFound { "no such program".into() } else { error.to_string() };
    Error::new(Kind::Tool, "ffmpeg")
        .found(found)
        .expected("ffmpeg, which encodes video")
        .remedy("install it (apt install ffmpeg, brew install ffmpeg), or write pictures")
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // After a good end both have nothing left to do.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
