//! Limits the files that the processes of a method can read and write.
//!
//! Linux restricts a process with Landlock, which needs no privileges. A rule allows everything below a folder, and no rule
//! forbids a folder below an allowed folder. To hide a folder, the rules therefore allow the entries beside the folder and
//! beside each of its parents.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

use serde::{Deserialize, Serialize};
use spikelane::error::{Error, ErrorKind, Result, Setting};

use super::Method;

/// The files that the processes of a method can read and write.
#[derive(Clone, Debug)]
pub struct SandboxOptions {
    /// Whether a sandbox is used. Without a sandbox, a method can read and change all files of the user.
    pub is_enabled: bool,
    /// Folders that a method can read besides its own folder and the folders of the system. If the list is empty, a method
    /// can read all files except those of the suite and of the run.
    pub allow_read: Vec<PathBuf>,
    /// Folders that a method can read and change besides its own folder.
    pub allow_write: Vec<PathBuf>,
}

/// A sandbox in which a method can read all files except those of the suite and of the run.
impl Default for SandboxOptions {
    fn default() -> Self {
        Self { is_enabled: true, allow_read: Vec::new(), allow_write: Vec::new() }
    }
}

impl SandboxOptions {
    /// Returns the state of the sandbox, or `None` if the method starts no process.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the method starts no process and the options are not the default.
    pub fn state(&self, method: &Method) -> Result<Option<SandboxState>> {
        if matches!(method, Method::Command(_) | Method::Server(_)) {
            return Ok(Some(match self.is_enabled {
                false => SandboxState::Off,
                true if is_supported() => SandboxState::Active,
                true => SandboxState::Absent,
            }));
        }
        if self.is_enabled && self.allow_read.is_empty() && self.allow_write.is_empty() {
            return Ok(None);
        }
        Err(Error::new(ErrorKind::Usage, "sandbox")
            .found(format_args!("`{}`, which runs without a sandbox", method.name()))
            .expected("a command or a server"))
    }
}

/// Whether the processes of a run were restricted.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SandboxState {
    /// The processes could not read the suite and the run, and could change only the allowed folders.
    Active,
    /// The system has no sandbox: it is not Linux, or its kernel has no Landlock (Linux 5.13).
    Absent,
    /// The user disabled the sandbox.
    Off,
}

impl std::fmt::Display for SandboxState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Active => "active",
            Self::Absent => "absent",
            Self::Off => "off",
        })
    }
}

/// The restriction of the processes of a run.
pub(super) struct Sandbox {
    #[cfg(target_os = "linux")]
    rules: Option<landlock::RulesetCreated>,
}

/// The folders of a run, as canonical paths.
pub(super) struct RunFolders<'a> {
    /// Folders that no process of the method can read: the suite and the run.
    pub hidden: &'a [PathBuf],
    /// The folder that a method can read.
    pub readable: &'a Path,
    /// The folder that a method can change.
    pub writable: &'a Path,
}

#[cfg(target_os = "linux")]
mod linux {
    use landlock::{
        ABI, Access as _, AccessFs, BitFlags, CompatLevel, Compatible as _, Ruleset, RulesetAttr as _,
        RulesetCreated, RulesetCreatedAttr as _, RulesetError, Scope, path_beneath_rules,
    };

    use super::{Error, ErrorKind, Path, PathBuf, Result, RunFolders, SandboxOptions, Setting};

    /// The newest version of Landlock whose rights are restricted. Older kernels restrict fewer rights.
    const NEWEST: ABI = ABI::V9;

    /// Folders that a program needs and that contain no files of users.
    const SYSTEM_FOLDERS: &str = "/bin /boot /dev /etc /lib /lib32 /lib64 /nix /opt /proc \
        /run/current-system /run/opengl-driver /sbin /snap /sys /usr";

    /// Returns a set without rules, or `None` if the kernel has no Landlock.
    pub(super) fn empty_ruleset() -> Option<Ruleset> {
        Ruleset::default()
            .set_compatibility(CompatLevel::HardRequirement)
            .handle_access(AccessFs::from_all(ABI::V1))
            .and_then(|rules| {
                rules.set_compatibility(CompatLevel::BestEffort).handle_access(AccessFs::from_all(NEWEST))
            })
            .and_then(|rules| rules.scope(Scope::from_all(NEWEST)))
            .ok()
    }

    /// Returns the rules of a run, or `None` if the kernel has no Landlock.
    pub(super) fn rules(
        options: &SandboxOptions,
        folders: &RunFolders<'_>,
    ) -> Result<Option<RulesetCreated>> {
        let Some(empty) = empty_ruleset() else { return Ok(None) };
        let given = |paths: &[PathBuf], setting| -> Result<Vec<PathBuf>> {
            paths.iter().map(|path| allowed_path(path, folders.hidden, setting)).collect()
        };
        let mut readable = given(&options.allow_read, "allow_read")?;
        let writable = given(&options.allow_write, "allow_write")?;
        if readable.is_empty() {
            readable.push("/".into());
        } else {
            readable.extend(SYSTEM_FOLDERS.split(' ').filter_map(|path| Path::new(path).canonicalize().ok()));
        }
        create(empty, &readable, &writable, folders).map(Some).map_err(|e| {
            Error::new(ErrorKind::Io, "sandbox")
                .found(e)
                .remedy(format_args!("set {} if you trust the method", Setting("no_sandbox")))
        })
    }

