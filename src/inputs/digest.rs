//! Digests in files.

use serde::de::{Deserialize as _, Deserializer, Error as _};

use crate::error::excerpt;

/// Deserializes a digest as a `String` or an `Option<String>`: `blake3:` and 64 lowercase hexadecimal digits.
///
/// # Errors
/// Returns an error that quotes at most 200 characters if the text has another form.
pub fn deserialize_digest<'de, D: Deserializer<'de>, T: From<String>>(
    deserializer: D,
) -> Result<T, D::Error> {
    let text = String::deserialize(deserializer)?;
    let is_hex = |digits: &str| digits.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
    match text.strip_prefix("blake3:") {
        Some(digits) if digits.len() == 64 && is_hex(digits) => Ok(text.into()),
        _ => Err(D::Error::custom(format_args!(
            "the digest {:?} is not `blake3:` and 64 lowercase hexadecimal digits",
            excerpt(&text)
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_has_its_algorithm_and_its_length() {
        let parse = |text: &str| {
            deserialize_digest::<_, String>(
                serde::de::value::StrDeserializer::<serde::de::value::Error>::new(text),
            )
        };
        let digits = "0123456789abcdef".repeat(4);
        assert!(parse(&format!("blake3:{digits}")).is_ok());
        for wrong in [
            String::new(),
            digits.clone(),
            format!("blake3:{}", &digits[1..]),
            format!("blake3:{}G", &digits[1..]),
        ] {
            assert!(parse(&wrong).is_err(), "{wrong}");
        }
        let long = parse(&format!("blake3:{}", "a".repeat(30_000))).unwrap_err().to_string();
        assert!(long.len() < 320, "{} bytes", long.len());
    }
}
