//! What `ffprobe` says of a video's codes, and how to have them from ffmpeg as they are.
//!
//! ffmpeg's own conversions of range, matrix and depth shift bits where they should scale: white of 8 bits
//! becomes 4080 of 4095, and luminance comes out up to a code too dark or too bright. So ffmpeg only decodes and
//! repacks, and [`super::yuv`] does the arithmetic.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

use super::yuv::{Known, Matrix};
use crate::light::times;
use spikelane::error::{Error, Kind, Result};

/// Packets that become frames: those that are only decoded for others to be have the flag of being discarded.
fn shown(packets: &str) -> u64 {
    let flags = packets.lines().filter_map(|line| line.trim().strip_prefix("flags="));
    flags.filter(|flags| !flags.contains('D')).count() as u64
}

/// Times of frames from the packets of a stream, when they come at no one rate; `None` too where times are missing.
fn uneven(text: &str) -> Option<Vec<u64>> {
    let (mut times, mut time) = (Vec::new(), None);
    for (key, value) in text.lines().filter_map(|line| line.trim().split_once('=')) {
        match key {
            "pts_time" => time = Some(value.parse::<f64>().ok()?),
            "flags" if !value.contains('D') => times.push(time?),
            _ => {}
        }
    }
    times.sort_by(f64::total_cmp);
    let starts = times::nanoseconds(&times).ok()?;
    (starts.len() > 1 && !times::are_even(&starts)).then_some(starts)
}

/// How the samples of a pixel format lie, and their bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Family {
    Mono(u8),
    /// Chroma as in `420`, and bits.
    Yuv(u16, u8),
    Rgb(u8),
}

/// The first video stream of a file.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::light) struct Probe {
    /// Nanoseconds of each frame after the first, where they come at no one rate.
    pub times: Option<Vec<u64>>,
    pixels: String,
    full: Option<bool>,
    matrix: Option<Matrix>,
    /// How many frames its packets announce.
    pub frames: Option<u64>,
}

impl Probe {
    /// Asks the `ffprobe` that belongs to the ffmpeg called `program`.
    ///
    /// # Errors
    /// [`Kind::Tool`] when it is missing, cannot read the file or finds no video, [`Kind::Input`] when the matrix is
    /// none that is known here.
    pub(crate) fn of(path: &Path, program: &str) -> Result<Self> {
        let text = Self::ask(path, program, "stream=pix_fmt,color_range,color_space")?;
        let mut probe = Self::parse(&text).map_err(|e| e.within(path.display()))?;
        let packets = Self::ask(path, program, "packet=pts_time,flags")?;
        probe.times = uneven(&packets);
        probe.frames = Some(shown(&packets));
        Ok(probe)
    }

    /// The `key=value` lines of these entries of the first video stream.
    fn ask(path: &Path, program: &str, entries: &str) -> Result<String> {
        let name = path.display();
        let probe = match program.strip_suffix("ffmpeg") {
            Some(folder) => format!("{folder}ffprobe"),
            None => "ffprobe".to_owned(),
        };
        let ran = Command::new(&probe)
            .args(["-v", "error", "-select_streams", "v:0", "-of", "default=noprint_wrappers=1"])
            .args(["-show_entries", entries])
            .args(one_file(path))
            .stdin(Stdio::null())
            .output()
            .map_err(|e| missing(&probe, e))?;
        let said = String::from_utf8_lossy(&ran.stderr);
        if !ran.status.success() {
            let remedy = if said.contains("not on whitelist") {
                "give the video itself: playlists, and other files that name files, are not read"
            } else {
                "try to play it with ffplay"
            };
            return Err(Error::new(Kind::Tool, name)
                .found(format_args!("ffprobe ended with {}: {}", ran.status, said.trim()))
                .expected("a video that ffmpeg can decode")
                .remedy(remedy));
        }
        Ok(String::from_utf8_lossy(&ran.stdout).into_owned())
    }

