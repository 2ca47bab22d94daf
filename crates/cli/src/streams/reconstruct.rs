//! Implements `spikelane reconstruct`.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde_json::json;
use spikelane::reconstruct::{
    ColorMatrix, Demosaic, demosaic, isi_map, span_rates, tfi_with_open_pixels, tfp,
};
use spikelane::sensor::{Channel, Mosaic};
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::StreamReader;
use spikelane_measure::detect_mosaic;

use crate::common::{
    Console, CountProgress, MOVIE_EXTENSIONS, MovieFormat, MovieWriter, PictureFormat, StreamArgs,
    StreamMosaicArgs, claim_files, claim_folder, detection_note, is_dash, refuse_json, sample_readouts,
    stop_flag, white_rate,
};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;

mod sinks;

use sinks::{PictureSink, Target, create_array};

/// Number of pictures that a thread reconstructs per batch. The pictures of a batch are written when it is complete.
const BATCH_PICTURES: usize = 4;

/// Reconstruct images from a stream
///
/// The output is one image (.png, .exr), an array (.npy, f32), a folder of numbered PNGs, an animated image (.gif, .webp),
/// or a video by ffmpeg (.mp4, .mkv, .mov, .avi, .webm). Values of an array are spikes per readout, or for isi the length of an interval in readouts.
/// An .exr has linear f32 values with white at 1.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Read this stream file, or - for standard input
    file: PathBuf,
    /// Write a .png, .exr, .npy, animated image, video or folder
    ///
    /// - writes a PNG to standard output.
    #[arg(short, long, value_name = "PATH")]
    output: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// Use tfp, span, tfi or isi
    ///
    /// tfp is the number of spikes in a window, divided by its readouts. span is the number of intervals in a window,
    /// divided by the readouts from its first to its last spike. isi is the length of the interval around the readout,
    /// in readouts. tfi is 1 divided by this length.
    #[arg(long, value_enum, value_name = "METHOD", hide_possible_values = true, default_value_t = Method::Tfp)]
    method: Method,
    /// Reconstruct at this readout [default: the middle]
    #[arg(long, value_name = "READOUT", conflicts_with = "every")]
    at: Option<usize>,
    /// Set the window in readouts [default: 161]
    ///
    /// For tfp and span, the window is centered on the readout of the image. For tfi and isi, spikes are searched in
    /// this number of readouts on both sides, and the default is 300.
    #[arg(long, value_name = "READOUTS", value_parser = clap::value_parser!(u32).range(1..))]
    window: Option<u32>,
    /// Write one image per this many readouts
    ///
    /// The output must be a folder, an .npy file or a movie. Without --every, a folder or a movie has one image per
    /// window, and an .npy file has one image.
    #[arg(long, value_name = "READOUTS", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    #[command(flatten)]
    mosaic: StreamMosaicArgs,
    /// Set the demosaicing: bilinear, malvar, menon or none [default: bilinear for a color camera]
    ///
    /// malvar (Malvar, He and Cutler 2004) and menon (Menon et al. 2007) require a Bayer pattern. none writes the rates of
    /// the mosaic.
    #[arg(hide_short_help = true, long, value_name = "METHOD")]
    demosaic: Option<String>,
    /// Set the color conversion: matrix, white, gray-world or none [default: matrix]
    ///
    /// matrix inverts the spectral response of the sidecar. white divides each channel by its response to white.
    /// gray-world divides each channel by its mean in the first image. none keeps the rates of the channels.
    #[arg(hide_short_help = true, long, value_name = "CONVERSION")]
    color: Option<ColorConversion>,
    /// Set the spikes per readout of white [default: auto]
    ///
    /// Pixels with at least this rate, or for isi this interval in readouts, are white. By default, one pixel in 500 of
    /// the first image exceeds white.
    #[arg(long, value_name = "RATE")]
    white: Option<f32>,
    /// Set the bits of a PNG in sRGB: 8 or 16
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = parse_bits)]
    bits: PictureFormat,
    /// Set the frames per second of an animated image or video; a GIF has at most 50
    #[arg(long, value_name = "HZ", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..))]
    fps: u32,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Conversion of the channels of a mosaic to red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ColorConversion {
    Matrix,
    White,
    GrayWorld,
    None,
}

/// The conversion of the rates of a mosaic to a color picture.
struct ColorPicture {
    mosaic: Mosaic,
    method: Demosaic,
    matrix: ColorMatrix,
}

