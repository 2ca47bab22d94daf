//! Pictures as a video, through the user's own ffmpeg.

use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};

use spikelane::{Error, Kind, Result};

use super::{Args, Shown, Sink};

/// A running ffmpeg that writes under a hidden name until all pictures are in.
pub struct Video {
    child: Child,
    pictures: Option<ChildStdin>,
    hidden: PathBuf,
    path: PathBuf,
    shown: Shown,
}

impl Video {
    pub fn new(args: &Args, shown: Shown) -> Result<Self> {
        let path = args.output.clone();
        if !args.force && path.symlink_metadata().is_ok() {
            return Err(Error::new(Kind::Exists, path.display())
                .found("a file of that name")
                .expected("a free name")
                .remedy("choose another output, or allow overwriting with --force"));
        }
        // ffmpeg takes the container from the ending, which therefore stays last.
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let hidden = path.with_file_name(format!(".{}.partial.{name}", std::process::id()));
        let size = shown.geometry.to_string();
        let mut child = Command::new("ffmpeg")
            .args(["-nostdin", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-s", &size])
            .args(["-r", &args.fps.to_string(), "-i", "pipe:0"])
            // Most players want even sides and 4:2:0.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"])
            .arg(std::path::Path::new(".").join(&hidden))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(missing)?;
        Ok(Self { pictures: child.stdin.take(), child, hidden, path, shown })
    }

    fn failed(&self, why: impl std::fmt::Display) -> Error {
        Error::new(Kind::Tool, self.path.display())
            .found(why)
            .expected("ffmpeg to encode the pictures")
            .remedy("see its words above, or write a folder of PNGs")
    }
}

fn missing(error: std::io::Error) -> Error {
    let found =
        if error.kind() == ErrorKind::NotFound { "no such program".into() } else { error.to_string() };
    Error::new(Kind::Tool, "ffmpeg")
        .found(found)
        .expected("ffmpeg, which encodes video")
        .remedy("install it (apt install ffmpeg, brew install ffmpeg), or write .npy or a folder of PNGs")
}

impl Sink for Video {
    fn put(&mut self, _: usize, values: &[f32]) -> Result<()> {
        let image = self.shown.image(values);
        let wrote = self.pictures.as_mut().map(|pipe| pipe.write_all(image.as_raw()));
        match wrote {
            Some(Err(e)) => Err(self.failed(e)),
            _ => Ok(()),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        drop(self.pictures.take());
        let status = self.child.wait().map_err(|e| Error::io("waiting for ffmpeg", e))?;
        if !status.success() {
            return Err(self.failed(status));
        }
        std::fs::rename(&self.hidden, &self.path).map_err(|e| Error::io(self.path.display(), e))
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // After a good end both have nothing left to do.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.hidden);
    }
}
