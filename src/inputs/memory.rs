//! Memory whose size comes from an input.

use std::fmt::Display;

use crate::error::{Error, Kind, Result};

/// Returns an empty vector with room for `len` values that `subject` requires.
///
/// # Errors
/// [`Kind::Memory`] when the system has no such room.
pub(crate) fn buffer<T>(subject: impl Display, len: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    match values.try_reserve_exact(len) {
        Ok(()) => Ok(values),
        Err(_) => Err(Error::new(Kind::Memory, subject)
            .found(format_args!("no memory for {len} values of {} bytes", size_of::<T>()))
            .expected("memory for them")
            .remedy("give a smaller input, or a machine or a limit with more memory")),
    }
}

/// Returns `len` zero values that `subject` requires.
///
/// # Errors
/// [`Kind::Memory`] when the system has no such room.
pub(crate) fn zeroed<T: Copy + Default>(subject: impl Display, len: usize) -> Result<Vec<T>> {
    let mut values = buffer(subject, len)?;
    values.resize(len, T::default());
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_that_no_machine_has_are_an_error() {
        for len in [usize::MAX, isize::MAX as usize / 8, 1 << 60] {
            let error = zeroed::<u64>("a file", len).unwrap_err();
            assert_eq!(error.kind(), Kind::Memory, "{len}");
        }
        assert_eq!(zeroed::<u16>("a file", 3).unwrap(), [0; 3]);
    }
}
