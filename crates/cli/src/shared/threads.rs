//! How many threads run: what was asked for, as far as it helps.

use super::output::Out;

#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct ThreadArgs {
    /// Threads [default: one per CPU, which is also the most that helps]; the bits are the same for any number
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

impl ThreadArgs {
    /// The number that runs; says where it is less than what was asked for.
    pub(crate) fn number(self, out: &Out) -> usize {
        let cpus = std::thread::available_parallelism().map_or(1, usize::from);
        let asked = self.threads.map_or(cpus, usize::from);
        if asked > cpus {
            out.say(format_args!(
                "{cpus} threads for the {asked} asked for: this machine runs {cpus} at a time"
            ));
        }
        asked.min(cpus)
    }
}
