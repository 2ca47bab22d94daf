//! Implements `spikelane benchmark seal` and `spikelane benchmark reveal`.

use std::path::PathBuf;

use serde_json::json;

use super::generate::{GenerateArgs, generate};
use crate::common::{Console, append_ending, claim_files};
use spikelane::Result;
use spikelane::unstable::inputs::read_text;
use spikelane_benchmark::seal;
use spikelane_benchmark::suite::Suite;
use spikelane_io::storage;

/// Keep the seeds of a suite secret until a stated time
///
/// The command writes STEM.sealed.json, which you publish, and STEM.secret.json, which you publish after the submissions.
/// The sealed file contains the BLAKE3 digest of the secret file. Other users of the machine cannot read the secret file.
#[derive(clap::Args, Debug)]
pub(crate) struct SealArgs {
    /// Seal this suite: a name, or the path of a suite file
    suite: String,
    /// Write STEM.sealed.json and STEM.secret.json
    #[arg(short, long, value_name = "STEM")]
    output: PathBuf,
    /// Draw this many seeds at random
    ///
    /// Each seed gives as many scenes as the scored split of the suite has.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "seeds_from")]
    count: usize,
    /// Read the seeds from this file, one per line
    #[arg(long, value_name = "FILE")]
    seeds_from: Option<PathBuf>,
    /// Seal the camera in this TOML file instead of the camera of the suite
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
}

/// Open a sealed suite and generate it
///
/// The command compares the secret file with the commitment before it writes anything.
#[derive(clap::Args, Debug)]
pub(crate) struct RevealArgs {
    /// Open this sealed file
    sealed: PathBuf,
    /// Use this secret file
    secret: PathBuf,
    /// Use the suite file at this path [default: the suite of that name]
    #[arg(long, value_name = "FILE")]
    suite: Option<String>,
    #[command(flatten)]
    output: GenerateArgs,
}

/// Seals a suite.
///
/// # Errors
/// Those of [`seal::seal`].
pub(crate) fn run_seal(args: &SealArgs, out: &Console) -> Result<()> {
    let path = |ending: &str| append_ending(&args.output, ending);
    let (public, secret) = (path(".sealed.json"), path(".secret.json"));
    let _claim = claim_files([&public, &secret], false)?;
    let suite = Suite::load(&args.suite)?;
    let seeds = match &args.seeds_from {
        Some(file) => seal::read_seeds(file)?,
        None => seal::random_seeds(args.count)?,
    };
    let camera = args.camera.as_ref().map(|file| read_text(file, "a camera")).transpose()?;
    let sealed = seal::seal(&suite, seeds, camera)?;
    storage::write_small_private(&secret, &sealed.secret, false)?;
    storage::write_small(&public, &sealed.public, false)?;
    let event = json!({
        "event": "sealed", "sealed": public.display().to_string(), "secret": secret.display().to_string(),
        "commitment": sealed.commitment,
    });
    out.print_result(
        &event,
        &format!(
            "publish {}\nkeep {} secret\ncommitment {}\n",
            public.display(),
            secret.display(),
            sealed.commitment
        ),
    )
}

/// Opens a sealed suite.
///
/// # Errors
/// Those of [`seal::reveal`] and of the generation.
pub(crate) fn run_reveal(args: &RevealArgs, out: &Console) -> Result<()> {
    let name = match &args.suite {
        Some(name) => name.clone(),
        None => seal::sealed_name(&args.sealed)?,
    };
    let suite = seal::reveal(&Suite::load(&name)?, &args.sealed, &args.secret)?;
    generate(&suite, &args.output, out)
}
