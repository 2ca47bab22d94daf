//! Benchmarks of spike pipelines: suites, runs, scores, reports, and the metrics.
//!
//! A [`suite`] is a text file that determines every bit of the streams and references. The module [`generated`] writes
//! the data of a suite, [`run`] runs a method on every stream, [`score`] scores the outputs and verifies the scores,
//! [`report`] compares methods, and [`seal`] keeps seeds secret until a stated time.
//!
//! The name of a metric does not determine its value: programs use other data ranges, windows or matching rules under
//! the same name. In this crate, a metric is a function with a version. The table [`METRICS`] lists all metrics. The
//! golden vectors in `tests/golden` come from other programs, and the tests compare each metric with them to 1e-6. A
//! change that moves a value by more than 1e-6 raises the version.
//!
//! | module | metrics |
//! |---|---|
//! | [`image`] | PSNR and SSIM in three definitions, detail, blind noise levels, SSIMULACRA2 |
//! | [`flow`] | endpoint error, outliers |
//! | [`depth`] | relative error, logarithmic error, accuracy within a factor |
//! | [`detection`] | average precision and recall of COCO |
//! | [`tracking`] | HOTA and its parts |
//! | [`block_matching`] | no metric: optical flow between two images |
//! | [`aggregate`] | means over sequences, bootstrap intervals, paired differences |
//!
//! The functions compare an *output*, which a method computed, with a *reference*. An output that is missing, is not
//! finite or has a wrong size is a [`MetricError`] and never a number. The module [`score`] substitutes a trivial answer
//! for such an output.
//!
//! The results do not depend on threads. All sums are sums of `f64` in a fixed order.

pub mod aggregate;
pub mod block_matching;
mod bounding_box;
pub mod depth;
pub mod detection;
mod error;
pub mod flow;
pub mod generated;
pub mod image;
mod metric;
pub mod report;
pub mod run;
pub mod score;
pub mod seal;
pub mod suite;
pub mod tracking;

pub use bounding_box::BoundingBox;
pub use error::{MetricError, Result};
pub use metric::{Better, METRICS, Metric};
