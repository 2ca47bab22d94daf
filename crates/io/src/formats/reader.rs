//! A stream, opened: any frame of any layout.

use std::ops::Range;

use super::origin::{Lost, Origin};
use super::source::{BLOCK, Buffers, Place, Source};
use crate::formats::{Codec, Layout};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

/// Numbers of lost readouts that a warning lists.
const LISTED: usize = 12;

/// A stream, opened: any frame, in any order, from any thread.
#[derive(Debug)]
pub struct Reader {
    pub(super) source: Source,
    buffers: Buffers,
    name: String,
    layout: Layout,
    codec: Codec,
    pub(super) place: Place,
    /// Bytes of partial frames before the first whole one and behind the last.
    leading: usize,
    trailing: usize,
    readouts: usize,
    lost: Vec<usize>,
    dropped: usize,
    origin: Origin,
    warnings: Vec<String>,
}

impl Reader {
    /// `readouts` frames from the first byte on.
    pub(super) fn new(
        source: Source,
        name: &str,
        layout: Layout,
        codec: Codec,
        readouts: usize,
        origin: Origin,
    ) -> Self {
        Self {
            source,
            buffers: Buffers::default(),
            name: name.to_owned(),
            layout,
            codec,
            place: Place::Even(0),
            leading: 0,
            trailing: 0,
            readouts,
            lost: Vec::new(),
            dropped: 0,
            origin,
            warnings: Vec::new(),
        }
    }

    /// Adds to what the user should know.
    pub(super) fn warn(&mut self, text: String) {
        self.warnings.push(text);
    }

    /// Notes bytes of partial frames.
    pub(super) fn cut(&mut self, leading: usize, trailing: usize) {
        (self.leading, self.trailing) = (leading, trailing);
        if trailing > 0 {
            self.warn(format!(
                "stops inside readout {}: {trailing} bytes behind the {} whole readouts are left out",
                self.readouts, self.readouts
            ));
        }
        if leading > 0 {
            self.warn(format!(
                "starts inside a readout: {leading} bytes before the first whole one are left out"
            ));
        }
    }

    /// Notes lost readouts, by their numbers among all.
    pub(super) fn lose(&mut self, numbers: Vec<usize>, all: usize, how: Lost) {
        if numbers.is_empty() {
            return;
        }
        let mut listed: Vec<String> = numbers.iter().take(LISTED).map(usize::to_string).collect();
        if numbers.len() > LISTED {
            listed.push("...".to_owned());
        }
        let one = numbers.len() == 1;
        let (were, number) = if one { ("readout was", "number") } else { ("readouts were", "numbers") };
        let what = match (how, one) {
            (Lost::Mark, true) => "an empty one stands in its place (--lost drop leaves it out)",
            (Lost::Mark, false) => "empty ones stand in their place (--lost drop leaves them out)",
            (Lost::Drop, _) => "those behind move up (--lost mark puts empty ones in place)",
        };
        self.warn(format!("{} {were} lost of {all}, {number} {}: {what}", numbers.len(), listed.join(", ")));
        self.dropped = if how == Lost::Drop { numbers.len() } else { 0 };
        self.lost = numbers;
    }

    /// Readouts that the file has numbers for, those that were left out included.
    pub(super) fn numbered(&self) -> usize {
        self.readouts + self.dropped
    }

    pub(super) const fn codec(&self) -> Codec {
        self.codec
    }

    /// What the user should know before the numbers are trusted, one line each: a recording that was cut, readouts that
    /// were lost, a sidecar that says otherwise. Whether the picture fits is [`Reader::readings`]' to say.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Where the size of the frames was found.
    #[must_use]
    pub const fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Numbers of the readouts that the recording lost, as far as its tags tell.
    #[must_use]
    pub fn lost(&self) -> &[usize] {
        &self.lost
    }

    /// The number of whole frames, at least one.
    #[must_use]
    pub const fn readouts(&self) -> usize {
        self.readouts
    }

