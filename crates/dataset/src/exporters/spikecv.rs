//! Writes a `config.yaml` for each kind of label, and separate folders for the labels of scenes. SpikeCV reads these
//! files.
//!
//! A SpikeCV configuration supports only one file extension. Therefore boxes (for detection and tracking), depth and
//! flow have separate root folders below `spikecv`.

use super::mot;
use crate::hidden_file::{link_or_copy, write_if_changed};
use crate::labels::LabeledFrame;
use crate::{DatasetLayout, DatasetOptions, SequenceEntry};
use spikelane::error::Result;
use spikelane::unstable::inputs::{InnerPath, PlainName};
use spikelane_io::storage;

/// Kinds of labels. Each element contains the folder name, SpikeCV's type numbers and the file extension of one kind.
const LABEL_KINDS: [(&str, &str, &str); 3] =
    [("boxes", "[4, 5]", "txt"), ("depth", "[3.1]", "npy"), ("flow", "[2]", "flo")];

fn config_text(options: &DatasetOptions, numbers: &str, ending: &str, labels: &str) -> String {
    let geometry = options.camera.sensor.geometry;
    let name = options.output.file_name().unwrap_or_default().to_string_lossy();
    format!(
        "filename: {}\nspike_w: {}\nspike_h: {}\nis_labeled: true\nlabeled_data_type: {numbers}\n\
         labeled_data_suffix: {ending}\ndata_field_identifier: spike\nlabel_field_identifier: {labels}\n",
        serde_json::Value::from(name.as_ref()),
        geometry.width(),
        geometry.height(),
    )
}

/// Writes the SpikeCV configuration of the ground truth to `config.yaml` in the folder of the dataset.
pub(crate) fn write_config(options: &DatasetOptions) -> Result<()> {
    if options.dataset_layout != DatasetLayout::SpikeCv {
        return Ok(());
    }
    let text = config_text(options, "[1]", "png", "gt");
    storage::write_small(&options.output.join("config.yaml"), text.as_bytes(), true)
}

/// Creates links to the stream and the labels of a scene at the paths that SpikeCV expects. These paths are
/// `spikecv/KIND/SPLIT/spike/ID/ID.dat` and `spikecv/KIND/SPLIT/KIND/ID/...`. Returns the number of files that were
/// copied.
pub(super) fn link_labels(
    options: &DatasetOptions,
    entry: &SequenceEntry,
    frames: &[LabeledFrame],
) -> Result<u64> {
    if options.dataset_layout != DatasetLayout::SpikeCv {
        return Ok(0);
    }
    let (root, access, id) = (&options.output, options.access(), &entry.id);
    let own = |file: InnerPath| entry.path().join(file).resolve_in(root, access);
    let mut copied = 0;
    for (kind, numbers, ending) in LABEL_KINDS {
        let folder = InnerPath::from("spikecv").join(kind);
        write_if_changed(
            root,
            &folder.join("config.yaml"),
            config_text(options, numbers, ending, kind).as_bytes(),
        )?;
        let split = folder.join(entry.split.name());
        let stream = split.join("spike").join(id).join(id.with_ending(".dat"));
        copied += link_or_copy(&own("stream.dat".into())?, root, &stream)?;
        let labels = split.join(kind).join(id);
        if kind == "boxes" {
            write_if_changed(root, &labels.join(id.with_ending(".txt")), mot::track_text(frames).as_bytes())?;
            continue;
        }
        // Forward flow is the flow to the next labeled readout. The last labeled readout has no next readout and
        // therefore no forward flow.
        let (what, count) =
            if kind == "flow" { (".forward.flo", frames.len() - 1) } else { (".depth.npy", frames.len()) };
        for frame in &frames[..count] {
            let name = PlainName::from_number(frame.readout, 6);
            let from = own(InnerPath::from("labels").join(name.with_ending(what)))?;
            copied += link_or_copy(&from, root, &labels.join(name.with_ending(".").with_ending(ending)))?;
        }
    }
    Ok(copied)
}
