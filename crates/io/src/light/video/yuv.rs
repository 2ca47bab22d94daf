//! Conversion of Y'CbCr planes to luminance and to linear colors.

use ::y4m::Colorspace;

use crate::light::images::linearization::Linearization;
use spikelane::light::Transfer;

/// The matrix that converts between R'G'B' and Y'CbCr.
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
    /// No matrix. The planes contain G', B' and R' at full range.
    Gbr,
}

/// Encoding of the samples of a video stream. Each property overrides the header of the stream. If a property is
/// `None`, the header or the height of the video determines the property.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::light) struct SampleEncoding {
    pub(in crate::light) matrix: Option<Matrix>,
    pub(in crate::light) is_full_range: Option<bool>,
    pub(in crate::light) transfer: Option<Transfer>,
}

impl Matrix {
    /// Returns the matrix that players assume if a video declares none. The matrix is BT.709 for 720 rows or more, and
    /// BT.601 for fewer rows.
    #[must_use]
    pub const fn from_height(rows: usize) -> Self {
        if rows >= 720 { Self::Bt709 } else { Self::Bt601 }
    }

    /// Returns the weights of red and blue in Y'.
    const fn red_blue(self) -> [f32; 2] {
        match self {
            Self::Bt601 => [0.299, 0.114],
            Self::Bt709 => [0.2126, 0.0722],
            Self::Bt2020 => [0.2627, 0.0593],
            Self::Smpte240m => [0.212, 0.087],
            Self::Fcc => [0.30, 0.11],
            // `PlaneLayout::light` does not use the weights of RGB planes.
            Self::Gbr => [0.0, 0.0],
        }
    }
}

/// The storage of the planes of a frame, and the meaning of their codes.
#[derive(Clone, Copy, Debug)]
pub(in crate::light) struct PlaneLayout {
    pub(in crate::light) width: usize,
    pub(in crate::light) height: usize,
    pub(in crate::light) depth: usize,
    /// Base-2 logarithms of the horizontal and vertical chroma subsampling, or `None` for mono.
    pub(in crate::light) chroma: Option<[usize; 2]>,
    pub(in crate::light) is_full_range: bool,
    pub(in crate::light) matrix: Matrix,
}

/// Returns the base-2 logarithms of the horizontal and vertical chroma subsampling, or `None` for mono.
pub(in crate::light) fn chroma(space: Colorspace) -> Option<[usize; 2]> {
    match space {
        Colorspace::Cmono | Colorspace::Cmono12 => None,
        Colorspace::C422 | Colorspace::C422p10 | Colorspace::C422p12 => Some([1, 0]),
        Colorspace::C444 | Colorspace::C444p10 | Colorspace::C444p12 => Some([0, 0]),
        // All other formats are 4:2:0 and differ only in the positions of the chroma samples.
        _ => Some([1, 1]),
    }
}

impl PlaneLayout {
    /// Returns the number of bytes of all planes of one frame.
    pub(in crate::light) fn bytes(self) -> u64 {
        let chroma = self
            .chroma
            .map_or(0, |[x, y]| 2 * self.width.div_ceil(1 << x) as u64 * self.height.div_ceil(1 << y) as u64);
        let samples = self.width as u64 * self.height as u64 + chroma;
        if self.depth == 8 { samples } else { 2 * samples }
    }

    /// Returns linear red, green and blue of the pixels, row by row. Full scale is 1.0. `table` contains the linear light
    /// of each 16-bit code.
    pub(in crate::light) fn rgb(self, planes: [&[u8]; 3], table: &[f32]) -> Vec<f32> {
        self.codes(planes).flat_map(|codes| codes.map(|code| table[code as usize])).collect()
    }

    /// Returns the luminance of the pixels, row by row. Full scale is 1.0. `table` contains the linear light of each
    /// 16-bit code.
    pub(in crate::light) fn light<'a>(
        self,
        planes: [&'a [u8]; 3],
        linear: &'a Linearization,
        table: &'a [f32],
    ) -> impl Iterator<Item = f32> + 'a {
        // `table` is indexed by 16-bit codes. The gray codes of an 8-bit video are multiples of 257 in 16-bit codes.
        let unit = if self.depth == 8 { 257.0 } else { 1.0 };
        let look_up = move |code: usize| table[code];
        let max_light = table[65535].max(1.0);
        let is_mono = self.chroma.is_none();
        self.codes(planes).map(move |codes| {
            if is_mono {
                return look_up(codes[0] as usize);
            }
            // The sum of the weights can differ slightly from 1 because of rounding, so the light is limited to that of
            // the largest code.
            linear.light(codes, [unit, 65535.0], look_up).min(max_light)
        })
    }

    /// Returns the 16-bit codes of red, green and blue of the pixels, row by row. The three codes of a mono video are
    /// equal.
    fn codes<'a>(self, planes: [&'a [u8]; 3]) -> impl Iterator<Item = [f32; 3]> + 'a {
        let [black, white, swing] = self.levels();
        let (to_y, to_c) = (1.0 / (white - black), 1.0 / swing);
        let middle = (1_u32 << (self.depth - 1)) as f32;
        let [kr, kb] = self.matrix.red_blue();
        let kg = 1.0 - kr - kb;
        let code = |code: f32| (code.clamp(0.0, 1.0) * 65535.0 + 0.5).floor();
        let [shift_x, shift_y] = self.chroma.unwrap_or_default();
        let stride = self.width.div_ceil(1 << shift_x);
        (0..self.height).flat_map(move |row| {
            (0..self.width).map(move |col| {
                let y = (self.sample(planes[0], row * self.width + col) - black) * to_y;
                if self.chroma.is_none() {
                    return [code(y); 3];
                }
                let at = (row >> shift_y) * stride + (col >> shift_x);
                if self.matrix == Matrix::Gbr {
                    let [blue, red] = [1, 2].map(|p| self.sample(planes[p], at) * to_y);
                    return [red, y, blue].map(code);
                }
                let [cb, cr] = [1, 2].map(|p| (self.sample(planes[p], at) - middle) * to_c);
                let red = y + 2.0 * (1.0 - kr) * cr;
                let blue = y + 2.0 * (1.0 - kb) * cb;
                let green = (y - kr * red - kb * blue) / kg;
                [red, green, blue].map(code)
            })
        })
    }

    /// Returns three values: the code of black in Y', the code of white in Y', and the full swing of Cb and Cr
    /// (BT.709-6, item 4.6).
    fn levels(self) -> [f32; 3] {
        let step = (1_u32 << (self.depth - 8)) as f32;
        if self.is_full_range {
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
