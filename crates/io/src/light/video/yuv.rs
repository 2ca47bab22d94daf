//! Planes of Y'CbCr to luminance.

use ::y4m::Colorspace;

use crate::light::pictures::picture::Linear;

/// The coefficients between R'G'B' and Y'CbCr.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    /// ITU-R BT.601: standard definition.
    Bt601,
    /// ITU-R BT.709: high definition.
    Bt709,
    /// ITU-R BT.2020, non-constant luminance: ultra-high definition.
    Bt2020,
    /// SMPTE 240M: early high definition.
    Smpte240m,
    /// FCC 73.682: NTSC of 1953.
    Fcc,
    /// No matrix: the planes are G', B' and R', of full range.
    Gbr,
}

/// What is known of a stream beside its header; `None` for what the header and the height say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::light) struct Known {
    pub(in crate::light) matrix: Option<Matrix>,
    pub(in crate::light) full: Option<bool>,
}

impl Matrix {
    /// What players assume of a video that does not say: BT.709 from 720 rows on.
    #[must_use]
    pub const fn of_height(rows: usize) -> Self {
        if rows >= 720 { Self::Bt709 } else { Self::Bt601 }
    }

    /// Weights of red and blue in Y'.
    const fn red_blue(self) -> [f32; 2] {
        match self {
            Self::Bt601 => [0.299, 0.114],
            Self::Bt709 => [0.2126, 0.0722],
            Self::Bt2020 => [0.2627, 0.0593],
            Self::Smpte240m => [0.212, 0.087],
            Self::Fcc => [0.30, 0.11],
            // Whatever they are, `Layout::light` does not ask for them.
            Self::Gbr => [0.0, 0.0],
        }
    }
}

/// How the planes of a frame are stored, and what their codes mean.
#[derive(Clone, Copy, Debug)]
pub(in crate::light) struct Layout {
    pub(in crate::light) width: usize,
    pub(in crate::light) height: usize,
    pub(in crate::light) depth: usize,
    /// Binary logarithm of the horizontal and vertical reduction of chroma; `None` for mono.
    pub(in crate::light) chroma: Option<[usize; 2]>,
    pub(in crate::light) full: bool,
    pub(in crate::light) matrix: Matrix,
}

/// Binary logarithms of the reduction of chroma on x and y; `None` for mono.
pub(in crate::light) fn chroma(space: Colorspace) -> Option<[usize; 2]> {
    match space {
        Colorspace::Cmono | Colorspace::Cmono12 => None,
        Colorspace::C422 | Colorspace::C422p10 | Colorspace::C422p12 => Some([1, 0]),
        Colorspace::C444 | Colorspace::C444p10 | Colorspace::C444p12 => Some([0, 0]),
        // All the others are 4:2:0; they differ in where the chroma samples sit.
        _ => Some([1, 1]),
    }
}

impl Layout {
    /// Bytes of the planes of one frame.
    pub(in crate::light) fn bytes(self) -> u64 {
        let chroma = self
            .chroma
            .map_or(0, |[x, y]| 2 * self.width.div_ceil(1 << x) as u64 * self.height.div_ceil(1 << y) as u64);
        let samples = self.width as u64 * self.height as u64 + chroma;
        if self.depth == 8 { samples } else { 2 * samples }
    }

    /// Luminance of the pixels in order, 1.0 at full scale; `table` linearises 16-bit codes.
    pub(in crate::light) fn light<'a>(
        self,
        planes: [&'a [u8]; 3],
        linear: &'a Linear,
        table: &'a [f32],
    ) -> impl Iterator<Item = f32> + 'a {
        let [black, white, swing] = self.levels();
        let (to_y, to_c) = (1.0 / (white - black), 1.0 / swing);
        let middle = (1_u32 << (self.depth - 1)) as f32;
        let [kr, kb] = self.matrix.red_blue();
        let kg = 1.0 - kr - kb;
        let code = |code: f32| (code.clamp(0.0, 1.0) * 65535.0 + 0.5).floor();
        // Grey codes of an 8-bit video are 8-bit codes: 257 of the table's.
        let unit = if self.depth == 8 { 257.0 } else { 1.0 };
        let look_up = move |code: usize| table[code];
        let [shift_x, shift_y] = self.chroma.unwrap_or_default();
        let stride = self.width.div_ceil(1 << shift_x);
        (0..self.height).flat_map(move |row| {
            (0..self.width).map(move |col| {
                let y = (self.sample(planes[0], row * self.width + col) - black) * to_y;
                if self.chroma.is_none() {
                    return look_up(code(y) as usize);
                }
                let at = (row >> shift_y) * stride + (col >> shift_x);
                if self.matrix == Matrix::Gbr {
                    let [blue, red] = [1, 2].map(|p| self.sample(planes[p], at) * to_y);
                    return linear.light([red, y, blue].map(code), [unit, 65535.0], look_up).min(1.0);
                }
                let [cb, cr] = [1, 2].map(|p| (self.sample(planes[p], at) - middle) * to_c);
                let red = y + 2.0 * (1.0 - kr) * cr;
                let blue = y + 2.0 * (1.0 - kb) * cb;
                let green = (y - kr * red - kb * blue) / kg;
                // The weights add up to 1 only within rounding.
                linear.light([red, green, blue].map(code), [unit, 65535.0], look_up).min(1.0)
            })
        })
    }

    /// Codes of black and white in Y', and the whole swing of Cb and Cr (BT.709-6, item 4.6).
    fn levels(self) -> [f32; 3] {
        let step = (1_u32 << (self.depth - 8)) as f32;
        if self.full {
            let top = ((1_u32 << self.depth) - 1) as f32;
            [0.0, top, top]
        } else {
            [16.0 * step, 235.0 * step, 224.0 * step]
        }
    }

    fn sample(self, plane: &[u8], at: usize) -> f32 {
        if self.depth == 8 {
            f32::from(plane[at])
        } else {
            f32::from(u16::from_le_bytes([plane[2 * at], plane[2 * at + 1]]))
        }
    }
}
