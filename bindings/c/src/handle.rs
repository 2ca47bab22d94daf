//! The memory behind a handle.
//!
//! All handles point to the type [`Handle`], which detects a handle of another kind. A freed handle must not be used.
//! valgrind and AddressSanitizer detect the use of a freed handle.
#![forbid(unsafe_code)]

use std::sync::{RwLock, TryLockError};

use spikelane::{Error, ErrorKind, Result};

use crate::camera::Camera;
use crate::error::usage;
use crate::simulator::Simulator;
use crate::writer::Writer;

/// The first word of a handle.
pub const MAGIC: u64 = 0x5350_4b4c_414e_4501;

/// The object to which a handle points.
#[repr(C)]
pub struct Handle {
    /// Identifies the memory as a handle. It is read before all other fields, because a caller may pass a pointer to
    /// something else.
    magic: u64,
    content: RwLock<Content>,
}

/// The content of a handle.
pub enum Content {
    Camera(Box<Camera>),
    Simulator(Box<Simulator>),
    Writer(Box<Writer>),
}

/// A type that can be the content of a handle.
pub trait HandleContent: Sized {
    /// Name in errors.
    const NAME: &'static str;
    fn from_content(content: &Content) -> Option<&Self>;
    fn from_content_mut(content: &mut Content) -> Option<&mut Self>;
}

macro_rules! impl_handle_content {
    ($($type:ident, $name:literal);*) => {
        $(impl HandleContent for $type {
            const NAME: &'static str = $name;

            fn from_content(content: &Content) -> Option<&Self> {
                match content {
                    Content::$type(it) => Some(it),
                    _ => None,
                }
            }

            fn from_content_mut(content: &mut Content) -> Option<&mut Self> {
                match content {
                    Content::$type(it) => Some(it),
                    _ => None,
                }
            }
        })*
    };
}

impl_handle_content!(Camera, "a camera"; Simulator, "a simulator"; Writer, "a writer");

impl Handle {
    pub fn new(content: Content) -> Box<Self> {
        Box::new(Self { magic: MAGIC, content: RwLock::new(content) })
    }

    /// Calls `work` with shared access to the content.
    pub fn read<T: HandleContent, R>(&self, work: impl FnOnce(&T) -> Result<R>) -> Result<R> {
        let content = self.content.try_read().map_err(|e| locked_error::<T, _>(&e))?;
        work(T::from_content(&content).ok_or_else(|| wrong_handle_error::<T>(&content))?)
    }

    /// Calls `work` with exclusive access to the content.
    pub fn write<T: HandleContent, R>(&self, work: impl FnOnce(&mut T) -> Result<R>) -> Result<R> {
        let mut content = self.content.try_write().map_err(|e| locked_error::<T, _>(&e))?;
        match T::from_content_mut(&mut content) {
            Some(it) => work(it),
            None => Err(wrong_handle_error::<T>(&content)),
        }
    }

    /// Returns an error if the content is not a `T` or if another call is using the content.
    pub fn check_idle<T: HandleContent>(&self) -> Result<()> {
        let content = match self.content.try_write() {
            // After a panic, the only allowed operation is to free the handle.
            Err(TryLockError::Poisoned(content)) => content.into_inner(),
            content => content.map_err(|e| locked_error::<T, _>(&e))?,
        };
        T::from_content(&content).map(drop).ok_or_else(|| wrong_handle_error::<T>(&content))
    }
}

fn locked_error<T: HandleContent, G>(error: &TryLockError<G>) -> Error {
    match error {
        TryLockError::WouldBlock => usage(
            T::NAME,
            "a call of another thread at work on it",
            "one call at a time",
            "wait for the other call, or make one for each thread",
        ),
        TryLockError::Poisoned(_) => {
            usage(T::NAME, "one that an earlier fault has left half-changed", "a sound one", "free it")
        }
    }
}

fn wrong_handle_error<T: HandleContent>(content: &Content) -> Error {
    let found = match content {
        Content::Camera(_) => Camera::NAME,
        Content::Simulator(_) => Simulator::NAME,
        Content::Writer(_) => Writer::NAME,
    };
    Error::new(ErrorKind::Usage, "handle").found(found).expected(T::NAME).remedy("look where it was made")
}
