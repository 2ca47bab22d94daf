//! Queries the sample encoding of a video with `ffprobe`, and selects ffmpeg filters that preserve the samples.
//!
//! ffmpeg converts range, matrix and depth with bit shifts instead of scaling. For example, 8-bit white becomes 4080
//! instead of 4095 at 12 bits, and luminance is wrong by up to one code. Therefore ffmpeg only decodes and repacks the
//! samples, and [`super::yuv`] converts the samples.

use std::ffi::OsString;
use std::io::{self, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use super::capture_rate::CaptureRate;
use super::damage::{Damage, LogLine};
use super::packets::Packets;
use super::yuv::{Matrix, SampleEncoding};
use super::{container_end, matroska_elements, mp4_boxes};
use crate::light::images::encoding::{Encoding, StatedTransfer, store_transfer, transfer_from_h273};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Transfer;
use spikelane::unstable::inputs::InputFile;

/// What ffprobe reports about the first video stream and its container.
const PROBED_ENTRIES: &str = "stream=index,codec_name,pix_fmt,color_range,color_space,color_transfer,color_primaries,avg_frame_rate,nb_frames:\
                              stream_tags=com.android.capture.fps:stream_side_data=side_data_type,rotation:frame_side_data=side_data_type:\
                              format=format_name:format_tags=com.android.capture.fps";

/// Kinds of side data of a stream that change its pictures and are not used.
const SIDE_DATA_NOTES: [(&str, &str); 4] = [
    (
        "Stereo 3D",
        "the file states stereo pictures, which are not separated: a frame contains both views, or one of them",
    ),
    (
        "Mastering display metadata",
        "the luminance of the mastering display is not used: the curve of the file determines the light",
    ),
    (
        "Content light level metadata",
        "the content light level is not used: the curve of the file determines the light",
    ),
    ("DOVI configuration record", "the Dolby Vision data are not used: the light is that of the base layer"),
];

/// Returns the first value of a key in lines `key=value`. Matroska stores the names of tags in capital letters.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let mut lines = text.lines().filter_map(|line| line.trim().split_once('='));
    lines.find(|(k, _)| k.eq_ignore_ascii_case(key)).map(|(_, value)| value)
}

/// Returns the value of a fraction such as `30000/1001`.
fn parse_fraction(text: &str) -> Option<f64> {
    let (num, den) = text.split_once('/')?;
    let value = num.parse::<f64>().ok()? / den.parse::<f64>().ok()?;
    (value.is_finite() && value > 0.0).then_some(value)
}

/// Returns the name of the decoder of a codec in the log of ffmpeg. The other codecs have decoders of the same name.
fn decoder_name(codec: &str) -> &str {
    match codec {
        "flv1" => "flv",
        "msmpeg4v3" => "msmpeg4",
        other => other,
    }
}

/// The arrangement of the samples in a pixel format, and the number of bits per sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PixelFamily {
    Mono(u8),
    /// Chroma subsampling, such as 420, and the number of bits per sample.
    Yuv(u16, u8),
    Rgb(u8),
}

/// Properties of the first video stream of a file.
#[derive(Clone, Debug)]
pub(super) struct VideoProbe {
    /// Times of the frames in nanoseconds after the first frame. `None` if the frame rate is constant.
    pub times: Option<Vec<u64>>,
    pixel_format: String,
    is_full_range: Option<bool>,
    matrix: Option<Matrix>,
    transfer: Option<Transfer>,
    /// Notes about tags that are not used.
    pub notes: Vec<String>,
    /// Number of visible frames, counted from the packets.
    pub frames: Option<u64>,
    /// The rate of capture, if it differs from the rate of playback.
    pub capture_rate: Option<CaptureRate>,
    /// Names of the decoder and of the demuxer in the log of ffmpeg.
    pub log_names: Vec<String>,
    /// Damage of the container.
    pub damage: Damage,
    /// Whether only complete frames are marked as corrupt, because two files were joined after them.
    pub are_corrupt_only_at_joins: bool,
    /// Width and height of the visible part of the frames that the container states.
    pub visible_size: Option<(u32, u32)>,
}

