//! The papers that go with a dataset: datasheet and licence.

use crate::dataset::{DatasetOptions, Manifest, Status, Structure, Work};
use crate::error::Result;
use crate::storage;

/// Writes `DATASHEET.md`, and `LICENSE.txt` if the user chose one.
pub(super) fn write(options: &DatasetOptions, manifest: &Manifest) -> Result<()> {
    let text = datasheet(options, manifest);
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

fn datasheet(options: &DatasetOptions, manifest: &Manifest) -> String {
    let done = || manifest.entries.iter().filter(|e| e.status == Status::Done);
    let count = |split: &str| done().filter(|e| e.split == split).count();
    let failed = manifest.entries.iter().filter(|e| e.status == Status::Failed).count();
    let readouts: u64 = done().filter_map(|e| e.readouts).sum();
    let bytes: u64 = done().filter_map(|e| e.bytes).sum();
    let sensor = &options.camera.sensor;
    let origin = match &options.work {
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
    };
    let effects: Vec<_> = options.camera.effects().iter().map(|e| e.name()).collect();
    format!(
        "# Datasheet\n\n## What it is\n\n{origin}\n\n| | |\n|---|---|\n| sequences for training | {} |\n\
         | sequences for testing | {} |\n| set aside | {failed} |\n| readouts | {readouts} |\n\
         | bytes | {bytes} |\n| rate of ground truth 255 | {} |\n| camera | {} |\n| size, width x height | {} |\n| readouts a second | {} |\n\
         | effects | {} |\n| seed, camera seed | {}, {} |\n| licence | {} |\n| made by | spikelane {} |\n\n\
         ## How it lies\n\n`manifest.jsonl` lists all sequences. `sequences/ID/stream.dat` is the noisy stream, \
         `stream.clean.dat` its noise-free twin\nwith the same start phase; both have no header, one bit per pixel, least \
         significant bit first, bottom row first.\n`stream.json` says how they were made. `clear.png` is the light of \
         readout floor(readouts / 2), counted from 0, 8-bit sRGB;\n`gt.png`, linked as `gt/ID.png`, is the same light with codes \
         proportional to the rate: spikes per pixel and readout are\n{} times code / 255{}; \
         where a code is 255 the light may be brighter.\n`images/NNNNNN.*` is the light at readout NNNNNN, and `labels/NNNNNN.*` what is \
         seen at readout NNNNNN. `record.json` holds the digest of every\nfile. `train` and `test` hold links for loaders.\n\n\
         ## What it is not\n\nSimulated: no camera took it. A network trained on it should be tested on recordings.\n",
        count("train"),
        count("test"),
        options.structure.rate_at_255(),
        options.camera.name,
        sensor.geometry,
        sensor.readout_hz,
        effects.join(", "),
        options.seed,
        options.camera_seed,
        options.licence.as_deref().unwrap_or("none chosen"),
        env!("CARGO_PKG_VERSION"),
        options.structure.rate_at_255(),
        loader(options),
    )
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
