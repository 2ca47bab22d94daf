//! The number of threads.

use super::console::Console;
use spikelane::unstable::Count;

#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct ThreadArgs {
    /// Set the number of threads [default and maximum: one per CPU]
    ///
    /// The result does not depend on the number of threads.
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

impl ThreadArgs {
    /// Returns the number of threads to use. Prints a message if it is smaller than the number that the user requested.
    pub(crate) fn thread_count(self, out: &Console) -> usize {
        let cpus = std::thread::available_parallelism().map_or(1, usize::from);
        let requested = self.threads.map_or(cpus, usize::from);
        if requested > cpus {
            out.print_message(format_args!(
                "note: the program uses {} instead of {requested}, because this machine has {}",
                Count(cpus, "thread"),
                Count(cpus, "CPU"),
            ));
        }
        requested.min(cpus)
    }
}
