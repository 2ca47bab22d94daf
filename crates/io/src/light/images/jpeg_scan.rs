//! A walk over the Huffman codes of a JPEG, which finds missing and superfluous data.
//!
//! If bytes are missing inside a scan, all later codes are wrong. Most of these codes are valid, so decoders return an image
//! of noise or gray. But the codes then rarely end where the data end. This module counts the blocks of each scan (ITU-T
//! T.81, annexes F.2.2 and G.2) and compares the end of the last block with the end of the data. libjpeg prints warnings in
//! the same cases: "premature end of data segment" and "extraneous bytes before marker".

use std::ops::RangeInclusive;

/// Some webcams write a few bytes behind the last block, which libjpeg reports and every program ignores.
const MAX_SUPERFLUOUS_BYTES: usize = 4;

const TOO_FEW_CODES: &str = "the end of the data of a scan before its last block";

const STUFFING: u8 = 0x00;
const TEM: u8 = 0x01;
const FRAMES: RangeInclusive<u8> = 0xC0..=0xCF;
const PROGRESSIVE_FRAME: u8 = 0xC2;
const HUFFMAN_TABLES: u8 = 0xC4;
const ARITHMETIC_TABLES: u8 = 0xCC;
const RESTART: RangeInclusive<u8> = 0xD0..=0xD7;
const START: u8 = 0xD8;
const END: u8 = 0xD9;
const SCAN: u8 = 0xDA;
const RESTART_INTERVAL: u8 = 0xDD;

/// A marker and its segment.
struct Segment<'a> {
    code: u8,
    /// The bytes of the segment behind its length.
    content: &'a [u8],
    /// The bytes between this segment and the next marker, without stuffing. Behind a scan or a restart they are its codes.
    data: Vec<u8>,
}

/// Returns the next segment and removes it from the front of `bytes`, or `None` at the end of the file.
fn next_segment<'a>(bytes: &mut &'a [u8]) -> Option<Segment<'a>> {
    let marker = bytes.iter().position(|byte| *byte == 0xFF)?;
    // More bytes 0xFF in front of the code are padding.
    let code_at = marker + bytes[marker..].iter().position(|byte| *byte != 0xFF)?;
    let code = bytes[code_at];
    let is_alone = matches!(code, STUFFING | TEM | START | END) || RESTART.contains(&code);
    let length = match bytes.get(code_at + 1..code_at + 3) {
        _ if is_alone => 0,
        Some(length) => usize::from(u16::from_be_bytes([length[0], length[1]])),
        None => return None,
    };
    let content = if is_alone { &[] } else { bytes.get(code_at + 3..code_at + 1 + length)? };
    *bytes = &bytes[code_at + 1 + length..];
    let mut data = Vec::new();
    if code == SCAN || RESTART.contains(&code) {
        let mut rest = *bytes;
        loop {
            let stop = rest.iter().position(|byte| *byte == 0xFF)?;
            data.extend(&rest[..stop]);
            match *rest.get(stop + 1)? {
                STUFFING => data.push(0xFF),
                TEM => {}
                _ => {
                    rest = &rest[stop..];
                    break;
                }
            }
            rest = &rest[stop + 2..];
        }
        *bytes = rest;
    }
    Some(Segment { code, content, data })
}

/// The Huffman codes of one table.
#[derive(Default)]
struct Codes {
    /// For each length of a code from 1 to 16 bits: the first larger value of the next 16 bits, and the number of symbols with
    /// codes of at most this length.
    lengths: Vec<(u32, usize)>,
    symbols: Vec<u8>,
    /// The length and the symbol of the code at the start of each byte, or a length above 8 if the code is longer.
    short: Vec<(usize, u8)>,
}

impl Codes {
    fn new(counts: &[u8], symbols: &[u8]) -> Self {
        let lengths = (1..).zip(counts).scan((0, 0), |(limit, symbols), (length, count)| {
            *limit += u32::from(*count) << (16 - length);
            *symbols += usize::from(*count);
            Some((*limit, *symbols))
        });
        let mut codes = Self { lengths: lengths.collect(), symbols: symbols.to_vec(), short: Vec::new() };
        codes.short = (0..256).map(|byte| codes.search(byte << 8).unwrap_or((16, 0))).collect();
        codes
    }

