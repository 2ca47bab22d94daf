//! The native part of the Python package `spikelane`. Each part of the interface is in a separate file.
//!
//! The docstrings of public functions agree with the stubs. Code that need not be fast is in the Python files of the
//! package.

mod argument;
mod arrays;
mod batch;
mod camera;
mod dataset;
mod distribution;
mod error;
mod mosaic;
mod report;
mod scene;
mod simulator;
mod spike_frames;
mod spikes;
mod stream;
mod watch;

use pyo3::prelude::*;

/// Native part of the package; use the names in `spikelane`.
#[pymodule(gil_used = false)]
mod _native {
    #[pymodule_export]
    use super::argument::check_argument;
    #[pymodule_export]
    use super::batch::{light_at, simulate_batch};
    #[pymodule_export]
    use super::camera::{Camera, effects, presets};
    #[pymodule_export]
    use super::command;
    #[pymodule_export]
    use super::dataset::{DatasetReader, SequenceFiles};
    #[pymodule_export]
    use super::distribution::{CameraDistribution, check_camera};
    #[pymodule_export]
    use super::report::{calibrate, diagnose, measure};
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::simulator::Simulator;
    #[pymodule_export]
    use super::spike_frames::SpikeFrames;
    #[pymodule_export]
    use super::spikes::{pack, span_rates, tfi, tfp, unpack};
    #[pymodule_export]
    use super::stream::{Stream, open_stream, write_stream};

    #[pymodule_init]
    fn init(m: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::types::PyModuleMethods as _;
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

/// command(args)
/// --
///
/// Runs the `spikelane` program in this process and returns its exit code.
///
/// `args` contains the arguments of the program. The first argument is the name of the program.
#[pyfunction]
fn command(py: Python<'_>, args: Vec<String>) -> u8 {
    py.detach(|| spikelane_cli::main(args))
}
