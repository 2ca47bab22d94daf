//! The packets of a video stream: the times of the frames, and the places where files were joined.

use super::damage::LogLine;
use crate::light::timestamps;
use spikelane::unstable::Count;

/// Clock ticks per second of a transport stream.
const TRANSPORT_STREAM_HZ: f64 = 90_000.0;

/// Difference in seconds below which two times are equal. ffprobe prints six decimal places.
const EQUAL_SECONDS: f64 = 1e-5;

#[derive(Clone, Copy, Debug, Default)]
struct Packet {
    /// Times in seconds at which the frame is shown and decoded.
    shown_s: Option<f64>,
    decoded_s: Option<f64>,
    /// Packets with the discard flag `D` are decoded only as references for other frames.
    is_visible: bool,
}

/// The packets of a stream in the order of the file.
#[derive(Clone, Debug, Default)]
pub(super) struct Packets {
    packets: Vec<Packet>,
    /// Indices of the packets before which the clock jumps back: the first packets of files that were joined. A jump
    /// forward does not count, because packets can be missing before it.
    joins: Vec<usize>,
    /// Whether ffprobe marks packets as corrupt, and each of these packets is the last one before a join.
    ///
    /// The counters of two transport streams do not fit together, so the last frame of the first one counts as corrupt,
    /// although it is complete. If it were incomplete, its decoder would report an error.
    pub are_corrupt_only_at_joins: bool,
}

impl Packets {
    /// Parses the lines `key=value` of ffprobe, and its messages about the stream `index`.
    pub(super) fn parse(text: &str, log: &str, index: &str) -> Self {
        let (mut packets, mut packet) = (Vec::new(), Packet::default());
        for (key, value) in text.lines().filter_map(|line| line.trim().split_once('=')) {
            match key {
                "pts_time" => packet.shown_s = value.parse().ok(),
                "dts_time" => packet.decoded_s = value.parse().ok(),
                "flags" => {
                    packet.is_visible = !value.contains('D');
                    packets.push(std::mem::take(&mut packet));
                }
                _ => {}
            }
        }
        let corrupt: Vec<Option<f64>> = log
            .lines()
            .filter_map(|line| LogLine::parse(line).message.strip_prefix("Packet corrupt (stream = "))
            .filter_map(|rest| rest.strip_prefix(index)?.strip_prefix(", dts = "))
            .map(|time| Some(time.trim_end_matches(['.', ')']).parse::<f64>().ok()? / TRANSPORT_STREAM_HZ))
            .collect();
        let is_equal = |a: f64, b: Option<f64>| b.is_some_and(|b| (a - b).abs() < EQUAL_SECONDS);
        let restarts = |pair: &[Packet]| {
            pair[0].decoded_s.zip(pair[1].decoded_s).is_some_and(|(before, after)| after < before)
        };
        let joins: Vec<usize> =
            packets.windows(2).enumerate().filter(|(_, pair)| restarts(pair)).map(|(i, _)| i + 1).collect();
        let is_before_join = |time: &Option<f64>| {
            let ends = joins.iter().filter_map(|join| packets[join - 1].decoded_s);
            ends.clone().any(|end| is_equal(end, *time))
        };
        let are_corrupt_only_at_joins = !corrupt.is_empty() && corrupt.iter().all(is_before_join);
        Self { packets, joins, are_corrupt_only_at_joins }
    }

    /// Returns the number of visible frames.
    pub(super) fn frames(&self) -> u64 {
        self.packets.iter().filter(|packet| packet.is_visible).count() as u64
    }

    /// Returns a note about joined files.
    pub(super) fn join_note(&self) -> Option<String> {
        let first = *self.joins.first()?;
        let frames = self.packets[..first].iter().filter(|packet| packet.is_visible).count();
        Some(format!(
            "the clock of the file restarts {}, first after frame {frames}, as in joined files: the frames continue without a gap",
            Count(self.joins.len(), "time")
        ))
    }

    /// Returns the frame times in nanoseconds after the first frame. Returns `None` if the frame rate is constant or if a
    /// time is missing.
    pub(super) fn nonuniform_times(&self) -> Option<Vec<u64>> {
        let mut bounds = vec![0];
        bounds.extend(&self.joins);
        bounds.push(self.packets.len());
        let mut parts = Vec::new();
        for bound in bounds.windows(2) {
            let shown = self.packets[bound[0]..bound[1]].iter().filter(|packet| packet.is_visible);
            let mut part = shown.map(|packet| packet.shown_s).collect::<Option<Vec<f64>>>()?;
            part.sort_by(f64::total_cmp);
            parts.push(part);
        }
        let mut gaps: Vec<f64> =
            parts.iter().flat_map(|part| part.windows(2).map(|pair| pair[1] - pair[0])).collect();
        gaps.sort_by(f64::total_cmp);
        let median_gap = *gaps.get(gaps.len() / 2)?;
        let (mut times, mut next) = (Vec::new(), 0.0);
        for part in parts {
            let Some(first) = part.first() else { continue };
            times.extend(part.iter().map(|time| time - first + next));
            next = times.last().unwrap_or(&0.0) + median_gap;
        }
        let starts = timestamps::nanoseconds(&times).ok()?;
        (starts.len() > 1 && !timestamps::are_uniform(&starts)).then_some(starts)
    }

