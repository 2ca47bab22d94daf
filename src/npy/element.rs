//! Element types of arrays.

use crate::variants::variant_names;

/// The type of an array's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// One byte, 0 or 1.
    Bool,
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 8 bits.
    I8,
    /// Signed, 16 bits.
    I16,
    /// Signed, 32 bits.
    I32,
    /// Signed, 64 bits.
    I64,
    /// Half precision.
    F16,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

variant_names!(Element {
    Bool = "bool", U8 = "u8", U16 = "u16", U32 = "u32", U64 = "u64", I8 = "i8", I16 = "i16", I32 = "i32",
    I64 = "i64", F16 = "f16", F32 = "f32", F64 = "f64",
});

impl Element {
    /// Returns the size of an element in bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Returns whether the type is a floating-point type.
    #[must_use]
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// Returns the letter and the number of bytes of the type, as in NumPy.
    fn code(self) -> String {
        format!("{}{}", &self.name()[..1], self.bytes())
    }

    /// Returns NumPy's type string (`descr`) for this type in little-endian order.
    pub(super) fn descr(self) -> String {
        let order = if self.bytes() == 1 { '|' } else { '<' };
        format!("{order}{}", self.code())
    }

    /// Parses a type string. Returns the element type and whether it is big-endian.
    pub(super) fn from_descr(descr: &str) -> Option<(Self, bool)> {
        let order = descr.chars().next().filter(|c| "<>|=".contains(*c));
        let code = &descr[order.map_or(0, char::len_utf8)..];
        let element =
            Self::ALL.into_iter().find(|e| e.code() == code || (*e == Self::Bool && code == "?"))?;
        let big = match order {
            Some('>') => true,
            Some('<' | '|') => false,
            _ => cfg!(target_endian = "big"),
        };
        Some((element, big && element.bytes() > 1))
    }

    /// Calls `take` with every complete element of `bytes` as an `f64`. Integers above 2^53 are rounded.
    pub fn for_each(self, big_endian: bool, bytes: &[u8], mut take: impl FnMut(f64)) {
        macro_rules! each {
            ($t:ty) => {{
                let order = if big_endian { <$t>::from_be_bytes } else { <$t>::from_le_bytes };
                bytes.as_chunks().0.iter().for_each(|b| take(order(*b) as f64));
            }};
        }
        match self {
            Self::Bool | Self::U8 => each!(u8),
            Self::U16 => each!(u16),
            Self::U32 => each!(u32),
            Self::U64 => each!(u64),
            Self::I8 => each!(i8),
            Self::I16 => each!(i16),
            Self::I32 => each!(i32),
            Self::I64 => each!(i64),
            Self::F16 => {
                let order = if big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
                bytes.as_chunks().0.iter().for_each(|b| take(f16_to_f64(order(*b))));
            }
            Self::F32 => each!(f32),
            Self::F64 => each!(f64),
        }
    }
}

/// Converts IEEE 754 half precision: a sign bit, five exponent bits and ten fraction bits.
fn f16_to_f64(bits: u16) -> f64 {
    let fraction = f64::from(bits & 0x3ff);
    let size = match bits >> 10 & 0x1f {
        // Subnormal numbers are multiples of 2^-24, and `fraction` is the multiple.
        0 => fraction / 16_777_216.0,
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        exponent => (1.0 + fraction / 1024.0) * 2f64.powi(i32::from(exponent) - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_is_ieee() {
        // The bits are `numpy.float16(x).view('u2')` of 1, -2, the largest and the smallest number, 1/3 and infinity.
        let pairs = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_477_539_063e-8),
            (0x3555, 0.333_251_953_125),
            (0x7c00, f64::INFINITY),
        ];
        for (bits, value) in pairs {
            assert_eq!(f16_to_f64(bits), value, "{bits:#x}");
        }
        assert!(f16_to_f64(0x7e00).is_nan());
    }

    #[test]
    fn every_type_is_read_in_both_byte_orders() {
        for element in Element::ALL {
            let one: Vec<u8> = match element {
                Element::F16 => 0x3c00u16.to_le_bytes().into(),
                Element::F32 => 1f32.to_le_bytes().into(),
                Element::F64 => 1f64.to_le_bytes().into(),
                _ => (0..element.bytes()).map(|i| u8::from(i == 0)).collect(),
            };
            for big in [false, true] {
                let bytes: Vec<u8> = if big { one.iter().rev().copied().collect() } else { one.clone() };
                let mut values = Vec::new();
                element.for_each(big, &bytes, |v| values.push(v));
                assert_eq!(values, [1.0], "{element}");
            }
            assert_eq!(Element::from_descr(&element.descr()), Some((element, false)));
        }
        assert_eq!(Element::from_descr(">i2"), Some((Element::I16, true)));
        for other in ["<c8", "|S3", "|O", "", "<", "é", "<f16"] {
            assert_eq!(Element::from_descr(other), None, "{other}");
        }
    }
}
