//! Implements `spikelane view`.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;

use serde_json::json;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::storage;
use spikelane_view::{EndReason, Server, SourceOptions, Sources, export_page};

use crate::common::{Console, CropArg, ReadoutRange, StreamArgs, claim_files, stop_flag};

/// Show streams and data sets in the browser
///
/// A PATH is a stream, a data set, a packed shard, a recording set, an output folder, or shm:NAME for a live camera. Two
/// streams are shown side by side. The viewer listens on 127.0.0.1 only and uses no network. It ends with Ctrl-C, or 5
/// seconds after its last page is closed. Press ? in the page for its keys.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Show these streams, data sets or folders
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    stream: StreamArgs,
    /// Set the readouts per second [default: from the sidecar]
    #[arg(long, value_name = "HZ", help_heading = "Stream")]
    readout_hz: Option<f64>,
    /// Listen on this port [default: a free port]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,
    /// Print the address, but do not open a browser
    #[arg(long)]
    no_browser: bool,
    /// Open the page in this state
    ///
    /// The state is the text after # in the address of another page of the viewer.
    #[arg(long, value_name = "STATE", value_parser = parse_state)]
    state: Option<String>,
    /// Write a page that works without the program
    ///
    /// The page contains a part of one stream and has at most 20 MB.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "no_browser", "state"])]
    export: Option<PathBuf>,
    /// Export these readouts, such as 0..1000 [default: all]
    #[arg(long, value_name = "A..B", requires = "export")]
    readouts: Option<ReadoutRange>,
    /// Export this rectangle in pixels
    #[arg(long, value_name = "X,Y,W,H", requires = "export")]
    crop: Option<CropArg>,
    /// Overwrite an existing file
    #[arg(long, requires = "export")]
    force: bool,
}

/// Accepts the characters that a state of the page contains.
fn parse_state(text: &str) -> std::result::Result<String, &'static str> {
    let state = text.trim_start_matches('#');
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "=&.,-_".contains(c);
    if state.chars().all(is_plain) {
        Ok(state.to_owned())
    } else {
        Err("expected the text after # in the address of the viewer")
    }
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let claim = args.export.as_ref().map(|path| claim_files([path], args.force)).transpose()?;
    if args.readout_hz.is_some_and(|hz| !(hz.is_finite() && hz > 0.0)) {
        return Err(Error::new(ErrorKind::Usage, "--readout-hz").expected("a positive number"));
    }
    let options = SourceOptions::default()
        .with_open(args.stream.options("--width and --height")?)
        .with_readout_hz(args.readout_hz);
    let sources = Sources::open(&args.paths, &options)?;
    for warning in sources.warnings() {
        out.print_message(format_args!("warning: {warning}"));
    }
    if let (Some(path), Some(_claim)) = (&args.export, claim) {
        let range = args.readouts.unwrap_or_default().resolve(sources.only_readouts()?);
        let page = export_page(&sources, range.clone(), args.crop.map(|c| c.0))?;
        storage::write_small(path, page.as_bytes(), args.force)?;
        out.print_message(format_args!("{}  {} readouts", path.display(), range.len()));
        let file = path.display().to_string();
        let event =
            json!({"event": "done", "file": file, "bytes": page.len(), "readouts": [range.start, range.end]});
        return out.print_event(&event);
    }
    let server = Server::bind(sources, args.port)?;
    let state = args.state.as_ref().map_or(String::new(), |state| format!("#{state}"));
    let address = format!("{}{state}", server.address());
    // Other users can read the arguments of a program, so the browser receives an address without the token. The page keeps
    // the text after `#` when the server leads the browser to it.
    let one_time_address = server.one_time_address().map(|address| address + &state);
    out.print_result(&json!({"event": "view", "address": address}), &format!("{address}\n"))?;
    if !args.no_browser && !one_time_address.is_some_and(|address| open_browser(&address)) {
        out.print_message("note: no browser was started; open the address above");
    }
    let stop = stop_flag()?;
    match server.run(&mut || stop.load(Ordering::Relaxed))? {
        EndReason::Stopped => {
            Err(Error::new(ErrorKind::Interrupted, "stopped on request").remedy("nothing was written"))
        }
        _ => Ok(()),
    }
}

/// Starts the default browser. Returns whether it started.
fn open_browser(address: &str) -> bool {
    let (program, arguments): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("rundll32", &["url.dll,FileProtocolHandler"])
    } else {
        ("xdg-open", &[])
    };
    let mut command = Command::new(program);
    command.args(arguments).arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().is_ok()
}
