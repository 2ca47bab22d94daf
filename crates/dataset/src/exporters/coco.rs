//! Writes the boxes and masks of each split to a file for the COCO tools. The path of the file is `SPLIT/coco.json`.
//!
//! In a COCO file, all images precede all annotations. However, each sequence provides its images and annotations
//! together. Therefore the images and the annotations are first written to separate files.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _, copy};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::hidden_file::HiddenFile;
use crate::{DatasetOptions, SequenceEntry, Split, labels};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{InnerPath, PARTIAL_ENDING, PlainName, read_bytes, utf8_bytes};
use spikelane_io::storage::{folders, sync};

/// Name of the file in the folder of a split.
pub(super) const FILE_NAME: &str = "coco.json";

/// Returns the path of a split's COCO file, relative to the folder of the dataset.
pub(super) fn path(split: Split) -> InnerPath {
    InnerPath::from(split.name()).join(FILE_NAME)
}

/// Writes the COCO file of a split.
pub(super) struct CocoWriter {
    path: PathBuf,
    images: ListWriter,
    annotations: ListWriter,
    categories: Value,
}

/// The list of images or the list of annotations of the COCO file, stored in a separate file. The values are separated
/// by commas.
struct ListWriter {
    file: BufWriter<File>,
    hidden_path: PathBuf,
    count: u64,
}

impl ListWriter {
    fn begin(root: &Path, split: Split, name: &'static str) -> Result<Self> {
        let hidden = folders::create_parents(root, &InnerPath::from(split.name()).join(name))?;
        let file = folders::create(&hidden)?;
        Ok(Self { file: BufWriter::new(file), hidden_path: hidden, count: 0 })
    }

    fn add(&mut self, value: &Value) -> Result<()> {
        let comma = if self.count > 0 { ",\n" } else { "" };
        self.count += 1;
        write!(self.file, "{comma}{value}").map_err(|e| Error::io(self.hidden_path.display(), e))
    }

    /// Appends the list to `file` and removes the list's own file.
    fn append_to(mut self, file: &mut File) -> std::io::Result<()> {
        self.file.flush()?;
        copy(&mut File::open(&self.hidden_path)?, file).map(drop)
    }
}

impl Drop for ListWriter {
    fn drop(&mut self) {
        // `drop` cannot report an error, so errors are ignored.
        let _ = fs::remove_file(&self.hidden_path);
    }
}

impl CocoWriter {
    /// Creates the COCO file of `split` in the dataset's folder `root`.
    pub(super) fn begin(root: &Path, split: Split) -> Result<Self> {
        Ok(Self {
            path: folders::create_parents(root, &path(split))?,
            images: ListWriter::begin(root, split, ".coco-images.spikelane.partial")?,
            annotations: ListWriter::begin(root, split, ".coco-annotations.spikelane.partial")?,
            categories: Value::Array(Vec::new()),
        })
    }

    /// Adds the images and annotations of a sequence. Their ids are increased by the number of images and annotations
    /// that the COCO file already contains.
    ///
    /// In the COCO file, `file_name` is the path of the image relative to the folder of the dataset.
    pub(super) fn add(&mut self, options: &DatasetOptions, entry: &SequenceEntry) -> Result<()> {
        let path =
            entry.path().join("labels").join(FILE_NAME).resolve_in(&options.output, options.access())?;
        let bytes = read_bytes(&path, "COCO lists", labels::MAX_LABEL_BYTES)?;
        let bad = |found: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Corrupt, path.display()).found(found).expected("COCO lists")
        };
        let mut annotations: Value = serde_json::from_slice(&utf8_bytes(&bytes)).map_err(|e| bad(&e))?;
        let below = entry.path().join("images");
        let (images_before, annotations_before) = (self.images.count, self.annotations.count);
        let shift = |value: &mut Value, key: &str, by: u64| -> Result<()> {
            // Indexing with `value[key]` would panic if the value is not an object, so `get_mut` is used.
            let number = value.get_mut(key);
            let number = number.ok_or_else(|| bad(&format_args!("no {key}")))?;
            let id = number.as_u64().and_then(|id| id.checked_add(by));
            *number = id.ok_or_else(|| bad(&format_args!("{key} = {number}")))?.into();
            Ok(())
        };
        if !annotations.is_object() {
            return Err(bad(&"no object"));
        }
        for image in annotations["images"].as_array_mut().into_iter().flatten() {
            shift(image, "id", images_before)?;
            let readout = image["readout"].as_u64().ok_or_else(|| bad(&"an image without a readout"))?;
            let name = PlainName::from_number(readout, 6)
                .with_ending(".")
                .with_ending(options.images.format.extension());
            image["file_name"] = below.join(name).as_str().into();
            image["sequence"] = entry.id.as_str().into();
            self.images.add(image)?;
        }
        for annotation in annotations["annotations"].as_array_mut().into_iter().flatten() {
            shift(annotation, "id", annotations_before)?;
            shift(annotation, "image_id", images_before)?;
            self.annotations.add(annotation)?;
        }
        self.categories = annotations["categories"].take();
        Ok(())
    }

    pub(super) fn finish(self) -> Result<()> {
        let hidden = self.path.with_file_name(format!(".{FILE_NAME}{PARTIAL_ENDING}"));
        let _draft = HiddenFile(&hidden);
        let joined = || -> std::io::Result<File> {
            let mut file = folders::create(&hidden).map_err(std::io::Error::other)?;
            file.write_all(b"{\"images\": [")?;
            self.images.append_to(&mut file)?;
            file.write_all(b"],\n\"annotations\": [")?;
            self.annotations.append_to(&mut file)?;
            write!(file, "],\n\"categories\": {}}}\n", self.categories)?;
            Ok(file)
        };
        let file = joined().map_err(|e| Error::io(self.path.display(), e))?;
        sync::sync_file(&file, &hidden)?;
        sync::rename(&hidden, &self.path)?;
        sync::sync_folder(self.path.parent().unwrap_or(Path::new(".")))
    }
}
