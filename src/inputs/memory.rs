//! Memory whose size comes from an input.

use std::fmt::Display;

use crate::error::{Error, Kind, Result};

/// Checks that the system has `bytes` of memory now, for work that requires them in many parts.
///
/// Parts of such work are allocated by other crates, or by code that cannot return an error, and end the process where memory
/// is missing. So the work states an upper bound of its memory before it begins. The bytes are not kept: work on other
/// threads of the process can take them in between.
///
/// # Errors
/// [`Kind::Memory`] when the system does not have them.
pub fn check_memory(subject: impl Display, bytes: usize) -> Result<()> {
    buffer::<u8>(subject, bytes).map(drop)
}

/// Returns an empty vector with room for `len` values that `subject` requires.
///
/// # Errors
/// [`Kind::Memory`] when the system has no such room.
pub fn buffer<T>(subject: impl Display, len: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    match values.try_reserve_exact(len) {
        Ok(()) => Ok(values),
        Err(_) => Err(Error::new(Kind::Memory, subject)
            .found(format_args!("no memory for {} bytes", len as u128 * size_of::<T>() as u128))
            .expected("memory for them")
            .remedy("give a smaller input, or a machine or a limit with more memory")),
    }
}

/// Returns `len` zero values that `subject` requires.
///
/// # Errors
/// [`Kind::Memory`] when the system has no such room.
pub fn zeroed<T: Copy + Default>(subject: impl Display, len: usize) -> Result<Vec<T>> {
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

    #[test]
    fn work_that_no_machine_has_memory_for_is_refused_before_it_begins() {
        assert_eq!(check_memory("a plan", usize::MAX / 4).unwrap_err().kind(), Kind::Memory);
        check_memory("a plan", 1 << 20).unwrap();
    }
}