    /// Reads `key=value` lines.
    fn parse(text: &str) -> Result<Self> {
        let value = |key: &str| {
            let mut lines = text.lines().filter_map(|l| l.trim().split_once('='));
            lines.find(|(k, _)| *k == key).map(|(_, v)| v.to_owned())
        };
        let Some(pixels) = value("pix_fmt") else {
            return Err(Error::new(Kind::Tool, "ffprobe")
                .found("no picture from ffmpeg")
                .expected("a file with a video stream"));
        };
        let full = match value("color_range").as_deref() {
            Some("pc") => Some(true),
            Some("tv") => Some(false),
            _ => pixels.starts_with("yuvj").then_some(true),
        };
        let matrix = match value("color_space").as_deref() {
            None | Some("unknown" | "reserved" | "gbr") => None,
            Some("bt709") => Some(Matrix::Bt709),
            Some("smpte170m" | "bt470bg") => Some(Matrix::Bt601),
            Some("bt2020nc") => Some(Matrix::Bt2020),
            Some("smpte240m") => Some(Matrix::Smpte240m),
            Some("fcc") => Some(Matrix::Fcc),
            // Without colour the matrix says nothing.
            Some(_) if !matches!(family(&pixels), Family::Yuv(..)) => None,
            Some(other) => {
                return Err(Error::new(Kind::Input, "video")
                    .found(format_args!("colours by the matrix {other}"))
                    .expected("bt601 (smpte170m, bt470bg), bt709, bt2020nc, smpte240m or fcc")
                    .remedy("convert it to RGB first, with a program that knows this matrix"));
            }
        };
        Ok(Self { times: None, pixels, full, matrix, frames: None })
    }

    /// Filters after which frames are planes that y4m holds, with the values of the file.
    pub(crate) fn filters(&self) -> String {
        const DEINTERLACE: &str = "yadif=deint=interlaced";
        let (target, rgb) = match family(&self.pixels) {
            Family::Mono(bits) => (planar("gray", bits), None),
            Family::Yuv(chroma, bits) => (planar(&format!("yuv{chroma}p"), bits), None),
            Family::Rgb(bits) => (planar("gbrp", bits), Some(planar("yuv444p", bits))),
        };
        let mut filters = Vec::new();
        if target != self.pixels {
            if rgb.is_none() {
                let range = if self.is_full() { "pc" } else { "tv" };
                filters.push(format!("scale=in_range={range}:out_range={range}"));
            }
            filters.push(format!("format={target}"));
        }
        // yadif does not know grey of 9 to 12 bits, and would have it converted.
        if !matches!(family(&self.pixels), Family::Mono(9..=12)) {
            filters.push(DEINTERLACE.to_owned());
        }
        if let Some(label) = rgb {
            // G, B and R travel as Y, U and V: another name on the same planes.
            filters.push(format!("mergeplanes=0x000102:{label}"));
        }
        if filters.is_empty() { "null".to_owned() } else { filters.join(",") }
    }

    fn is_full(&self) -> bool {
        self.full.unwrap_or(matches!(family(&self.pixels), Family::Mono(_)))
    }

    /// What y4m cannot say of those planes.
    pub(crate) fn known(&self) -> Known {
        match family(&self.pixels) {
            Family::Rgb(_) => Known { matrix: Some(Matrix::Gbr), full: Some(true) },
            _ => Known { matrix: self.matrix, full: Some(self.is_full()) },
        }
    }
}

/// Containers that hold their video themselves. Playlists and the like (hls, dash, concat, image2), which name other files, are
/// not among them.
const CONTAINERS: &str = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegvideo,mpegts,asf,flv,live_flv,ogg,gif,mxf,m4v,\
                          h264,hevc,ivf,nut,yuv4mpegpipe";

/// The arguments of ffmpeg and ffprobe for the input `path`, of which no other file and no network is read.
pub(super) fn one_file(path: &Path) -> [OsString; 6] {
    // The prefix keeps names with a colon, or a leading dash, from meaning something else.
    let mut input = OsString::from("file:");
    input.push(path);
    let [formats, protocols] = ["-format_whitelist", "-protocol_whitelist"].map(OsString::from);
    [formats, CONTAINERS.into(), protocols, "file,pipe".into(), "-i".into(), input]
}

/// The error of a program that does not start.
pub(super) fn missing(program: &str, error: std::io::Error) -> Error {
    if error.kind() == ErrorKind::NotFound {
        return Error::new(Kind::Tool, program)
            .found("no such program")
            .expected("ffmpeg, which decodes video")
            .remedy("install it (apt install ffmpeg, brew install ffmpeg), or give a .y4m file or a folder of images");
    }
    Error::new(Kind::Tool, program).found(error).expected("ffmpeg, which decodes video")
}

/// ffmpeg's name of a planar format.
fn planar(name: &str, bits: u8) -> String {
    if bits == 8 { name.to_owned() } else { format!("{name}{bits}le") }
}

