//! Serves a viewer of spike streams to a browser on this machine.
//!
//! [`Sources::open`] opens streams, data sets, recording sets, output folders and live cameras. [`Server`] answers the
//! requests of the page, and [`export_page`] returns a page that contains a short stream and needs no server.
//!
//! **Work of both sides.** The server reads only the window of an image from the file, and computes images with
//! [`spikelane::reconstruct`]. The page receives a table of rates and one index per pixel, and applies gain, gamma and
//! colors. Results over whole streams are computed once on a thread.
//!
//! **Access.** The server listens on 127.0.0.1 only. Every request must contain a random token and a local `Host`, and
//! names a path by its index among the paths that the user gave. The page loads nothing from other origins. Requests
//! without the token cannot occupy the server; see [`ConnectionLimits`].

mod access;
mod api;
mod blinking;
mod connections;
mod encoding;
mod export;
mod http;
mod jobs;
mod labels;
mod live;
mod page;
mod peer;
mod picture;
mod query;
mod region;
mod server;
mod sources;

pub use connections::ConnectionLimits;
pub use export::{MAX_PAGE_BYTES, export_page};
pub use server::{EndReason, Server};
pub use sources::{SourceOptions, Sources};