impl ColorPicture {
    fn apply(&self, rates: &[f32], geometry: Geometry) -> Result<Vec<f32>> {
        Ok(self.matrix.apply(&demosaic(rates, geometry, &self.mosaic, self.method)?))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    Tfp,
    Span,
    Tfi,
    Isi,
}

impl Method {
    const fn name(self) -> &'static str {
        match self {
            Self::Tfp => "tfp",
            Self::Span => "span",
            Self::Tfi => "tfi",
            Self::Isi => "isi",
        }
    }
}

impl Args {
    /// Returns the number of readouts that a picture needs before and after its center.
    fn half_window(&self) -> usize {
        match (self.method, self.window) {
            (Method::Tfp | Method::Span, Some(window)) => (window / 2) as usize,
            (Method::Tfp | Method::Span, None) => 80,
            (_, Some(search)) => search as usize,
            (_, None) => 300,
        }
    }

    /// Returns the picture at a readout. The second value is whether the stream is long enough before and after the readout.
    fn reconstruct_at(&self, reader: &StreamReader, at: usize) -> Result<(Vec<f32>, bool)> {
        let half = self.half_window();
        if self.method == Method::Tfi {
            let tfi = reader.tfi(at, half)?;
            let is_complete = tfi.is_measurable();
            return Ok((tfi.rates, is_complete));
        }
        let (frames, center) = reader.read_around(at, half)?;
        let view = frames.view();
        Ok(match self.method {
            Method::Tfp => (tfp(view, center, half)?, true),
            Method::Span => (span_rates(view, center, half)?, true),
            Method::Tfi | Method::Isi => {
                let lengths = isi_map(view, center)?.into_iter().map(|n| n as f32).collect();
                (lengths, tfi_with_open_pixels(view, center, half)?.is_measurable())
            }
        })
    }

    /// Returns the conversion to color, or `None` for gray pictures. `first` contains the rates of the first picture.
    fn color_picture(&self, first: &[f32], geometry: Geometry) -> Result<Option<ColorPicture>> {
        let mosaic = self.mosaic.of_stream(&self.file)?;
        let unused = |flag: &str, found: &str| {
            Error::new(ErrorKind::Usage, flag).found(found).expected("rates of a color camera").remedy(
                "set --mosaic to the pattern of the camera and --method to tfp, span or tfi, or omit the flag",
            )
        };
        let is_none = self.demosaic.as_deref() == Some("none");
        let reason = match &mosaic {
            None => Some("a stream without a mosaic"),
            Some(_) if self.method == Method::Isi => Some("intervals, which are not light"),
            Some(_) if is_none => Some("--demosaic none"),
            Some(_) => None,
        };
        if let Some(reason) = reason {
            if self.demosaic.is_some() && !is_none {
                return Err(unused("--demosaic", reason));
            }
            return if self.color.is_some() { Err(unused("--color", reason)) } else { Ok(None) };
        }
        let Some(mosaic) = mosaic else { return Ok(None) };
        let method = self.demosaic.as_deref().map_or(Ok(Demosaic::Bilinear), str::parse)?;
        let matrix = match self.color.unwrap_or(ColorConversion::Matrix) {
            ColorConversion::Matrix => ColorMatrix::from_response(&mosaic)?,
            ColorConversion::White => ColorMatrix::from_white(
                &mosaic,
                &mosaic.channels().iter().map(Channel::white).collect::<Vec<_>>(),
            )?,
            ColorConversion::None => ColorMatrix::from_white(&mosaic, &vec![1.0; mosaic.channels().len()])?,
            ColorConversion::GrayWorld => {
                ColorMatrix::from_white(&mosaic, &channel_means(first, geometry, &mosaic)?)?
            }
        };
        Ok(Some(ColorPicture { mosaic, method, matrix }))
    }

    /// Returns the possible patterns of a stream whose filters are neither in a sidecar nor set by the user. `first` contains the
    /// rates of the first picture.
    fn detected_mosaics(&self, first: &[f32], geometry: Geometry) -> Result<Option<[Mosaic; 2]>> {
        if self.mosaic.mosaic.is_some()
            || self.method == Method::Isi
            || self.mosaic.of_stream(&self.file)?.is_some()
        {
            return Ok(None);
        }
        let readouts = (2 * self.half_window() + 1) as f32;
        let counts: Vec<u32> = first.iter().map(|rate| (rate * readouts).round() as u32).collect();
        Ok(detect_mosaic(&counts, geometry.width()))
    }

    /// Returns the readouts of the pictures whose windows exceed the stream.
    fn cut_windows(&self, pictures: &[usize], readouts: usize) -> Vec<usize> {
        let half = self.half_window();
        let has_window = matches!(self.method, Method::Tfp | Method::Span);
        let exceeds = |at: &usize| *at < half || at.saturating_add(half) >= readouts;
        pictures.iter().copied().filter(|at| has_window && exceeds(at)).collect()
    }