    /// Returns the length and the symbol of the code that the 16 bits begin with.
    fn find(&self, bits: u32) -> Option<(usize, u8)> {
        match self.short.get((bits >> 8) as usize) {
            Some(code) if code.0 <= 8 => Some(*code),
            _ => self.search(bits),
        }
    }

    fn search(&self, bits: u32) -> Option<(usize, u8)> {
        let index = self.lengths.iter().position(|(limit, _)| bits < *limit)?;
        let (start, symbols) = if index == 0 { (0, 0) } else { self.lengths[index - 1] };
        let symbol = self.symbols.get(symbols + ((bits - start) >> (15 - index)) as usize)?;
        Some((index + 1, *symbol))
    }
}

/// Reads the tables of a DHT segment into `tables`, indexed by class (0: DC, 1: AC) and number. Returns `None` if the segment is
/// invalid.
fn read_tables(mut content: &[u8], tables: &mut [[Codes; 4]; 2]) -> Option<()> {
    while let [class_and_number, rest @ ..] = content {
        let (counts, rest) = rest.split_at_checked(16)?;
        let (symbols, rest) = rest.split_at_checked(counts.iter().map(|count| usize::from(*count)).sum())?;
        let table = tables
            .get_mut(usize::from(class_and_number >> 4))?
            .get_mut(usize::from(class_and_number & 15))?;
        *table = Codes::new(counts, symbols);
        content = rest;
    }
    Some(())
}

/// A component of the frame.
struct Component {
    id: u8,
    /// Sampling factors in x and y.
    sampling: [usize; 2],
}

/// The header of a frame with Huffman codes.
struct FrameHeader {
    is_progressive: bool,
    size: [usize; 2],
    components: Vec<Component>,
}

impl FrameHeader {
    /// Returns `None` for an invalid header and for lossless, hierarchical and arithmetic coding.
    fn read(code: u8, content: &[u8]) -> Option<Self> {
        let is_progressive = code == PROGRESSIVE_FRAME;
        if code > PROGRESSIVE_FRAME {
            return None;
        }
        let (header, components) = content.split_at_checked(6)?;
        let number = |at: usize| usize::from(u16::from_be_bytes([header[at], header[at + 1]]));
        let components = components.chunks_exact(3).map(|component| Component {
            id: component[0],
            sampling: [component[1] >> 4, component[1] & 15].map(|factor| usize::from(factor.max(1))),
        });
        // The number of lines 0 stands for a number in a later segment.
        Some(Self { is_progressive, size: [number(3), number(1)], components: components.collect() })
            .filter(|f| f.size[1] > 0)
    }

    /// Reads the header of a scan. Returns `None` if it is invalid.
    fn scan(&self, content: &[u8]) -> Option<Scan> {
        let (pairs, parameters) = content.get(1..)?.split_at_checked(2 * usize::from(*content.first()?))?;
        let &[first, last, approximation] = parameters else { return None };
        let (pairs, _) = pairs.as_chunks::<2>();
        let components: Option<Vec<_>> = pairs
            .iter()
            .map(|[id, tables]| Some((self.components.iter().find(|c| c.id == *id)?, *tables)))
            .collect();
        let components = components?;
        let most = |axis: usize| self.components.iter().map(|c| c.sampling[axis]).max().unwrap_or(1);
        let units = |axis: usize| match &*components {
            // A scan of one component contains only the blocks inside the image.
            [(c, _)] => (self.size[axis] * c.sampling[axis]).div_ceil(most(axis)).div_ceil(8),
            _ => self.size[axis].div_ceil(8 * most(axis)),
        };
        let blocks = |component: &Component| match &*components {
            [_] => 1,
            _ => component.sampling[0] * component.sampling[1],
        };
        let tables = |numbers: u8| [numbers >> 4 & 3, numbers & 3].map(usize::from);
        Some(Scan {
            remaining_units: units(0) * units(1),
            blocks: components.iter().flat_map(|(c, numbers)| vec![tables(*numbers); blocks(c)]).collect(),
            component: usize::from(pairs.first()?[0]),
            next_block: 0,
            coefficients: if self.is_progressive { (first.into(), last.into()) } else { (0, 63) },
            is_refinement: self.is_progressive && approximation >> 4 > 0,
        })
    }
}

