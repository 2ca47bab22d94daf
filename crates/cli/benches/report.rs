//! Runs `spikelane speed` as a benchmark, so that the program need not be built first. Example:
//! `cargo bench --bench report -- --markdown docs/why/performance.md`.

use std::ffi::OsString;
use std::process::ExitCode;

fn main() -> ExitCode {
    let command = ["spikelane", "speed"].map(OsString::from);
    // Cargo passes `--bench` to every benchmark, but the program does not accept this flag.
    let arguments = std::env::args_os().skip(1).filter(|a| a != "--bench");
    ExitCode::from(spikelane_cli::main(command.into_iter().chain(arguments)))
}
