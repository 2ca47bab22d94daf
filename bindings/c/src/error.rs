//! The last error of each thread.
#![forbid(unsafe_code)]

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

use spikelane::{Error, ErrorKind, Result};

use crate::types::spl_status;

/// The last failure of a thread: the status, the message and the parts of the message. The index of a text in `texts`
/// is its `SPL_ERROR_` constant.
struct LastError {
    status: spl_status,
    texts: [CString; 5],
}

thread_local! {
    static LAST_ERROR: RefCell<LastError> =
        RefCell::new(LastError { status: spl_status::SPL_OK, texts: Default::default() });
}

/// Runs the body of a C function and converts every error and panic to a status.
pub fn ffi_guard(work: impl FnOnce() -> Result<()>) -> spl_status {
    // If a panic interrupts a call that changes a handle, the lock of the handle is poisoned; see `Handle`.
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => spl_status::SPL_OK,
        Ok(Err(error)) => {
            let parts = error.parts();
            let texts =
                [&*error.to_string(), &*parts.subject, &*parts.found, &*parts.expected, &*parts.remedy];
            store_error(status(parts.kind), texts)
        }
        Err(panic) => {
            let panic_text = panic.downcast_ref::<String>().map(String::as_str);
            let panic_text =
                panic_text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
            let message = format!("spikelane: found {panic_text}, expected no panic; please report it");
            store_error(
                spl_status::SPL_PANIC,
                [&message, "spikelane", panic_text, "no panic", "please report it"],
            )
        }
    }
}

fn store_error(status: spl_status, texts: [&str; 5]) -> spl_status {
    let texts = texts.map(|text| CString::new(text.replace('\0', "?")).unwrap_or_default());
    // If the thread is ending, thread-local storage is gone and the error cannot be stored.
    let _ = LAST_ERROR.try_with(|last| last.replace(LastError { status, texts }));
    status
}

/// Returns the status of the last failure of this thread, or `SPL_OK` if no call failed.
pub fn last_status() -> spl_status {
    LAST_ERROR.try_with(|last| last.borrow().status).unwrap_or(spl_status::SPL_OK)
}

/// Returns a part of the message of this thread's last failure. A missing part is an empty string.
pub fn last_error_part(part: u32) -> *const c_char {
    let text = |last: &RefCell<LastError>| last.borrow().texts.get(part as usize).map(|text| text.as_ptr());
    LAST_ERROR.try_with(text).ok().flatten().unwrap_or(c"".as_ptr())
}

fn status(kind: ErrorKind) -> spl_status {
    match kind {
        ErrorKind::Usage => spl_status::SPL_USAGE,
        ErrorKind::Config => spl_status::SPL_CONFIG,
        ErrorKind::Input => spl_status::SPL_INPUT,
        ErrorKind::Space => spl_status::SPL_SPACE,
        ErrorKind::Exists => spl_status::SPL_EXISTS,
        ErrorKind::Tool => spl_status::SPL_TOOL,
        ErrorKind::Corrupt => spl_status::SPL_CORRUPT,
        ErrorKind::Busy => spl_status::SPL_BUSY,
        ErrorKind::Memory => spl_status::SPL_MEMORY,
        ErrorKind::Interrupted => spl_status::SPL_INTERRUPTED,
        _ => spl_status::SPL_IO,
    }
}

/// Returns the error for an invalid argument.
pub fn usage(
    subject: impl Display,
    found: impl Display,
    expected: impl Display,
    remedy: impl Display,
) -> Error {
    Error::new(ErrorKind::Usage, subject).found(found).expected(expected).remedy(remedy)
}

/// Converts a C string to UTF-8 text. `name` names the argument in errors.
pub fn utf8<'a>(text: &'a CStr, name: &str) -> Result<&'a str> {
    text.to_str().map_err(|e| usage(name, e, "UTF-8", "convert the string"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::error::Setting;

    #[test]
    fn every_status_is_the_exit_code_of_the_program() {
        let kinds = [
            ErrorKind::Usage,
            ErrorKind::Config,
            ErrorKind::Input,
            ErrorKind::Io,
            ErrorKind::Space,
            ErrorKind::Exists,
            ErrorKind::Tool,
            ErrorKind::Corrupt,
            ErrorKind::Busy,
            ErrorKind::Memory,
            ErrorKind::Interrupted,
        ];
        for kind in kinds {
            assert_eq!(status(kind) as i32, i32::from(kind.exit_code()), "{}", kind.name());
        }
    }

    #[test]
    fn a_panic_becomes_a_status_with_its_words() {
        assert_eq!(ffi_guard(|| panic!("made up")), spl_status::SPL_PANIC);
        assert_eq!(last_status(), spl_status::SPL_PANIC);
        LAST_ERROR.with(|last| assert_eq!(last.borrow().texts[2].to_str(), Ok("made up")));
    }

    #[test]
    fn a_thread_has_its_own_last_error() {
        let fail = || ffi_guard(|| Err(usage("a\0b", "c", "d", "e")));
        assert_eq!(fail(), spl_status::SPL_USAGE);
        std::thread::spawn(|| assert_eq!(last_status(), spl_status::SPL_OK)).join().unwrap();
        LAST_ERROR
            .with(|last| assert_eq!(last.borrow().texts[0].to_str(), Ok("a\\u{0}b: found c, expected d; e")));
    }

    #[test]
    fn a_setting_is_named_in_backticks() {
        let error = usage("a.dat", "no size", "a size", format_args!("set {}", Setting("width")));
        ffi_guard(|| Err(error));
        LAST_ERROR.with(|last| assert_eq!(last.borrow().texts[4].to_str(), Ok("set `width`")));
    }
}