/// The codes of a scan.
struct Scan {
    remaining_units: usize,
    /// The numbers of the DC and the AC table of each block of a unit.
    blocks: Vec<[usize; 2]>,
    /// The first component.
    component: usize,
    /// The number of the next block. Scans of AC coefficients contain the blocks of one component in the same order.
    next_block: usize,
    /// The first and the last coefficient.
    coefficients: (usize, usize),
    /// The codes contain one more bit of each coefficient.
    is_refinement: bool,
}

impl Scan {
    /// Skips the codes of at most `units` units in `data`, the data up to the next marker.
    fn skip_units(&mut self, units: usize, data: &[u8], state: &mut State) -> Result<(), String> {
        let units = units.min(self.remaining_units);
        self.remaining_units -= units;
        let mut bits = Bits { data, at: 0 };
        let mut empty_blocks = 0;
        let nonzero = &mut state.nonzero[self.component];
        for _ in 0..units {
            for [dc, ac] in &self.blocks {
                let (dc, ac) = (&state.tables[0][*dc], &state.tables[1][*ac]);
                nonzero.resize(nonzero.len().max(self.next_block + 1), 0);
                let block = &mut nonzero[self.next_block];
                self.next_block += 1;
                match self.coefficients {
                    (0, _) if self.is_refinement => bits.at += 1,
                    range if self.is_refinement => bits.refine_block(range, ac, block, &mut empty_blocks)?,
                    _ if empty_blocks > 0 => empty_blocks -= 1,
                    range => empty_blocks = bits.skip_block(range, dc, ac, block)?,
                }
            }
        }
        if bits.at > 8 * data.len() {
            return Err(TOO_FEW_CODES.to_owned());
        }
        let superfluous = &data[bits.at.div_ceil(8)..];
        let is_padding = [0, 0xFF].iter().any(|value| superfluous.iter().all(|byte| byte == value));
        if superfluous.len() > MAX_SUPERFLUOUS_BYTES && !is_padding {
            return Err(format!("{} bytes behind the last block of a scan", superfluous.len()));
        }
        Ok(())
    }
}