    /// Width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.codec.geometry()
    }

    /// The layout; an `.npz` archive holds an array of `npy-bytes`.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// The path or name it was opened by.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Bytes of partial frames left out before the first whole frame (of `rows1024`, whose recordings start
    /// anywhere) and behind the last one (where the recording stopped).
    #[must_use]
    pub const fn dropped_bytes(&self) -> (usize, usize) {
        (self.leading, self.trailing)
    }

    /// Reads the packed frame of readout `i` into `packed`.
    ///
    /// # Errors
    /// As [`read_frames`](Self::read_frames).
    pub fn read_frame(&self, i: usize, packed: &mut [u8]) -> Result<()> {
        if packed.len() != self.geometry().frame_bytes() {
            return Err(Error::new(Kind::Usage, "frame buffer")
                .found(format_args!("{} bytes", packed.len()))
                .expected(format_args!("{}", self.geometry().frame_bytes())));
        }
        self.read_frames(i, packed)
    }

    /// Reads as many packed frames as `packed` holds, from readout `first` on.
    ///
    /// # Errors
    /// [`Kind::Usage`] when they are not all in the stream, or `packed` holds no whole
    /// number of frames; [`Kind::Input`] as [`Layout::decode_frame`].
    pub fn read_frames(&self, first: usize, packed: &mut [u8]) -> Result<()> {
        let size = self.geometry().frame_bytes();
        let end = first.saturating_add(packed.len() / size);
        self.check(&(first..end))?;
        let within = |e: Error, readout| e.within(format_args!("{} from readout {readout} on", self.name));
        if !packed.len().is_multiple_of(size) {
            return self.codec.decode(&[], packed);
        }
        if let (Place::Even(start), true) = (&self.place, self.codec.is_identity()) {
            return self.source.read(start + first * size, packed);
        }
        self.stored(first..end, |readout, file| {
            let count = file.map_or(1, |file| file.len() / self.codec.frame_bytes());
            let packed = &mut packed[(readout - first) * size..][..count * size];
            match file {
                Some(file) => self.codec.decode(file, packed).map_err(|e| within(e, readout)),
                None => {
                    packed.fill(0);
                    Ok(())
                }
            }
        })
    }

    /// Hands the bytes of `readouts`, as the file has them, to `take`: several frames at a time with the number of the
    /// first, and `None` for a lost one.
    pub(super) fn stored(
        &self,
        readouts: Range<usize>,
        mut take: impl FnMut(usize, Option<&[u8]>) -> Result<()>,
    ) -> Result<()> {
        self.check(&readouts)?;
        let bytes = self.codec.frame_bytes();
        match &self.place {
            Place::Even(start) => {
                let file = start + readouts.start * bytes..start + readouts.end * bytes;
                self.pieces(file, bytes, |at, file| take((at - start) / bytes, Some(file)))
            }
            Place::Each(frames) => {
                readouts.clone().zip(&frames[readouts]).try_for_each(|(readout, at)| match at {
                    Some(at) => self.pieces(*at..at + bytes, bytes, |_, file| take(readout, Some(file))),
                    None => take(readout, None),
                })
            }
        }
    }

    /// Hands the bytes of `file`, whole frames of `bytes` bytes, to `take`: several frames at a time with the place of the
    /// first.
    pub(super) fn pieces(
        &self,
        file: Range<usize>,
        bytes: usize,
        mut take: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let step = (BLOCK / bytes).max(1) * bytes;
        self.buffers.with(step.min(file.len()), |buffer| {
            for at in file.clone().step_by(step) {
                let piece = &mut buffer[..step.min(file.end - at)];
                self.source.read(at, piece)?;
                take(at, piece)?;
            }
            Ok(())
        })
    }

    pub(super) fn check(&self, readouts: &Range<usize>) -> Result<()> {
        if readouts.start > readouts.end || readouts.end > self.readouts {
            return Err(Error::new(Kind::Usage, &self.name)
                .found(format_args!("readouts {}..{}", readouts.start, readouts.end))
                .expected(format_args!("a range within 0..{}", self.readouts)));
        }
        Ok(())
    }
}