/// The family of a pixel format of ffmpeg; what is not known here is left to ffmpeg's own 8-bit RGB.
fn family(pixels: &str) -> Family {
    let name = pixels.strip_suffix("le").or(pixels.strip_suffix("be")).unwrap_or(pixels);
    let bits = |text: &str| if text.is_empty() { Some(8) } else { text.parse().ok() };
    if name.ends_with("f32") || name.ends_with("f16") {
        return if name.starts_with("gray") { Family::Mono(16) } else { Family::Rgb(16) };
    }
    if let Some(rest) = name.strip_prefix("gray").or(name.strip_prefix("ya")) {
        // y4m has no 14 bits of grey; shifted to 16, white is 65532 of 65535.
        return Family::Mono(bits(rest).map_or(8, |b| if b == 14 { 16 } else { b }));
    }
    let planes = ["yuvj", "yuva", "yuv"].iter().find_map(|p| name.strip_prefix(p));
    if let Some((chroma, rest)) = planes.and_then(|rest| rest.split_once('p'))
        && let (Ok(chroma), Some(bits)) = (chroma.parse(), bits(rest))
    {
        return Family::Yuv(if matches!(chroma, 420 | 422) { chroma } else { 444 }, bits);
    }
    match name {
        "nv12" | "nv21" => Family::Yuv(420, 8),
        "nv16" | "yuyv422" | "uyvy422" | "yvyu422" => Family::Yuv(422, 8),
        "nv24" | "nv42" | "vuya" | "vuyx" | "ayuv" => Family::Yuv(444, 8),
        "nv20" | "y210" | "p210" => Family::Yuv(422, 10),
        "y212" | "p212" => Family::Yuv(422, 12),
        "p216" => Family::Yuv(422, 16),
        "p010" => Family::Yuv(420, 10),
        "p012" => Family::Yuv(420, 12),
        "p016" => Family::Yuv(420, 16),
        "p410" | "xv30" | "v30x" => Family::Yuv(444, 10),
        "p412" | "xv36" => Family::Yuv(444, 12),
        "p416" | "ayuv64" => Family::Yuv(444, 16),
        "monow" | "monob" => Family::Mono(8),
        "x2rgb10" | "x2bgr10" => Family::Rgb(10),
        "rgb48" | "bgr48" | "rgba64" | "bgra64" => Family::Rgb(16),
        _ => {
            let planes = name.strip_prefix("gbrp").or(name.strip_prefix("gbrap"));
            Family::Rgb(planes.and_then(bits).unwrap_or(8))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_formats_keep_their_depth_and_chroma() {
        let known = [
            ("yuv420p", Family::Yuv(420, 8)),
            ("yuvj422p", Family::Yuv(422, 8)),
            ("yuva444p10le", Family::Yuv(444, 10)),
            ("yuv440p12be", Family::Yuv(444, 12)),
            ("p010le", Family::Yuv(420, 10)),
            ("gray", Family::Mono(8)),
            ("gray10le", Family::Mono(10)),
            ("ya16be", Family::Mono(16)),
            ("gbrp", Family::Rgb(8)),
            ("gbrap12le", Family::Rgb(12)),
            ("gbrpf32le", Family::Rgb(16)),
            ("rgb48be", Family::Rgb(16)),
            ("bgra", Family::Rgb(8)),
            ("pal8", Family::Rgb(8)),
        ];
        for (name, wanted) in known {
            assert_eq!(family(name), wanted, "{name}");
        }
    }

    #[test]
    fn times_of_packets_in_the_order_of_decoding_are_sorted() {
        let packets = |times: &[&str]| {
            let line = |t: &&str| format!("pts_time={t}\nflags=K__\n");
            times.iter().map(line).collect::<String>()
        };
        assert_eq!(
            uneven(&packets(&["0.0", "0.1", "0.04", "0.3"])),
            Some(vec![0, 40_000_000, 100_000_000, 300_000_000])
        );
        assert_eq!(uneven(&packets(&["0.0", "0.08", "0.04", "0.12"])), None);
        assert_eq!(uneven(&packets(&["0.0", "N/A", "0.04"])), None);
        assert_eq!(uneven("pts_time=-0.5\nflags=KD_\npts_time=0.0\nflags=K__\n"), None);
    }

    #[test]
    fn a_matrix_that_is_not_known_is_refused_where_there_is_colour() {
        let text = |pixels: &str| format!("pix_fmt={pixels}\ncolor_range=tv\ncolor_space=ycgco\n");
        assert_eq!(Probe::parse(&text("yuv420p")).unwrap_err().kind(), Kind::Input);
        assert!(Probe::parse(&text("gray")).is_ok());
        assert_eq!(Probe::parse("").unwrap_err().kind(), Kind::Tool);
    }
}
