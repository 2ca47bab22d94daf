//! Tests untrusted files and folders.

mod folders;
mod hostile;
