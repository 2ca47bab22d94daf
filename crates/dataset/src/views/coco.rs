//! The boxes and masks of a split in one file for COCO's tools: `SPLIT/coco.json`.
//!
//! Images come before annotations in the file and are known with them, so both are written down apart and joined.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _, copy};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::{DatasetOptions, Entry, Split, frames};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{InnerPath, PlainName, read_bytes};
use spikelane_io::storage::{steps, trees};

/// Its name in the folder of a split.
pub(super) const NAME: &str = "coco.json";

/// Where the file of a split lies in the dataset's folder.
pub(super) fn path(split: Split) -> InnerPath {
    InnerPath::from(split.name()).join(NAME)
}

/// The file of a split in the making.
pub(super) struct Merged {
    path: PathBuf,
    images: Part,
    annotations: Part,
    categories: Value,
}

/// One of its lists: values joined by commas.
struct Part {
    file: BufWriter<File>,
    hidden: PathBuf,
    count: u64,
}

impl Part {
    fn begin(root: &Path, split: Split, name: &'static str) -> Result<Self> {
        let hidden = trees::prepare(root, &InnerPath::from(split.name()).join(name))?;
        let file = trees::create(&hidden)?;
        Ok(Self { file: BufWriter::new(file), hidden, count: 0 })
    }

    fn add(&mut self, value: &Value) -> Result<()> {
        let comma = if self.count > 0 { ",\n" } else { "" };
        self.count += 1;
        write!(self.file, "{comma}{value}").map_err(|e| Error::io(self.hidden.display(), e))
    }

    /// Writes what was added into `file`, and is gone.
    fn pour(mut self, file: &mut File) -> std::io::Result<()> {
        self.file.flush()?;
        copy(&mut File::open(&self.hidden)?, file).map(drop)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // Nobody is left to hear of a failure here.
        let _ = fs::remove_file(&self.hidden);
    }
}

impl Merged {
    /// Begins the file of `split` in the dataset's folder `root`.
    pub(super) fn begin(root: &Path, split: Split) -> Result<Self> {
        Ok(Self {
            path: trees::prepare(root, &path(split))?,
            images: Part::begin(root, split, ".coco-images.partial")?,
            annotations: Part::begin(root, split, ".coco-annotations.partial")?,
            categories: Value::Array(Vec::new()),
        })
    }

    /// Adds the images and annotations of a sequence under numbers of their own.
    ///
    /// `file_name` is the picture's path below the dataset's folder.
    pub(super) fn add(&mut self, options: &DatasetOptions, entry: &Entry) -> Result<()> {
        let path = entry.path().join("labels").join(NAME).below(&options.output, options.access())?;
        let bytes = read_bytes(&path, "COCO's lists", frames::MAX_BYTES)?;
        let bad = |found: &dyn std::fmt::Display| {
            Error::new(Kind::Corrupt, path.display()).found(found).expected("COCO's lists")
        };
        let mut own: Value = serde_json::from_slice(&bytes).map_err(|e| bad(&e))?;
        let below = entry.path().join("images");
        let (images_before, annotations_before) = (self.images.count, self.annotations.count);
        let shift = |value: &mut Value, key: &str, by: u64| -> Result<()> {
            // Indexing a value that is no object would panic.
            let number = value.get_mut(key);
            let number = number.ok_or_else(|| bad(&format_args!("no {key}")))?;
            let id = number.as_u64().and_then(|id| id.checked_add(by));
            *number = id.ok_or_else(|| bad(&format_args!("{key} = {number}")))?.into();
            Ok(())
        };
        if !own.is_object() {
            return Err(bad(&"no object"));
        }
        for image in own["images"].as_array_mut().into_iter().flatten() {
            shift(image, "id", images_before)?;
            let readout = image["readout"].as_u64().ok_or_else(|| bad(&"an image without readout"))?;
            let name = PlainName::number(readout, 6).with(".").with(options.images.form.extension());
            image["file_name"] = below.join(name).as_str().into();
            image["sequence"] = entry.id.as_str().into();
            self.images.add(image)?;
        }
        for annotation in own["annotations"].as_array_mut().into_iter().flatten() {
            shift(annotation, "id", annotations_before)?;
            shift(annotation, "image_id", images_before)?;
            self.annotations.add(annotation)?;
        }
        self.categories = own["categories"].take();
        Ok(())
    }

    pub(super) fn finish(self) -> Result<()> {
        let hidden = self.path.with_file_name(format!(".{NAME}.partial"));
        let joined = || -> std::io::Result<File> {
            let mut file = trees::create(&hidden).map_err(std::io::Error::other)?;
            file.write_all(b"{\"images\": [")?;
            self.images.pour(&mut file)?;
            file.write_all(b"],\n\"annotations\": [")?;
            self.annotations.pour(&mut file)?;
            write!(file, "],\n\"categories\": {}}}\n", self.categories)?;
            Ok(file)
        };
        let file = joined().map_err(|e| Error::io(self.path.display(), e))?;
        steps::sync_file(&file, &hidden)?;
        steps::rename(&hidden, &self.path)?;
        steps::sync_folder(self.path.parent().unwrap_or(Path::new(".")))
    }
}