    /// Returns the number of frames that the file contains, if it is lower than the number in the header of an AVI.
    ///
    /// In an AVI, the time of a packet is the number of its frame, so frames that a recorder dropped count. Other
    /// containers state either no number or a number that edit lists change. Some programs state one frame too many. A
    /// program that writes to a pipe states a placeholder of at least 2^30.
    pub(super) fn frames_of_cut_avi(&self, stated: u64, rate: f64) -> Option<u64> {
        const PLACEHOLDER: u64 = 1 << 30;
        let last = self.packets.iter().filter_map(|packet| packet.decoded_s).max_by(f64::total_cmp)?;
        let found = (last * rate).round() as u64 + 1;
        (found + 1 < stated && stated < PLACEHOLDER).then_some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns packets with times in units of 40 ms. Packets are decoded in the order of `shown`.
    fn packets(shown: &[u32], decoded: &[u32], corrupt: &[u32]) -> Packets {
        let seconds = |n: u32| f64::from(n) / 25.0;
        let line = |(s, d): (&u32, &u32)| {
            format!("pts_time={:.6}\ndts_time={:.6}\nflags=__\n", seconds(*s), seconds(*d))
        };
        let text: String = shown.iter().zip(decoded).map(line).collect();
        let mark =
            |n: &u32| format!("[mpegts @ 0x1] [warning] Packet corrupt (stream = 0, dts = {}).\n", 3600 * n);
        Packets::parse(&text, &corrupt.iter().map(mark).collect::<String>(), "0")
    }

    #[test]
    fn frames_of_joined_files_continue_without_a_gap() {
        let decoded: Vec<u32> = (10..15).chain(10..15).collect();
        let joined = packets(&decoded, &decoded, &[14]);
        assert!(joined.are_corrupt_only_at_joins && joined.join_note().unwrap().contains("after frame 5"));
        assert_eq!((joined.frames(), joined.nonuniform_times()), (10, None));
        // A gap of 10 s in the second file remains.
        let decoded = [10, 11, 12, 10, 11, 261];
        let times = packets(&decoded, &decoded, &[12]).nonuniform_times().unwrap();
        assert_eq!(times[4..], [160_000_000, 10_160_000_000]);
    }

    #[test]
    fn lost_packets_are_no_join() {
        for decoded in [[10, 11, 12, 14, 15], [10, 11, 12, 260, 261]] {
            let lossy = packets(&decoded, &decoded, &[12]);
            assert_eq!((lossy.are_corrupt_only_at_joins, lossy.join_note()), (false, None));
        }
        // One of two marks is inside the first file.
        let decoded = [10, 11, 12, 10, 11, 12];
        assert!(!packets(&decoded, &decoded, &[11, 12]).are_corrupt_only_at_joins);
    }

    #[test]
    fn uneven_times_are_returned_in_the_order_of_display() {
        assert_eq!(packets(&[0, 2, 1, 3], &[0, 1, 2, 3], &[]).nonuniform_times(), None);
        let uneven = packets(&[0, 4, 1], &[0, 1, 2], &[]).nonuniform_times();
        assert_eq!(uneven, Some(vec![0, 40_000_000, 160_000_000]));
        assert_eq!(Packets::parse("pts_time=N/A\nflags=K_\n", "", "0").nonuniform_times(), None);
        assert_eq!(Packets::parse("pts_time=0\nflags=K_\npts_time=1\nflags=_D\n", "", "0").frames(), 1);
    }

    #[test]
    fn a_cut_avi_has_fewer_frames_than_its_header_states() {
        let found = |stated, numbers: &[u32]| packets(numbers, numbers, &[]).frames_of_cut_avi(stated, 25.0);
        assert_eq!(found(20, &[0, 1, 2]), Some(3));
        // Frame 1 was dropped by the recorder, and its place has no data.
        assert_eq!(found(4, &[0, 2, 3]), None);
        assert_eq!(found(4, &[0, 1, 2]), None);
        assert_eq!(found(0, &[0, 1, 2]), None);
        assert_eq!(found(1 << 30, &[0, 1, 2]), None);
        assert_eq!(found(20, &[]), None);
    }
}
