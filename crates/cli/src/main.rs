//! The `spikelane` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(spikelane_cli::main_of_process())
}
