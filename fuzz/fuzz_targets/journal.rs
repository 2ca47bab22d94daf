//! Any bytes as the journal of a shard: at most as many lines as the bytes have, and a journal that is cut anywhere has no
//! line that the whole one lacks.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_dataset::shards::journal_lines;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::folder("journal"));

/// The lines of `data` as a journal; an error has none.
fn lines(data: &[u8]) -> usize {
    std::fs::write(FOLDER.join("journal.jsonl"), data).expect("a folder of its own");
    match journal_lines(&FOLDER) {
        Ok(lines) => lines,
        Err(error) => {
            spikelane_fuzz::check_error(&error);
            0
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let whole = lines(data);
    assert!(whole <= data.iter().filter(|b| **b == b'\n').count());
    assert!(lines(&data[..data.len() / 2]) <= whole);
});
