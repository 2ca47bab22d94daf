//! Damage that ffmpeg and ffprobe report.
//!
//! ffmpeg conceals damaged parts of a picture and continues. It marks these pictures as corrupt, and its decoders and
//! demuxers print errors. Both programs run with the log level `verbose` and print the level of each line. Messages of
//! other decoders (sound) and of the output do not concern the pictures.

/// Error messages of decoders and demuxers that do not concern the pictures: remarks in the stream that cannot be read,
/// missing chapters, and references to the part before the start of a stream that was cut at a key frame. If a picture
/// lacks a reference, the decoder prints another message.
const HARMLESS_MESSAGES: [&str; 6] = [
    "SEI type",
    "APP fields",
    "Referenced QT chapter track not found",
    "Invalid frame dimensions 0x0",
    "mmco: unref short failure",
    "co located POCs unavailable",
];

/// Maximum number of different messages that a note or an error contains.
const MAX_LISTED_MESSAGES: usize = 3;

/// A line of the log of ffmpeg: `[component @ address] [level] message`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LogLine<'a> {
    /// The last component, such as `h264`. The program itself has none.
    component: Option<&'a str>,
    level: &'a str,
    pub message: &'a str,
}

impl<'a> LogLine<'a> {
    pub(super) fn parse(line: &'a str) -> Self {
        let mut parsed = Self { component: None, level: "", message: line.trim() };
        while let Some((tag, rest)) = parsed.message.strip_prefix('[').and_then(|text| text.split_once(']')) {
            match tag.split_once(" @ ") {
                Some((component, _)) => parsed.component = Some(component),
                None if matches!(tag, "panic" | "fatal" | "error" | "warning" | "info" | "verbose") => {
                    parsed.level = tag;
                }
                None => break,
            }
            parsed.message = rest.trim_start();
        }
        parsed
    }

    /// Returns whether the line is an error.
    pub(super) fn is_error(&self) -> bool {
        matches!(self.level, "panic" | "fatal" | "error")
    }

    /// Returns the size and the pixel format of the frames, if the line is about the input of the filters:
    /// `w:64 h:48 pixfmt:yuv420p tb:1/25`.
    pub(super) fn frame_format(&self) -> Option<String> {
        self.component.filter(|name| name.starts_with("graph ") && name.contains("input from stream"))?;
        let part = |key: &str| self.message.split_whitespace().find_map(|word| word.strip_prefix(key));
        Some(format!("{}x{} {}", part("w:")?, part("h:")?, part("pixfmt:")?))
    }

    /// Returns whether the line means that a packet or a frame is marked as corrupt.
    pub(super) fn is_corrupt_mark(&self) -> bool {
        self.message.contains("corrupt decoded frame") || self.message.contains("corrupt input packet")
    }

    /// Returns whether the line means that pictures are damaged or missing. `names` are the names of the decoder and of
    /// the demuxer of the video.
    pub(super) fn is_damage(&self, names: &[String]) -> bool {
        if self.is_corrupt_mark() {
            return true;
        }
        let concerns_video = self.component.is_none_or(|component| {
            let of_task = ["vist#", "dec:", "in#", "libdav1d"].iter().any(|part| component.starts_with(part));
            of_task || names.iter().any(|name| name == component)
        });
        let is_harmless = HARMLESS_MESSAGES.iter().any(|text| self.message.contains(text));
        self.is_error() && concerns_video && !is_harmless
    }
}

/// Damage of a video, as messages.
#[derive(Clone, Debug, Default)]
pub(super) struct Damage {
    messages: Vec<String>,
    /// Number of messages that are not listed.
    more: u64,
}

impl Damage {
    pub(super) fn add(&mut self, message: &str) {
        // ffmpeg begins some messages with the name of the file.
        let message =
            message.strip_prefix("file:").and_then(|text| text.split_once(": ")).map_or(message, |(_, m)| m);
        let message = message.trim_end_matches('.');
        if self.messages.iter().any(|known| known == message) {
            return;
        }
        if self.messages.len() < MAX_LISTED_MESSAGES {
            self.messages.push(message.to_owned());
        } else {
            self.more += 1;
        }
    }

    /// Returns the messages, or `None` if the video is not damaged.
    pub(super) fn text(&self) -> Option<String> {
        let more = if self.more > 0 { format!(" | and {} more", self.more) } else { String::new() };
        (!self.messages.is_empty()).then(|| format!("{}{more}", self.messages.join(" | ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_log_have_components_and_a_level() {
        for (line, component, level, message) in [
            ("[h264 @ 0x55] [error] left block unavailable", Some("h264"), "error", "left block unavailable"),
            ("[warning] a.mp4: corrupt", None, "warning", "a.mp4: corrupt"),
            ("[vist#0:0/h264 @ 0x5] [dec:h264 @ 0x6] [error] Error", Some("dec:h264"), "error", "Error"),
            ("[2][0] text", None, "", "[2][0] text"),
            ("", None, "", ""),
        ] {
            assert_eq!(LogLine::parse(line), LogLine { component, level, message }, "{line}");
        }
    }

    #[test]
    fn only_messages_about_the_pictures_are_damage() {
        let names = ["h264", "mpegts"].map(str::to_owned);
        for (line, is_damage) in [
            ("[h264 @ 0x1] [error] error while decoding MB 0 11, bytestream 681", true),
            ("[warning] bad.mp4: corrupt decoded frame in stream 0", true),
            ("[in#0/mpegts @ 0x1] [warning] corrupt input packet in stream 0", true),
            ("[mpegts @ 0x1] [error] partial file", true),
            ("[error] Error while decoding stream #0:0: Invalid data found when processing input", true),
            ("[h264 @ 0x1] [error] SEI type 5 size 2208 truncated at 1024", false),
            ("[h264 @ 0x1] [warning] Increasing reorder buffer to 2", false),
            ("[mp3float @ 0x1] [error] Header missing", false),
            ("[swscaler @ 0x1] [warning] deprecated pixel format used", false),
            (
                "[yuv4mpegpipe @ 0x1] [error] non monotonically increasing dts to muxer in stream 0: 5 >= 5",
                false,
            ),
        ] {
            assert_eq!(LogLine::parse(line).is_damage(&names), is_damage, "{line}");
        }
    }
}
