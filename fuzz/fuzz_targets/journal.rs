//! Uses any bytes as the journal of a shard. The journal must not have more lines than the bytes have line breaks. A
//! truncated journal must not have more lines than the whole journal.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_dataset::shards::count_journal_lines;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::temp_folder("journal"));

/// Returns the number of entries of the journal `data` before the first invalid or unterminated line. Returns 0 for an
/// error.
fn lines(data: &[u8]) -> usize {
    std::fs::write(FOLDER.join("journal.jsonl"), data).expect("a folder of its own");
    match count_journal_lines(&FOLDER) {
        Ok(lines) => lines,
        Err(error) => {
            spikelane_fuzz::check_error(&error);
            0
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let complete = lines(data);
    assert!(complete <= data.iter().filter(|b| **b == b'\n').count());
    assert!(lines(&data[..data.len() / 2]) <= complete);
});