    /// Prints a note if windows exceed the stream, because such pictures have more noise.
    fn print_window_note(&self, short: &[usize], readouts: usize, out: &Console) {
        let Some(&first) = short.first() else { return };
        let (half, window) = (self.half_window(), 2 * self.half_window() + 1);
        if readouts < window {
            return out.print_message(format_args!(
                "note: the stream has {}, fewer than the window of {window}",
                Count(readouts, "readout"),
            ));
        }
        let used = first.saturating_add(half).min(readouts - 1) + 1 - first.saturating_sub(half);
        out.print_message(format_args!(
            "note: the window of {} exceeds the stream at {}: at readout {first}, the stream contains {} of the window",
            Count(window, "readout"),
            Count(short.len(), "image"),
            Count(used, "readout"),
        ));
    }

    /// Returns the readout of each picture: a single readout, or the middle of every N readouts of the stream.
    fn picture_readouts(&self, readouts: usize, many: bool) -> Vec<usize> {
        if !many || self.at.is_some() {
            return vec![self.at.unwrap_or(readouts / 2)];
        }
        sample_readouts(readouts, self.every.map_or(2 * self.half_window() + 1, |n| n as usize))
    }
}

/// Returns the mean rate of each channel, divided by the mean of green or, without green, of all pixels.
fn channel_means(rates: &[f32], geometry: Geometry, mosaic: &Mosaic) -> Result<Vec<f64>> {
    let channels = mosaic.channels();
    let mut sums = vec![(0.0, 0.0); channels.len()];
    for (rate, channel) in rates.iter().zip(mosaic.channel_map(geometry)) {
        sums[channel].0 += f64::from(*rate);
        sums[channel].1 += 1.0;
    }
    let means: Vec<f64> = sums.iter().map(|(sum, pixels)| sum / f64::max(*pixels, 1.0)).collect();
    let green = channels.iter().position(|c| c.name == 'G').map_or(means.iter().sum::<f64>(), |g| means[g]);
    if green <= 0.0 || means.iter().any(|mean| *mean <= 0.0) {
        return Err(Error::new(ErrorKind::Input, "--color gray-world")
            .found("a channel without spikes")
            .expected("spikes in every channel")
            .remedy("set --color to white or none"));
    }
    Ok(means.iter().map(|mean| mean / green).collect())
}

/// Kind of output. The output name determines it.
enum OutputKind {
    Stdout,
    Picture(PictureFormat),
    Npy,
    Movie(MovieFormat),
    Folder,
}

/// Parses the number of bits of a PNG.
fn parse_bits(text: &str) -> std::result::Result<PictureFormat, String> {
    match text {
        "8" => Ok(PictureFormat::Png8),
        "16" => Ok(PictureFormat::Png16),
        _ => Err("expected 8 or 16".to_owned()),
    }
}

