//! Mappings of files that another process may shorten.
//!
//! The system answers an access behind the new end of a mapped file with SIGBUS, which ends the process. For a mapping
//! that is listed here the handler puts empty memory in its place and makes a note, so that the access succeeds and the
//! owner can report an error. Every other SIGBUS goes to the handler that was there before.
#![allow(unsafe_code, reason = "handlers of signals are unsafe by their nature")]

use std::io;

/// A listed mapping. Drop it before the mapping.
#[derive(Debug)]
pub(super) struct Watched(#[cfg(unix)] &'static unix::Entry);

impl Watched {
    /// Lists the `len` bytes from `start` on, which are mapped; the first call installs the handler.
    ///
    /// # Errors
    /// When the system refuses the handler.
    pub(super) fn new(start: *mut u8, len: usize) -> io::Result<Self> {
        #[cfg(unix)]
        return unix::list(start as usize, len).map(Self);
        // Windows refuses to shorten a file that is mapped.
        #[cfg(not(unix))]
        {
            let _ = (start, len);
            Ok(Self())
        }
    }

    /// Whether the file was found shorter, and the mapping is no longer that of the file.
    pub(super) fn is_shortened(&self) -> bool {
        #[cfg(unix)]
        return self.0.shortened.load(std::sync::atomic::Ordering::Relaxed);
        #[cfg(not(unix))]
        false
    }
}

#[cfg(unix)]
impl Drop for Watched {
    fn drop(&mut self) {
        self.0.start.store(0, std::sync::atomic::Ordering::Release);
    }
}

#[cfg(unix)]
mod unix {
    use std::io;
    use std::ptr;
    use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicUsize, Ordering};
    use std::sync::{Mutex, OnceLock, PoisonError};

    /// A place in the list. It is never freed, since the handler may read the list at any moment.
    #[derive(Debug)]
    pub(super) struct Entry {
        /// Address of the mapping; 0 while the place is free.
        pub(super) start: AtomicUsize,
        len: AtomicUsize,
        pub(super) shortened: AtomicBool,
        next: Option<&'static Self>,
    }

    static FIRST: AtomicPtr<Entry> = AtomicPtr::new(ptr::null_mut());
    /// Held by who changes the list; the handler only reads it.
    static CHANGES: Mutex<()> = Mutex::new(());
    /// The handler before this one.
    static PREVIOUS: OnceLock<libc::sigaction> = OnceLock::new();

    fn entries() -> impl Iterator<Item = &'static Entry> {
        let first = FIRST.load(Ordering::Acquire);
        // SAFETY: null, or an entry that `list` leaked.
        std::iter::successors(unsafe { first.as_ref() }, |entry| entry.next)
    }

    pub(super) fn list(start: usize, len: usize) -> io::Result<&'static Entry> {
        let _changes = CHANGES.lock().unwrap_or_else(PoisonError::into_inner);
        if PREVIOUS.get().is_none() {
            install()?;
        }
        let free = entries().find(|entry| entry.start.load(Ordering::Relaxed) == 0);
        let entry = free.unwrap_or_else(|| {
            let entry = Box::leak(Box::new(Entry {
                start: AtomicUsize::new(0),
                len: AtomicUsize::new(0),
                shortened: AtomicBool::new(false),
                next: entries().next(),
            }));
            FIRST.store(entry, Ordering::Release);
            entry
        });
        entry.len.store(len, Ordering::Release);
        entry.shortened.store(false, Ordering::Relaxed);
        entry.start.store(start, Ordering::Release);
        Ok(entry)
    }

    fn install() -> io::Result<()> {
        // SAFETY: an action is plain data for which zeros are valid.
        let (mut previous, mut action) = unsafe { std::mem::zeroed::<(libc::sigaction, libc::sigaction)>() };
        let handler: extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void) = on_bus_error;
        action.sa_sigaction = handler as usize;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        // SAFETY: both pointers are to actions of this frame; the handler calls nothing but what signals allow, and
        // finds `PREVIOUS` set, since it is set before the handler is installed.
        unsafe {
            if libc::sigaction(libc::SIGBUS, ptr::null(), &raw mut previous) != 0 {
                return Err(io::Error::last_os_error());
            }
            let _ = PREVIOUS.set(previous);
            if libc::sigaction(libc::SIGBUS, &raw const action, ptr::null_mut()) != 0 {
                return Err(io::Error::last_os_error());
            }
        }
        Ok(())
    }

    extern "C" fn on_bus_error(_: libc::c_int, info: *mut libc::siginfo_t, _: *mut libc::c_void) {
        // SAFETY: the system hands a valid `info` to handlers that are installed with SA_SIGINFO.
        let at = unsafe { (*info).si_addr() } as usize;
        for entry in entries() {
            let start = entry.start.load(Ordering::Acquire);
            let len = entry.len.load(Ordering::Acquire);
            // A place that another mapping takes meanwhile has another start, and is not that of this access.
            if start == 0
                || entry.start.load(Ordering::Relaxed) != start
                || !(start..start + len).contains(&at)
            {
                continue;
            }
            let access = libc::PROT_READ | libc::PROT_WRITE;
            let kind = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED;
            // SAFETY: the range is that of a mapping whose owner is listed, so it is mapped and nobody else's. The owner reads and
            // writes it by atomic words alone, for which zeros are valid. `mmap` is a plain call of the system.
            let mapped = unsafe { libc::mmap(start as *mut libc::c_void, len, access, kind, -1, 0) };
            if mapped != libc::MAP_FAILED {
                entry.shortened.store(true, Ordering::Relaxed);
                return;
            }
        }
        if let Some(previous) = PREVIOUS.get() {
            // The access is repeated after the return, and meets the handler that was there before.
            // SAFETY: `previous` is what the system returned for this signal.
            unsafe { libc::sigaction(libc::SIGBUS, previous, ptr::null_mut()) };
        }
    }
}