impl VideoProbe {
    /// Runs the `ffprobe` that belongs to the ffmpeg `program`.
    ///
    /// # Errors
    /// * [`ErrorKind::Tool`] if ffprobe is missing or crashes.
    /// * [`ErrorKind::Input`] if ffprobe cannot read the file or finds no video, or if the matrix is not supported.
    pub(crate) fn from_file(path: &Path, program: &str) -> Result<Self> {
        // Some side data are in the first frame only.
        let first_frame = ["-v", "level+error", "-read_intervals", "%+#1"];
        let (text, _) = Self::query(path, program, &first_frame, PROBED_ENTRIES)?;
        let mut probe = Self::parse(&text).map_err(|e| e.with_context(path.display()))?;
        let (packets, log) =
            Self::query(path, program, &["-v", "level+warning"], "packet=dts_time,pts_time,flags")?;
        let packets = Packets::parse(&packets, &log, value(&text, "index").unwrap_or_default());
        probe.times = packets.nonuniform_times();
        probe.frames = Some(packets.frames());
        probe.notes.extend(packets.join_note());
        probe.are_corrupt_only_at_joins = packets.are_corrupt_only_at_joins;
        for line in log.lines().map(LogLine::parse).filter(|line| line.is_damage(&probe.log_names)) {
            probe.damage.add(line.message);
        }
        let playback_hz = value(&text, "avg_frame_rate").and_then(parse_fraction);
        if let ("avi", Some(stated), Some(rate)) =
            (probe.container(), value(&text, "nb_frames").and_then(|n| n.parse().ok()), playback_hz)
            && let Some(found) = packets.frames_of_cut_avi(stated, rate)
        {
            probe.damage.add(&format!("{found} of the {stated} frames that the header states"));
        }
        let file = InputFile::open(path)?;
        if let Some(truncation) = container_end::truncation(probe.container(), BufReader::new(file.reader()))
        {
            probe.damage.add(truncation);
        }
        let boxes = mp4_boxes::read(&file);
        let capture_hz = value(&text, "TAG:com.android.capture.fps").and_then(|hz| hz.parse().ok());
        if let (Some(capture), Some(playback)) = (capture_hz.or(boxes.capture_hz), playback_hz) {
            probe.capture_rate = CaptureRate::new(capture, playback);
        }
        probe.notes.extend(probe.capture_rate.map(CaptureRate::note));
        let is_matroska = probe.container().starts_with("matroska");
        let cropped_size = is_matroska.then(|| matroska_elements::cropped_size(&file)).flatten();
        probe.visible_size = boxes.clean_aperture.or(cropped_size);
        Ok(probe)
    }

    /// Returns the name of the demuxer.
    fn container(&self) -> &str {
        self.log_names.last().map_or("", String::as_str)
    }

    /// Returns the lines `key=value` of `entries` for the first video stream, and the log of ffprobe. `options` are more
    /// options of ffprobe.
    fn query(path: &Path, program: &str, options: &[&str], entries: &str) -> Result<(String, String)> {
        let name = path.display();
        let probe = match program.strip_suffix("ffmpeg") {
            Some(folder) => format!("{folder}ffprobe"),
            None => "ffprobe".to_owned(),
        };
        let ran = Command::new(&probe)
            .args(options)
            .args(["-select_streams", "v:0", "-of", "default=noprint_wrappers=1"])
            .args(["-show_entries", entries])
            .args(single_file_args(path))
            .stdin(Stdio::null())
            .output()
            .map_err(|e| missing_program_error(&probe, e))?;
        let stderr = String::from_utf8_lossy(&ran.stderr);
        if !ran.status.success() {
            let remedy = if stderr.contains("not on whitelist") {
                "pass the video itself; playlists and other files that refer to other files are not read"
            } else {
                "check whether ffplay plays the video"
            };
            let messages: Vec<&str> = stderr.lines().map(|line| LogLine::parse(line).message).collect();
            // ffprobe ends with a code if it cannot interpret the file, and without one if it crashed.
            let kind = if ran.status.code().is_some() { ErrorKind::Input } else { ErrorKind::Tool };
            return Err(Error::new(kind, name)
                .found(format_args!("ffprobe ended with {}: {}", ran.status, messages.join(" | ")))
                .expected("a video that ffmpeg can decode")
                .remedy(remedy));
        }
        Ok((String::from_utf8_lossy(&ran.stdout).into_owned(), stderr.into_owned()))
    }