/// Returns the kind of output. `png` is the format of PNG files.
fn output_kind(path: &Path, png: PictureFormat) -> Result<OutputKind> {
    if is_dash(path) {
        return Ok(OutputKind::Stdout);
    }
    if let Some(format) = MovieFormat::from_path(path) {
        return Ok(OutputKind::Movie(format));
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("png") => Ok(OutputKind::Picture(png)),
        Some("exr") => Ok(OutputKind::Picture(PictureFormat::Exr)),
        Some("npy") => Ok(OutputKind::Npy),
        None => Ok(OutputKind::Folder),
        Some(_) if path.is_dir() => Ok(OutputKind::Folder),
        Some(other) => Err(Error::new(ErrorKind::Usage, path.display())
            .found(format_args!("the extension .{other}"))
            .expected(format_args!(
                ".png, .exr, .npy, {MOVIE_EXTENSIONS}, or a folder name without an extension"
            ))),
    }
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let target = output_kind(&args.output, args.bits)?;
    if args.bits == PictureFormat::Png16
        && !matches!(
            target,
            OutputKind::Stdout | OutputKind::Folder | OutputKind::Picture(PictureFormat::Png16)
        )
    {
        return Err(Error::new(ErrorKind::Usage, "--bits")
            .found(format_args!("16 for {}", args.output.display()))
            .expected("a .png or a folder of PNGs as output")
            .remedy("omit --bits, or choose another output"));
    }
    if matches!(target, OutputKind::Stdout) {
        refuse_json(out.json())?;
    }
    let reader = args.stream.open(&args.file, out)?;
    let geometry = reader.geometry();
    // Memory for a picture, a sorted copy of it, its gray levels, and their encoding.
    // A color picture has up to 26 channels before the conversion to three colors.
    inputs::check_memory(format_args!("image of {geometry} pixels"), 100 * geometry.pixels())?;
    if args.white.is_some_and(|w| !(w.is_finite() && w > 0.0)) {
        return Err(Error::new(ErrorKind::Usage, "--white").expected("a positive number"));
    }
    let many = match target {
        OutputKind::Picture(_) | OutputKind::Stdout if args.every.is_some() => {
            return Err(Error::new(ErrorKind::Usage, "--every")
                .found("one image to write")
                .expected("a folder, an .npy file, an animated image or a video as output"));
        }
        OutputKind::Picture(_) | OutputKind::Stdout => false,
        OutputKind::Npy => args.every.is_some(),
        OutputKind::Movie(_) | OutputKind::Folder => true,
    };
    let moments = args.picture_readouts(reader.readouts(), many);
    let _claim = match target {
        OutputKind::Stdout => None,
        OutputKind::Folder => {
            sinks::check_empty_folder(&args.output, args.force)?;
            Some(claim_folder(&args.output)?)
        }
        _ => Some(claim_files([&args.output], args.force)?),
    };
    let mut first = args.reconstruct_at(&reader, moments[0])?;
    let color = args.color_picture(&first.0, geometry)?;
    if let Some(patterns) = args.detected_mosaics(&first.0, geometry)? {
        out.print_message(detection_note(args.file.display(), &patterns, "the image is gray"));
    }
    let in_color = |rates: Vec<f32>| match &color {
        Some(color) => color.apply(&rates, geometry),
        None => Ok(rates),
    };
    first.0 = in_color(first.0)?;
    if let Some(color) = &color {
        out.print_message(format_args!("color of the mosaic {}, demosaicing {}", color.mosaic, color.method));
    }
    let white = args.white.unwrap_or_else(|| white_rate(&first.0));
    let (path, force) = (&args.output, args.force);
    let (format, target) = match target {
        OutputKind::Stdout => (args.bits, Target::Stdout),
        OutputKind::Picture(format) => (format, Target::File),
        OutputKind::Folder => (args.bits, Target::Folder),
        OutputKind::Npy => {
            let channels = if color.is_some() { 3 } else { 1 };
            let pictures = many.then_some(moments.len());
            (args.bits, Target::Npy(create_array(path, force, geometry, channels, pictures)?))
        }
        OutputKind::Movie(format) => {
            let fps = f64::from(args.fps);
            let movie = MovieWriter::create(path, format, geometry, color.is_some(), fps, force)?;
            (args.bits, Target::Movie(format, movie))
        }
    };
    let mut sink = PictureSink { path, force, format, white, geometry, target };
    let mut progress = CountProgress::new(out, stop_flag()?);
    let mut cut = Vec::new();
    let mut done = 0;
    for batch in moments.chunks(BATCH_PICTURES * threads::thread_count()) {
        let encode = |&at: &usize| {
            let (picture, is_complete) = if at == moments[0] {
                first.clone()
            } else {
                let (rates, is_complete) = args.reconstruct_at(&reader, at)?;
                (in_color(rates)?, is_complete)
            };
            Ok((at, is_complete, sink.encode(&picture)?))
        };
        // Each picture has its own result. The pictures before an error are therefore always written, for any order of the
        // threads.
        let ready: Vec<Result<_>> = threads::map(batch, encode);
        for picture in ready {
            let (at, is_complete, encoded) = picture?;
            sink.write(at, &encoded).map_err(|e| progress.error_or_interrupt(e))?;
            cut.extend((!is_complete).then_some(at));
            done += 1;
            progress.update(done, Some(moments.len() as u64))?;
        }
    }
    sink.finish()?;
    drop(progress);
    out.print_message(format_args!(
        "{}  {} of {}",
        args.output.display(),
        Count(moments.len(), "image"),
        reader.geometry(),
    ));
    let short = args.cut_windows(&moments, reader.readouts());
    args.print_window_note(&short, reader.readouts(), out);
    print_cut_warning(&cut, out);
    out.print_event(&json!({
        "event": "done", "file": args.output.display().to_string(), "pictures": moments.len(),
        "method": args.method.name(), "white": white, "readouts": moments,
        "not_measurable": cut, "cut_windows": short,
    }))
}

/// Prints a warning about pictures that are unreliable because they are near the start or the end of the stream.
fn print_cut_warning(cut: &[usize], out: &Console) {
    let (Some(first), Some(last)) = (cut.first(), cut.last()) else { return };
    let place =
        if first == last { format!("readout {first}") } else { format!("readouts {first} to {last}") };
    out.print_message(format_args!(
        "note: unreliable: {} at {place}, because the stream begins or ends within the interval of too many pixels",
        Count(cut.len(), "image"),
    ));
}
