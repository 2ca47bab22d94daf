//! Uses any bytes as a `score.json`. The bytes must be rejected, or the scores must be equal after writing and reading.
//! No text of the file becomes HTML or a comment in the Markdown tables of a report.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_benchmark::report::{ScoredMethod, markdown};
use spikelane_fuzz::{check_file_error, temp_folder};

static PATH: LazyLock<PathBuf> = LazyLock::new(|| temp_folder("score").join("score.json"));

fn read(bytes: &[u8]) -> spikelane::Result<ScoredMethod> {
    std::fs::write(&*PATH, bytes).expect("a temporary file");
    ScoredMethod::read(&PATH)
}

fuzz_target!(|data: &[u8]| {
    let method = match read(data) {
        Ok(method) => method,
        Err(error) => return check_file_error(&error),
    };
    let written = method.file.to_json().expect("a file that was read");
    let again = read(&written).expect("the same file");
    assert_eq!(again.file.to_json().expect("a file that was read"), written);
    match markdown(&[method, again], "unknown") {
        Ok(page) => assert!(!page.contains('<'), "{page}"),
        Err(error) => check_file_error(&error),
    }
});
