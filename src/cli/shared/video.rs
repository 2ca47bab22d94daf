//! Pictures as a video, through the user's own ffmpeg.

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use crate::{Error, Geometry, Kind, Result};

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
    child: Child,
    pictures: Option<ChildStdin>,
    hidden: PathBuf,
    path: PathBuf,
}

impl Video {
    /// Starts ffmpeg; `fps` pictures a second.
    pub(crate) fn start(path: &Path, pictures: Pictures, fps: f64, force: bool) -> Result<Self> {
        if !force && path.symlink_metadata().is_ok() {
            return Err(Error::new(Kind::Exists, path.display())
                .found("a file of that name")
                .expected("a free name")
                .remedy("choose another output, or allow overwriting with --force"));
        }
        // ffmpeg takes the container from the ending, which therefore stays last.
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let hidden = path.with_file_name(format!(".{}.partial.{name}", std::process::id()));
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
            .arg(Path::new(".").join(&hidden))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(missing)?;
        Ok(Self { pictures: child.stdin.take(), child, hidden, path: path.to_owned() })
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
        let status = self.child.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        if !status.success() {
            return Err(self.failed(status));
        }
        std::fs::rename(&self.hidden, &self.path).map_err(|e| Error::io(self.path.display(), e))
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

impl Drop for Video {
    fn drop(&mut self) {
        // After a good end both have nothing left to do.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.hidden);
    }
}
