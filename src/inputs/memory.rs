//! Memory allocations whose size depends on an input.

use std::fmt::Display;

use crate::count::Count;
use crate::error::{Result, error};

/// Checks that the system can allocate `bytes` now.
///
/// Some functions allocate in other crates, or in code that cannot return an error. A failed allocation then aborts the
/// process. Before such a function, call `check_memory` with an upper bound of the memory. The memory is not reserved:
/// another thread can allocate it first.
///
/// # Errors
/// Returns [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot allocate the bytes.
pub fn check_memory(subject: impl Display, bytes: usize) -> Result<()> {
    reserved_vec::<u8>(subject, bytes).map(drop)
}

/// Returns an empty vector with capacity for `len` values. `subject` names the purpose in errors.
///
/// # Errors
/// Returns [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot allocate the memory.
pub fn reserved_vec<T>(subject: impl Display, len: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    match values.try_reserve_exact(len) {
        Ok(()) => Ok(values),
        Err(_) => Err(error!(Memory, "{subject}";
            found "not enough memory for {}", Count(len as u128 * size_of::<T>() as u128, "byte");
            expected "enough free memory";
            remedy "use a smaller input, a machine with more memory or a higher memory limit")),
    }
}

/// Returns a vector of `len` zeros. `subject` names the purpose in errors.
///
/// # Errors
/// Returns [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot allocate the memory.
pub fn zeroed_vec<T: Copy + Default>(subject: impl Display, len: usize) -> Result<Vec<T>> {
    let mut values = reserved_vec(subject, len)?;
    values.resize(len, T::default());
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn sizes_that_no_machine_has_are_an_error() {
        for len in [usize::MAX, isize::MAX as usize / 8, 1 << 60] {
            let error = zeroed_vec::<u64>("a file", len).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Memory, "{len}");
        }
        assert_eq!(zeroed_vec::<u16>("a file", 3).unwrap(), [0; 3]);
    }

    #[test]
    fn work_that_no_machine_has_memory_for_is_refused_before_it_begins() {
        assert_eq!(check_memory("a plan", usize::MAX / 4).unwrap_err().kind(), ErrorKind::Memory);
        check_memory("a plan", 1 << 20).unwrap();
    }
}
