//! Files and folders from strangers.

mod folders;
mod hostile;
