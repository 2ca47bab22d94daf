//! Ends processes that left the process group of a method.
//!
//! If the parent of a process ends, Linux makes the nearest ancestor with the attribute *child subreaper* the new parent.
//! With this attribute, this process finds all descendants of a method, whatever group or session they are in.

use spikelane::error::Result;

/// Longest time in which killed processes end. A process that waits for a device ends late.
#[cfg(target_os = "linux")]
const END_LIMIT: std::time::Duration = std::time::Duration::from_secs(5);

/// The processes that this process adopts.
#[derive(Clone, Debug, Default)]
pub(super) struct Orphans {
    /// The children of this process before the run, or `None` if this process adopts no processes.
    #[cfg(target_os = "linux")]
    earlier_children: Option<Vec<rustix::process::Pid>>,
}

#[cfg(target_os = "linux")]
impl Orphans {
    /// Makes this process the parent of all detached descendants.
    pub(super) fn adopt() -> Self {
        use rustix::process::{getpid, set_child_subreaper};
        let earlier_children = descendants(&[]);
        Self { earlier_children: set_child_subreaper(Some(getpid())).ok().map(|()| earlier_children) }
    }

    /// Ends all descendants of this process, except the children that existed before the run.
    ///
    /// # Errors
    /// [`ErrorKind::Tool`](spikelane::ErrorKind::Tool) if a process does not end.
    pub(super) fn end(&self) -> Result<()> {
        use rustix::process::{Signal, WaitOptions, kill_process, waitpid};
        use spikelane::error::{Error, ErrorKind};
        let Some(earlier) = &self.earlier_children else { return Ok(()) };
        let start = std::time::Instant::now();
        loop {
            let found = descendants(earlier);
            let Some(first) = found.first() else { return Ok(()) };
            // A process may end by itself in the meantime, so errors are ignored.
            for pid in &found {
                let _ = kill_process(*pid, Signal::KILL);
            }
            for pid in &found {
                let _ = waitpid(Some(*pid), WaitOptions::NOHANG);
            }
            if start.elapsed() > END_LIMIT {
                return Err(Error::new(ErrorKind::Tool, format_args!("process {}", first.as_raw_nonzero()))
                    .found("a process of the method that does not end")
                    .expected(format_args!("its end within {} s", END_LIMIT.as_secs())));
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
}

#[cfg(not(target_os = "linux"))]
impl Orphans {
    pub(super) fn adopt() -> Self {
        Self::default()
    }

    pub(super) fn end(&self) -> Result<()> {
        Ok(())
    }
}

/// Returns the descendants of this process, except the processes `excluded` and their descendants.
#[cfg(target_os = "linux")]
fn descendants(excluded: &[rustix::process::Pid]) -> Vec<rustix::process::Pid> {
    use rustix::process::{Pid, WaitId, WaitIdOptions, getpid, waitid};
    // Without any child, the list of all processes is not read.
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    if waitid(WaitId::All, options).is_err_and(|e| e == rustix::io::Errno::CHILD) {
        return Vec::new();
    }
    let processes: Vec<(Pid, Pid)> = std::fs::read_dir("/proc")
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| {
            let id = entry.file_name().to_str()?.parse().ok()?;
            let stat = std::fs::read(entry.path().join("stat")).ok()?;
            // The name of the program is in parentheses and may contain any bytes. The parent is the second word after it.
            let parent =
                String::from_utf8_lossy(&stat).rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()?;
            Some((Pid::from_raw(id)?, Pid::from_raw(parent)?))
        })
        .collect();
    let (mut found, mut parents) = (Vec::new(), vec![getpid()]);
    while let Some(parent) = parents.pop() {
        for (id, _) in processes.iter().filter(|(id, p)| *p == parent && !excluded.contains(id)) {
            found.push(*id);
            parents.push(*id);
        }
    }
    found
}
