//! `cargo bench --bench report -- --markdown docs/why/performance.md`: the measurement of
//! `spikelane bench`, for those who have not built the program.

use std::ffi::OsString;
use std::process::ExitCode;

fn main() -> ExitCode {
    let command = ["spikelane", "bench"].map(OsString::from);
    // Cargo passes `--bench` to every benchmark.
    let given = std::env::args_os().skip(1).filter(|a| a != "--bench");
    ExitCode::from(spikelane_cli::main(command.into_iter().chain(given)))
}
