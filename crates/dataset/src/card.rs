//! The papers that go with a dataset: datasheet and licence.

use crate::{DatasetOptions, Entry, Status, Structure, Work};
use spikelane::error::Result;
use spikelane_io::storage;

/// What a dataset holds, in numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Counts {
    /// Sequences of each split, in the order of the type's variants.
    splits: [u64; 3],
    failed: u64,
    readouts: u64,
    bytes: u64,
}

impl Counts {
    pub(crate) fn add(&mut self, entry: &Entry) {
        match entry.status {
            Status::Done => {
                self.splits[entry.split as usize] += 1;
                self.readouts = self.readouts.saturating_add(entry.readouts.unwrap_or(0));
                self.bytes = self.bytes.saturating_add(entry.bytes.unwrap_or(0));
            }
            Status::Failed => self.failed += 1,
            Status::Planned => {}
        }
    }
}

/// Writes `DATASHEET.md`, and `LICENSE.txt` if the user chose one.
pub(super) fn write(options: &DatasetOptions, counts: &Counts, digest: &str) -> Result<()> {
    let text = datasheet(options, counts, digest);
    storage::write_small(&options.output.join("DATASHEET.md"), text.as_bytes(), true)?;
    if let Some(licence) = &options.licence {
        let text = format!(
            "SPDX-License-Identifier: {licence}\n\nThis dataset is given on under {licence}, the choice of \
             whoever made it.\nThe program that made it claims no rights in it.\n"
        );
        storage::write_small(&options.output.join("LICENSE.txt"), text.as_bytes(), true)?;
    }
    Ok(())
}

fn datasheet(options: &DatasetOptions, counts: &Counts, digest: &str) -> String {
    let Counts { splits: [train, validation, test], failed, readouts, bytes } = counts;
    let sensor = &options.camera.sensor;
    let origin = origin(options);
    let effects: Vec<_> = options.camera.effects().iter().map(|e| e.name()).collect();
    format!(
        "# Datasheet\n\n## What it is\n\n{origin}\n\n| | |\n|---|---|\n| sequences for training | {train} |\n\
         | sequences for validation | {validation} |\n| sequences for testing | {test} |\n| set aside | {failed} |\n| readouts | {readouts} |\n\
         | bytes | {bytes} |\n| digest | {digest} |\n| rate of ground truth 255 | {} |\n| camera | {} |\n| size, width x height | {} |\n| readouts a second | {} |\n\
         | effects | {} |\n| seed, camera seed | {}, {} |\n| version of the data | {} |\n| licence | {} |\n| made by | spikelane {} |\n\n\
         ## How it lies\n\n`manifest.jsonl` lists all sequences. `sequences/ID/stream.dat` is the noisy stream, \
         `stream.clean.dat` its noise-free twin\nwith the same start phase; both have no header, one bit per pixel, least \
         significant bit first, bottom row first.\n`stream.json` says how they were made. `clear.png` is the light of \
         readout floor(readouts / 2), counted from 0, 8-bit sRGB;\n`gt.png`, linked as `gt/ID.png`, is the same light with codes \
         proportional to the rate: spikes per pixel and readout are\n{} times code / 255{}; \
         where a code is 255 the light may be brighter.\n`images/NNNNNN.*` is the light at readout NNNNNN, and `labels/NNNNNN.*` what is \
         seen at readout NNNNNN. `record.json` holds the digest of every\nfile. `train`, `validation` and `test` hold links for loaders.\n\n\
         ## What it is not\n\nSimulated: no camera took it. A network trained on it should be tested on recordings.\n",
        options.structure.rate_at_255(),
        options.cameras.names(&options.camera),
        sensor.geometry,
        sensor.readout_hz,
        effects.join(", "),
        options.seed,
        options.camera_seed,
        options.data_version.as_deref().unwrap_or("none given"),
        options.licence.as_deref().unwrap_or("none chosen"),
        env!("CARGO_PKG_VERSION"),
        options.structure.rate_at_255(),
        loader(options),
    )
}

/// What the dataset was made of, for people.
pub(super) fn origin(options: &DatasetOptions) -> String {
    match &options.work {
        Work::Drives(d) => format!(
            "Random driving scenes, drawn by the program: {} images each, {} readout(s) from one image to the \
             next, labels at every {} image(s) (0: none).\nNo person, place or vehicle in them is real.",
            d.images, d.readouts_per_image, d.label_every
        ),
        Work::Inputs(i) => format!(
            "Videos and image folders of the user, {} ({}). Their rights remain theirs.",
            i.readouts_per_frame
                .map_or("readouts as times and rates say".to_owned(), |n| format!("{n} readouts per frame")),
            i.insertion
        ),
    }
}

/// How the loader of the structure is told of the rate.
fn loader(options: &DatasetOptions) -> String {
    let geometry = options.camera.sensor.geometry;
    match options.structure {
        Structure::SpikeCv => ", as SpikeCV's own pictures are".to_owned(),
        Structure::SpikeZoo => format!(
            " (`BaseDatasetConfig(width={}, height={}, rate={})` of Spike-Zoo)",
            geometry.width(),
            geometry.height(),
            options.structure.rate_at_255()
        ),
    }
}
