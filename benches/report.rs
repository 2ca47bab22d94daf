//! `cargo bench --bench report -- --markdown docs/performance.md`: the measurement of
//! `spikelane bench`, for those who have not built the program.

#[path = "../src/cli/bench/mod.rs"]
mod bench;

use clap::Parser;

#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    bench: bench::BenchArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Cargo passes this to every benchmark
    #[arg(long = "bench", hide = true)]
    _bench: bool,
}

fn main() -> Result<(), spikelane::Error> {
    let arguments = Arguments::parse();
    bench::run(&arguments.bench, arguments.json)
}