/// The codes between two markers.
struct Bits<'a> {
    data: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    /// Returns the next 16 bits. Bits behind the data are ones.
    fn next_16(&self) -> u32 {
        let start = self.at / 8;
        let bytes = match self.data.get(start..start + 4) {
            Some(bytes) => [bytes[0], bytes[1], bytes[2], bytes[3]],
            None => [0, 1, 2, 3].map(|i| self.data.get(start + i).copied().unwrap_or(0xFF)),
        };
        (u32::from_be_bytes(bytes) << (self.at % 8)) >> 16
    }

    /// Skips one code and returns its symbol.
    fn symbol(&mut self, codes: &Codes) -> Result<u8, String> {
        let code = codes.find(self.next_16());
        self.at += code.map_or(16, |(length, _)| length);
        if self.at > 8 * self.data.len() {
            return Err(TOO_FEW_CODES.to_owned());
        }
        Ok(code.ok_or("an invalid Huffman code")?.1)
    }

    /// Skips the coefficients of a block from `first` to `last`, and sets their bits in `nonzero`. Returns the number of empty
    /// blocks that follow.
    fn skip_block(
        &mut self,
        (first, last): (usize, usize),
        dc: &Codes,
        ac: &Codes,
        nonzero: &mut u64,
    ) -> Result<u32, String> {
        let mut coefficient = first;
        if coefficient == 0 {
            self.at += usize::from(self.symbol(dc)?);
            coefficient = 1;
        }
        while coefficient <= last {
            let symbol = self.symbol(ac)?;
            let (zeros, size) = (symbol >> 4, symbol & 15);
            if size == 0 && zeros < 15 {
                return Ok(self.run_of_blocks(zeros) - 1);
            }
            coefficient += usize::from(zeros);
            *nonzero |= u64::from(size > 0) << (coefficient & 63);
            coefficient += 1;
            self.at += usize::from(size);
        }
        Ok(0)
    }

    /// Skips the code of a number of blocks without further coefficients, the current block among them. In baseline files
    /// `digits` is 0, and the number is 1.
    fn run_of_blocks(&mut self, digits: u8) -> u32 {
        let more = self.next_16() >> (16 - u32::from(digits));
        self.at += usize::from(digits);
        (1 << digits) + more
    }

    /// Skips one bit of each coefficient that is in `nonzero`, and the codes of new coefficients. `empty_blocks` is the number of
    /// blocks without new coefficients.
    fn refine_block(
        &mut self,
        (first, last): (usize, usize),
        ac: &Codes,
        nonzero: &mut u64,
        empty_blocks: &mut u32,
    ) -> Result<(), String> {
        let earlier = *nonzero;
        let is_earlier = |coefficient: usize| earlier >> (coefficient & 63) & 1 == 1;
        let mut coefficient = first;
        while *empty_blocks == 0 && coefficient <= last {
            let symbol = self.symbol(ac)?;
            let (mut zeros, size) = (symbol >> 4, symbol & 15);
            if size == 0 && zeros < 15 {
                *empty_blocks = self.run_of_blocks(zeros);
                break;
            }
            self.at += usize::from(size > 0);
            while coefficient <= last && (zeros > 0 || is_earlier(coefficient)) {
                if is_earlier(coefficient) {
                    self.at += 1;
                } else {
                    zeros -= 1;
                }
                coefficient += 1;
            }
            *nonzero |= u64::from(size > 0) << (coefficient & 63);
            coefficient += 1;
        }
        if *empty_blocks > 0 {
            *empty_blocks -= 1;
            self.at += (coefficient..=last).filter(|coefficient| is_earlier(*coefficient)).count();
        }
        Ok(())
    }
}

/// The parts of a file that later scans use.
struct State {
    /// Huffman tables of DC and AC coefficients.
    tables: [[Codes; 4]; 2],
    /// The nonzero coefficients of each block of a progressive file, for each identifier of a component.
    nonzero: Vec<Vec<u64>>,
}

/// Returns an error if the JPEG in `bytes` ends before its end marker, or if a scan contains too few or too many codes. Invalid
/// headers and frames that [`FrameHeader::read`] does not support are left to the decoder.
pub(super) fn check(mut bytes: &[u8]) -> Result<(), String> {
    let mut state = State { tables: Default::default(), nonzero: vec![Vec::new(); 256] };
    let mut frame = None;
    let mut scan = None;
    let mut interval = usize::MAX;
    loop {
        let Segment { code, content, data } =
            next_segment(&mut bytes).ok_or("the end of the file before the end marker of the JPEG")?;
        match code {
            END => return Ok(()),
            HUFFMAN_TABLES if read_tables(content, &mut state.tables).is_none() => frame = None,
            HUFFMAN_TABLES | ARITHMETIC_TABLES => {}
            _ if FRAMES.contains(&code) => frame = FrameHeader::read(code, content),
            RESTART_INTERVAL => {
                let units = content.first_chunk().map_or(0, |units| u16::from_be_bytes(*units));
                interval = if units == 0 { usize::MAX } else { units.into() };
            }
            SCAN => scan = frame.as_ref().and_then(|frame| frame.scan(content)),
            _ => {}
        }
        if code == SCAN || RESTART.contains(&code) {
            scan.as_mut().map_or(Ok(()), |scan| scan.skip_units(interval, &data, &mut state))?;
        }
    }
}
