//! Flags that say how to read a stream.

use std::path::Path;

use clap::builder::PossibleValuesParser;
use spikelane::formats::{Layout, Reader};
use spikelane::{Error, Geometry, Kind, Result};

#[derive(clap::Args, Clone, Debug)]
pub struct StreamArgs {
    /// Width in pixels [default: from the sidecar or the file's header]
    #[arg(long, value_name = "PIXELS")]
    pub width: Option<u32>,
    /// Height in pixels [default: from the sidecar or the file's header]
    #[arg(long, value_name = "PIXELS")]
    pub height: Option<u32>,
    /// Layout of the file [default: from the sidecar or the file's header, else dat]
    #[arg(long, value_name = "LAYOUT",
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub layout: Option<String>,
}

impl StreamArgs {
    pub fn open(&self, path: &Path) -> Result<Reader> {
        let geometry = match (self.width, self.height) {
            (Some(width), Some(height)) => Some(Geometry::new(width, height)?),
            (None, None) => None,
            _ => {
                return Err(Error::new(Kind::Usage, path.display())
                    .found("only one of --width and --height")
                    .expected("both or neither"));
            }
        };
        let layout = self.layout.as_deref().map(Layout::parse).transpose()?;
        Reader::open(path, layout, geometry)
    }
}