    fn create(
        empty: Ruleset,
        readable: &[PathBuf],
        writable: &[PathBuf],
        folders: &RunFolders<'_>,
    ) -> Result<RulesetCreated, RulesetError> {
        let read = AccessFs::from_read(NEWEST);
        let devices: BitFlags<AccessFs> = AccessFs::MakeChar | AccessFs::MakeBlock;
        let change = read | (AccessFs::from_write(NEWEST) & !devices);
        let use_device = AccessFs::ReadFile | AccessFs::WriteFile | AccessFs::Truncate | AccessFs::IoctlDev;
        let visible = |roots: &[PathBuf]| {
            let mut paths = Vec::new();
            roots.iter().for_each(|root| super::push_visible(root, folders.hidden, &mut paths));
            paths
        };
        // Programs list the folders in which they search modules, so the names of hidden files are visible.
        let listed = readable.iter().filter(|path| path.is_dir());
        empty
            .create()?
            .add_rules(path_beneath_rules(listed, AccessFs::ReadDir))?
            .add_rules(path_beneath_rules(visible(readable), read))?
            .add_rules(path_beneath_rules(visible(writable), change))?
            .add_rules(path_beneath_rules([folders.readable], read))?
            .add_rules(path_beneath_rules([folders.writable, Path::new("/dev/shm")], change))?
            .add_rules(path_beneath_rules(["/dev"], use_device))
    }

    fn allowed_path(path: &Path, hidden: &[PathBuf], setting: &'static str) -> Result<PathBuf> {
        let real = path.canonicalize().map_err(|e| Error::io(path.display(), e))?;
        if hidden.iter().any(|folder| real.starts_with(folder)) {
            return Err(Error::new(ErrorKind::Usage, Setting(setting))
                .found(format_args!("{}, a path in the folder of the suite or of the run", path.display()))
                .expected("a path outside both"));
        }
        Ok(real)
    }
}

/// Appends `root` if it contains no hidden folder, and otherwise its entries beside the hidden folders.
///
/// Links are omitted, because a rule for a link allows the target.
#[cfg(target_os = "linux")]
fn push_visible(root: &Path, hidden: &[PathBuf], paths: &mut Vec<PathBuf>) {
    if hidden.iter().any(|folder| root.starts_with(folder)) {
        return;
    }
    if !hidden.iter().any(|folder| folder.starts_with(root)) {
        paths.push(root.to_owned());
        return;
    }
    for entry in std::fs::read_dir(root).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| !kind.is_symlink()) {
            push_visible(&entry.path(), hidden, paths);
        }
    }
}

#[cfg(target_os = "linux")]
fn is_supported() -> bool {
    linux::empty_ruleset().is_some()
}

#[cfg(not(target_os = "linux"))]
fn is_supported() -> bool {
    false
}

impl Sandbox {
    /// Prepares the restriction of the processes of a run.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if an allowed folder does not exist, or if the system reports an error.
    /// * [`ErrorKind::Usage`] if an allowed folder is in the folder of the suite or of the run.
    #[cfg(target_os = "linux")]
    pub(super) fn new(options: &SandboxOptions, folders: &RunFolders<'_>) -> Result<Self> {
        Ok(Self { rules: if options.is_enabled { linux::rules(options, folders)? } else { None } })
    }

    #[cfg(not(target_os = "linux"))]
    pub(super) fn new(_: &SandboxOptions, _: &RunFolders<'_>) -> Result<Self> {
        Ok(Self {})
    }

    /// Starts a process. The restriction holds for the process and its descendants.
    pub(super) fn spawn(&self, mut command: Command) -> io::Result<Child> {
        #[cfg(target_os = "linux")]
        if let Some(rules) = &self.rules {
            let rules = rules.try_clone()?;
            // A process inherits the restriction of the thread that starts it. This thread then ends.
            let start = move || {
                rules.restrict_self().map_err(io::Error::other)?;
                command.spawn()
            };
            return std::thread::scope(|scope| scope.spawn(start).join())
                .unwrap_or_else(|_| Err(io::Error::other("the thread of the sandbox panicked")));
        }
        command.spawn()
    }

    /// Returns the remedy for a program that cannot be started.
    pub(super) fn start_remedy(&self, error: &io::Error) -> String {
        #[cfg(target_os = "linux")]
        if self.rules.is_some() && error.kind() == io::ErrorKind::PermissionDenied {
            return format!(
                "move the program out of the folders of the suite and the run, or allow its folder with {}",
                Setting("allow_read")
            );
        }
        let _ = error;
        "write the path of the program, or install it; no shell reads the command".to_owned()
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn only_the_hidden_folders_and_their_parents_are_not_visible() {
        let top = tempfile::tempdir().unwrap();
        let at = |name: &str| top.path().canonicalize().unwrap().join(name);
        for folder in ["a/suite/groups", "a/other", "b", "run"] {
            std::fs::create_dir_all(at(folder)).unwrap();
        }
        std::fs::write(at("a/method.py"), "").unwrap();
        std::os::unix::fs::symlink(at("a/suite"), at("a/link")).unwrap();
        let visible = |root: &str| {
            let mut paths = Vec::new();
            push_visible(&at(root), &[at("a/suite"), at("run")], &mut paths);
            paths.sort();
            paths
        };
        assert_eq!(visible(""), [at("a/method.py"), at("a/other"), at("b")]);
        assert_eq!(visible("b"), [at("b")]);
        assert!(visible("a/suite/groups").is_empty());
    }
}