    /// Parses `key=value` lines.
    fn parse(text: &str) -> Result<Self> {
        let value = |key: &str| value(text, key).map(str::to_owned);
        let Some(pixels) = value("pix_fmt") else {
            return Err(Error::new(ErrorKind::Input, "ffprobe")
                .found("no video stream")
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
            // Without chroma, the conversion does not use the matrix, so an unknown matrix is not an error.
            Some(_) if !matches!(pixel_family(&pixels), PixelFamily::Yuv(..)) => None,
            Some(other) => {
                return Err(Error::new(ErrorKind::Input, "video")
                    .found(format_args!("colors by the matrix {other}"))
                    .expected("bt601 (smpte170m, bt470bg), bt709, bt2020nc, smpte240m or fcc")
                    .remedy("convert the video to RGB first, with a program that supports this matrix"));
            }
        };
        let mut notes = Vec::new();
        let mut encoding = Encoding::default();
        let transfer = value("color_transfer").map_or(Ok(None), |name| transfer_from_name(&name));
        store_transfer(&mut encoding, &mut notes, transfer);
        if value("color_primaries").is_some_and(|p| p.starts_with("bt2020")) {
            notes.push(
                "the primaries BT.2020 are not used: colors are added with the weights of the camera"
                    .to_owned(),
            );
        }
        // GIF is decoded as bgra, which always has alpha, although few animations use it.
        let has_alpha =
            ["yuva", "ya", "gbrap", "rgba", "argb", "abgr"].iter().any(|family| pixels.starts_with(family));
        if has_alpha {
            notes.push("alpha is not used: transparent pixels have their stored color".to_owned());
        }
        for (kind, note) in SIDE_DATA_NOTES {
            if text.lines().any(|line| line.trim().strip_prefix("side_data_type=") == Some(kind)) {
                notes.push(note.to_owned());
            }
        }
        let rotation = value("rotation").and_then(|degrees| degrees.parse::<i32>().ok()).unwrap_or(0);
        if rotation % 90 != 0 {
            notes.push(format!(
                "the frames are rotated by {} degrees, as the file states: corners outside a picture are black",
                -rotation
            ));
        }
        let log_names = ["codec_name", "format_name"].into_iter().filter_map(value);
        let log_names = log_names.map(|name| decoder_name(&name).to_owned()).collect();
        let transfer = encoding.transfer;
        Ok(Self {
            times: None,
            pixel_format: pixels,
            is_full_range: full,
            matrix,
            transfer,
            notes,
            frames: None,
            capture_rate: None,
            log_names,
            damage: Damage::default(),
            are_corrupt_only_at_joins: false,
            visible_size: None,
        })
    }

    /// Returns the ffmpeg filters that write the sample values of the file as y4m planes without change.
    pub(crate) fn filters(&self) -> String {
        const DEINTERLACE: &str = "yadif=deint=interlaced";
        let (target, rgb) = match pixel_family(&self.pixel_format) {
            PixelFamily::Mono(bits) => (planar_format_name("gray", bits), None),
            PixelFamily::Yuv(chroma, bits) => (planar_format_name(&format!("yuv{chroma}p"), bits), None),
            PixelFamily::Rgb(bits) => {
                (planar_format_name("gbrp", bits), Some(planar_format_name("yuv444p", bits)))
            }
        };
        let mut filters = Vec::new();
        if target != self.pixel_format {
            if rgb.is_none() {
                let range = if self.is_full() { "pc" } else { "tv" };
                filters.push(format!("scale=in_range={range}:out_range={range}"));
            }
            filters.push(format!("format={target}"));
        }
        // yadif does not support 9- to 12-bit gray. With yadif, ffmpeg would insert a conversion.
        if !matches!(pixel_family(&self.pixel_format), PixelFamily::Mono(9..=12)) {
            filters.push(DEINTERLACE.to_owned());
        }
        if let Some(label) = rgb {
            // y4m does not support RGB. The planes G, B and R are relabeled as Y, U and V, and their samples are not
            // converted.
            filters.push(format!("mergeplanes=0x000102:{label}"));
        }
        if filters.is_empty() { "null".to_owned() } else { filters.join(",") }
    }

    fn is_full(&self) -> bool {
        self.is_full_range.unwrap_or(matches!(pixel_family(&self.pixel_format), PixelFamily::Mono(_)))
    }

    /// Returns the properties of the planes that a y4m header cannot declare.
    pub(crate) fn sample_encoding(&self) -> SampleEncoding {
        match pixel_family(&self.pixel_format) {
            PixelFamily::Rgb(_) => SampleEncoding {
                matrix: Some(Matrix::Gbr),
                is_full_range: Some(true),
                transfer: self.transfer,
            },
            _ => SampleEncoding {
                matrix: self.matrix,
                is_full_range: Some(self.is_full()),
                transfer: self.transfer,
            },
        }
    }
}

/// Returns the transfer function of ffprobe's name of transfer characteristics.
fn transfer_from_name(name: &str) -> StatedTransfer {
    // The codes of ITU-T H.273, table 3.
    let code = match name {
        "bt709" => 1,
        "unknown" | "reserved" => 2,
        "bt470m" | "gamma22" => 4,
        "bt470bg" | "gamma28" => 5,
        "smpte170m" => 6,
        "linear" => 8,
        "iec61966-2-1" => 13,
        "bt2020-10" => 14,
        "bt2020-12" => 15,
        "smpte2084" => 16,
        "arib-std-b67" => 18,
        other => return Err(format!("the transfer characteristics {other}")),
    };
    transfer_from_h273(code)
}

/// Container formats that include their video data. Playlists and similar formats (hls, dash, concat, image2) are
/// excluded, because they refer to other files.
const CONTAINERS: &str = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegvideo,mpegts,asf,flv,live_flv,ogg,gif,mxf,m4v,\
                          h264,hevc,ivf,nut,yuv4mpegpipe";

/// Returns the arguments of ffmpeg and ffprobe for the input `path`. The arguments prevent access to other files and
/// to the network.
pub(super) fn single_file_args(path: &Path) -> [OsString; 6] {
    // Without the prefix `file:`, a name with a colon would be a protocol, and a name with a leading dash would be an
    // option.
    let mut input = OsString::from("file:");
    input.push(path);
    let [formats, protocols] = ["-format_whitelist", "-protocol_whitelist"].map(OsString::from);
    [formats, CONTAINERS.into(), protocols, "file,pipe".into(), "-i".into(), input]
}

/// Returns the error for a program that cannot be started.
pub(super) fn missing_program_error(program: &str, error: std::io::Error) -> Error {
    if error.kind() == io::ErrorKind::NotFound {
        return Error::new(ErrorKind::Tool, program)
            .found("no such program")
            .expected("ffmpeg, which decodes video")
            .remedy("install ffmpeg (apt install ffmpeg, brew install ffmpeg), or use a .y4m file or a folder of images");
    }
    Error::new(ErrorKind::Tool, program).found(error).expected("ffmpeg, which decodes video")
}

/// Returns ffmpeg's name of a planar format with `bits` bits per sample.
fn planar_format_name(name: &str, bits: u8) -> String {
    if bits == 8 { name.to_owned() } else { format!("{name}{bits}le") }
}

/// Returns the family of an ffmpeg pixel format. ffmpeg converts formats that are unknown here to 8-bit RGB.
fn pixel_family(pixels: &str) -> PixelFamily {
    let name = pixels.strip_suffix("le").or(pixels.strip_suffix("be")).unwrap_or(pixels);
    let bits = |text: &str| if text.is_empty() { Some(8) } else { text.parse().ok() };
    if name.ends_with("f32") || name.ends_with("f16") {
        return if name.starts_with("gray") { PixelFamily::Mono(16) } else { PixelFamily::Rgb(16) };
    }
    if let Some(rest) = name.strip_prefix("gray").or(name.strip_prefix("ya")) {
        // y4m does not support 14-bit gray. The samples are shifted to 16 bits, so white is 65532 instead of 65535.
        return PixelFamily::Mono(bits(rest).map_or(8, |b| if b == 14 { 16 } else { b }));
    }
    let planes = ["yuvj", "yuva", "yuv"].iter().find_map(|p| name.strip_prefix(p));
    if let Some((chroma, rest)) = planes.and_then(|rest| rest.split_once('p'))
        && let (Ok(chroma), Some(bits)) = (chroma.parse(), bits(rest))
    {
        return PixelFamily::Yuv(if matches!(chroma, 420 | 422) { chroma } else { 444 }, bits);
    }
    match name {
        "nv12" | "nv21" => PixelFamily::Yuv(420, 8),
        "nv16" | "yuyv422" | "uyvy422" | "yvyu422" => PixelFamily::Yuv(422, 8),
        "nv24" | "nv42" | "vuya" | "vuyx" | "ayuv" => PixelFamily::Yuv(444, 8),
        "nv20" | "y210" | "p210" => PixelFamily::Yuv(422, 10),
        "y212" | "p212" => PixelFamily::Yuv(422, 12),
        "p216" => PixelFamily::Yuv(422, 16),
        "p010" => PixelFamily::Yuv(420, 10),
        "p012" => PixelFamily::Yuv(420, 12),
        "p016" => PixelFamily::Yuv(420, 16),
        "p410" | "xv30" | "v30x" => PixelFamily::Yuv(444, 10),
        "p412" | "xv36" => PixelFamily::Yuv(444, 12),
        "p416" | "ayuv64" => PixelFamily::Yuv(444, 16),
        "monow" | "monob" => PixelFamily::Mono(8),
        "x2rgb10" | "x2bgr10" => PixelFamily::Rgb(10),
        "rgb48" | "bgr48" | "rgba64" | "bgra64" => PixelFamily::Rgb(16),
        _ => {
            let planes = name.strip_prefix("gbrp").or(name.strip_prefix("gbrap"));
            PixelFamily::Rgb(planes.and_then(bits).unwrap_or(8))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_formats_keep_their_depth_and_chroma() {
        let known = [
            ("yuv420p", PixelFamily::Yuv(420, 8)),
            ("yuvj422p", PixelFamily::Yuv(422, 8)),
            ("yuva444p10le", PixelFamily::Yuv(444, 10)),
            ("yuv440p12be", PixelFamily::Yuv(444, 12)),
            ("p010le", PixelFamily::Yuv(420, 10)),
            ("gray", PixelFamily::Mono(8)),
            ("gray10le", PixelFamily::Mono(10)),
            ("ya16be", PixelFamily::Mono(16)),
            ("gbrp", PixelFamily::Rgb(8)),
            ("gbrap12le", PixelFamily::Rgb(12)),
            ("gbrpf32le", PixelFamily::Rgb(16)),
            ("rgb48be", PixelFamily::Rgb(16)),
            ("bgra", PixelFamily::Rgb(8)),
            ("pal8", PixelFamily::Rgb(8)),
        ];
        for (name, wanted) in known {
            assert_eq!(pixel_family(name), wanted, "{name}");
        }
    }

    #[test]
    fn tags_state_the_transfer_function() {
        let parse = |tags: &str| VideoProbe::parse(&format!("pix_fmt=yuv420p10le\n{tags}\n")).unwrap();
        for (name, transfer) in [
            ("smpte2084", Some(Transfer::Pq)),
            ("arib-std-b67", Some(Transfer::Hlg)),
            ("bt709", Some(Transfer::Srgb)),
            ("linear", Some(Transfer::Linear)),
            ("bt470bg", Some(Transfer::Gamma(2.8))),
            ("unknown", None),
        ] {
            let probe = parse(&format!("color_transfer={name}"));
            assert_eq!((probe.transfer, probe.notes), (transfer, vec![]), "{name}");
        }
        let log = parse("color_transfer=log100");
        assert!(log.transfer.is_none() && log.notes[0].contains("log100"), "{:?}", log.notes);
        assert!(parse("color_primaries=bt2020").notes[0].contains("BT.2020"));
    }

    #[test]
    fn an_unknown_matrix_is_refused_for_color_video() {
        let text = |pixels: &str| format!("pix_fmt={pixels}\ncolor_range=tv\ncolor_space=ycgco\n");
        assert_eq!(VideoProbe::parse(&text("yuv420p")).unwrap_err().kind(), ErrorKind::Input);
        assert!(VideoProbe::parse(&text("gray")).is_ok());
        assert_eq!(VideoProbe::parse("").unwrap_err().kind(), ErrorKind::Input);
    }
}
