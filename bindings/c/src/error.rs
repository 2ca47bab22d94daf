//! What went wrong, kept for the thread that asked.
#![forbid(unsafe_code)]

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

use spikelane::{Error, Kind, Result};

use crate::types::spl_status;

/// The last failure: its status, and the message and parts in the order of their numbers.
struct Last {
    status: spl_status,
    texts: [CString; 5],
}

thread_local! {
    static LAST: RefCell<Last> =
        RefCell::new(Last { status: spl_status::SPL_OK, texts: Default::default() });
}

/// Does the work of a door: whatever goes wrong becomes a status.
pub fn door(work: impl FnOnce() -> Result<()>) -> spl_status {
    // A handle that a panic left half-changed is poisoned, see `Shell`.
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => spl_status::SPL_OK,
        Ok(Err(error)) => {
            let parts = error.parts();
            let texts = [&error.to_string(), parts.subject, parts.found, parts.expected, parts.remedy];
            keep(status(parts.kind), texts)
        }
        Err(panic) => {
            let said = panic.downcast_ref::<String>().map(String::as_str);
            let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
            let message = format!("spikelane: found {said}, expected no panic; please report it");
            keep(spl_status::SPL_PANIC, [&message, "spikelane", said, "no panic", "please report it"])
        }
    }
}

fn keep(status: spl_status, texts: [&str; 5]) -> spl_status {
    let texts = texts.map(|text| CString::new(text.replace('\0', "?")).unwrap_or_default());
    // A thread that is ending has nobody to ask what went wrong.
    let _ = LAST.try_with(|last| last.replace(Last { status, texts }));
    status
}

/// The status of this thread's last failure.
pub fn last_status() -> spl_status {
    LAST.try_with(|last| last.borrow().status).unwrap_or(spl_status::SPL_OK)
}

/// A part of this thread's last failure; empty for a part that there is not.
pub fn last_text(part: u32) -> *const c_char {
    let text = |last: &RefCell<Last>| last.borrow().texts.get(part as usize).map(|text| text.as_ptr());
    LAST.try_with(text).ok().flatten().unwrap_or(c"".as_ptr())
}

fn status(kind: Kind) -> spl_status {
    match kind {
        Kind::Usage => spl_status::SPL_USAGE,
        Kind::Config => spl_status::SPL_CONFIG,
        Kind::Input => spl_status::SPL_INPUT,
        Kind::Space => spl_status::SPL_SPACE,
        Kind::Exists => spl_status::SPL_EXISTS,
        Kind::Tool => spl_status::SPL_TOOL,
        Kind::Corrupt => spl_status::SPL_CORRUPT,
        Kind::Busy => spl_status::SPL_BUSY,
        Kind::Memory => spl_status::SPL_MEMORY,
        Kind::Interrupted => spl_status::SPL_INTERRUPTED,
        _ => spl_status::SPL_IO,
    }
}

/// A wrong argument.
pub fn usage(
    subject: impl Display,
    found: impl Display,
    expected: impl Display,
    remedy: impl Display,
) -> Error {
    Error::new(Kind::Usage, subject).found(found).expected(expected).remedy(remedy)
}

/// A string of the caller as text.
pub fn utf8<'a>(text: &'a CStr, name: &str) -> Result<&'a str> {
    text.to_str().map_err(|e| usage(name, e, "UTF-8", "convert the string"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_status_is_the_exit_code_of_the_program() {
        let kinds = [
            Kind::Usage,
            Kind::Config,
            Kind::Input,
            Kind::Io,
            Kind::Space,
            Kind::Exists,
            Kind::Tool,
            Kind::Corrupt,
            Kind::Busy,
            Kind::Memory,
            Kind::Interrupted,
        ];
        for kind in kinds {
            assert_eq!(status(kind) as i32, i32::from(kind.exit_code()), "{}", kind.name());
        }
    }

    #[test]
    fn a_panic_becomes_a_status_with_its_words() {
        assert_eq!(door(|| panic!("made up")), spl_status::SPL_PANIC);
        assert_eq!(last_status(), spl_status::SPL_PANIC);
        LAST.with(|last| assert_eq!(last.borrow().texts[2].to_str(), Ok("made up")));
    }

    #[test]
    fn a_thread_has_its_own_last_error() {
        let fail = || door(|| Err(usage("a\0b", "c", "d", "e")));
        assert_eq!(fail(), spl_status::SPL_USAGE);
        std::thread::spawn(|| assert_eq!(last_status(), spl_status::SPL_OK)).join().unwrap();
        LAST.with(|last| assert_eq!(last.borrow().texts[0].to_str(), Ok("a\\u{0}b: found c, expected d; e")));
    }
}
