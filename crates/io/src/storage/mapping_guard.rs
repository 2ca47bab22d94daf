//! Protects mappings of files that another process may truncate.
//!
//! If another process truncates a mapped file, an access beyond the new end of the file raises SIGBUS. By default,
//! SIGBUS ends the process. If the mapping is registered, the signal handler replaces the mapping with anonymous
//! memory and sets a flag. The access then succeeds, and the owner of the mapping can report an error. The handler
//! passes every other SIGBUS to the previous handler.
#![allow(unsafe_code, reason = "handlers of signals are unsafe by their nature")]

use std::io;

/// A registered mapping. This value must be dropped before the mapping.
#[derive(Debug)]
pub(super) struct MappingGuard(#[cfg(unix)] &'static unix::Entry);

impl MappingGuard {
    /// Registers the mapping of `len` bytes at `start`. The first call also installs the signal handler.
    ///
    /// # Errors
    /// If the system rejects the handler.
    pub(super) fn new(start: *mut u8, len: usize) -> io::Result<Self> {
        #[cfg(unix)]
        return unix::register(start as usize, len).map(Self);
        // Windows does not permit truncating a mapped file, so no handler is needed.
        #[cfg(not(unix))]
        {
            let _ = (start, len);
            Ok(Self())
        }
    }

    /// Returns whether the file was truncated. In that case the mapping no longer contains the bytes of the file.
    pub(super) fn is_truncated(&self) -> bool {
        #[cfg(unix)]
        return self.0.truncated.load(std::sync::atomic::Ordering::Relaxed);
        #[cfg(not(unix))]
        false
    }
}

#[cfg(unix)]
impl Drop for MappingGuard {
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

    /// An entry of the list of registered mappings. Entries are never freed, because the signal handler may read the
    /// list at any time.
    #[derive(Debug)]
    pub(super) struct Entry {
        /// Address of the mapping, or 0 if the entry is free.
        pub(super) start: AtomicUsize,
        len: AtomicUsize,
        pub(super) truncated: AtomicBool,
        next: Option<&'static Self>,
    }

    static FIRST_ENTRY: AtomicPtr<Entry> = AtomicPtr::new(ptr::null_mut());
    /// The lock of the list of registered mappings. Changes of the list require the lock. The signal handler only reads
    /// the list and does not need the lock.
    static LIST_LOCK: Mutex<()> = Mutex::new(());
    /// The SIGBUS handler that was installed before this handler.
    static PREVIOUS_HANDLER: OnceLock<libc::sigaction> = OnceLock::new();

    fn entries() -> impl Iterator<Item = &'static Entry> {
        let first = FIRST_ENTRY.load(Ordering::Acquire);
        // SAFETY: the pointer is null or refers to an entry that `register` leaked.
        std::iter::successors(unsafe { first.as_ref() }, |entry| entry.next)
    }

    pub(super) fn register(start: usize, len: usize) -> io::Result<&'static Entry> {
        let _changes = LIST_LOCK.lock().unwrap_or_else(PoisonError::into_inner);
        if PREVIOUS_HANDLER.get().is_none() {
            install()?;
        }
        let free = entries().find(|entry| entry.start.load(Ordering::Relaxed) == 0);
        let entry = free.unwrap_or_else(|| {
            let entry = Box::leak(Box::new(Entry {
                start: AtomicUsize::new(0),
                len: AtomicUsize::new(0),
                truncated: AtomicBool::new(false),
                next: entries().next(),
            }));
            FIRST_ENTRY.store(entry, Ordering::Release);
            entry
        });
        entry.len.store(len, Ordering::Release);
        entry.truncated.store(false, Ordering::Relaxed);
        entry.start.store(start, Ordering::Release);
        Ok(entry)
    }

    fn install() -> io::Result<()> {
        // SAFETY: an action is plain data for which zeros are valid.
        let (mut previous, mut action) = unsafe { std::mem::zeroed::<(libc::sigaction, libc::sigaction)>() };
        let handler: extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void) = on_bus_error;
        action.sa_sigaction = handler as usize;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        // SAFETY: both pointers refer to local actions. The handler calls only async-signal-safe functions.
        // `PREVIOUS_HANDLER` is set before the handler is installed, so the handler finds it set.
        unsafe {
            if libc::sigaction(libc::SIGBUS, ptr::null(), &raw mut previous) != 0 {
                return Err(io::Error::last_os_error());
            }
            let _ = PREVIOUS_HANDLER.set(previous);
            if libc::sigaction(libc::SIGBUS, &raw const action, ptr::null_mut()) != 0 {
                return Err(io::Error::last_os_error());
            }
        }
        Ok(())
    }

    extern "C" fn on_bus_error(_: libc::c_int, info: *mut libc::siginfo_t, _: *mut libc::c_void) {
        // SAFETY: the system passes a valid `info` to handlers that are installed with SA_SIGINFO.
        let at = unsafe { (*info).si_addr() } as usize;
        for entry in entries() {
            let start = entry.start.load(Ordering::Acquire);
            let len = entry.len.load(Ordering::Acquire);
            // If another mapping has reused the entry in the meantime, the start of the entry has changed. The
            // accessed address is then not compared with that entry.
            if start == 0
                || entry.start.load(Ordering::Relaxed) != start
                || !(start..start + len).contains(&at)
            {
                continue;
            }
            let access = libc::PROT_READ | libc::PROT_WRITE;
            let kind = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED;
            // SAFETY: the range belongs to a mapping whose owner is registered, so it is mapped and belongs to nobody
            // else. The owner accesses it only as bytes or words, for which zeros are valid. `mmap` is a plain system
            // call.
            let mapped = unsafe { libc::mmap(start as *mut libc::c_void, len, access, kind, -1, 0) };
            if mapped != libc::MAP_FAILED {
                entry.truncated.store(true, Ordering::Relaxed);
                return;
            }
        }
        if let Some(previous) = PREVIOUS_HANDLER.get() {
            // After this handler returns, the CPU repeats the access. The repeated access raises SIGBUS again, and the
            // previous handler receives the signal.
            // SAFETY: `previous` is the action that the system returned for this signal.
            unsafe { libc::sigaction(libc::SIGBUS, previous, ptr::null_mut()) };
        }
    }
}
