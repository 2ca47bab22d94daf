//! The memory behind a handle.
//!
//! All handles point at one type, `Shell`, which detects a handle of another kind. A handle must not be used after it is
//! freed: valgrind and AddressSanitizer find such a use.
#![forbid(unsafe_code)]

use std::sync::{RwLock, TryLockError};

use spikelane::{Error, Kind, Result};

use crate::camera::Camera;
use crate::error::usage;
use crate::simulator::Simulator;
use crate::writer::Writer;

/// The first word of a shell.
pub const MAGIC: u64 = 0x5350_4b4c_414e_4501;

/// What a handle points at.
#[repr(C)]
pub struct Shell {
    /// Tells a shell from other memory; read before anything else is.
    magic: u64,
    content: RwLock<Content>,
}

/// What a shell holds.
pub enum Content {
    Camera(Box<Camera>),
    Simulator(Box<Simulator>),
    Writer(Box<Writer>),
}

/// What a shell can hold.
pub trait Held: Sized {
    /// In errors.
    const NAME: &'static str;
    fn of(content: &Content) -> Option<&Self>;
    fn of_mut(content: &mut Content) -> Option<&mut Self>;
}

macro_rules! held {
    ($($type:ident, $name:literal);*) => {
        $(impl Held for $type {
            const NAME: &'static str = $name;

            fn of(content: &Content) -> Option<&Self> {
                match content {
                    Content::$type(it) => Some(it),
                    _ => None,
                }
            }

            fn of_mut(content: &mut Content) -> Option<&mut Self> {
                match content {
                    Content::$type(it) => Some(it),
                    _ => None,
                }
            }
        })*
    };
}

held!(Camera, "a camera"; Simulator, "a simulator"; Writer, "a writer");

impl Shell {
    pub fn new(content: Content) -> Box<Self> {
        Box::new(Self { magic: MAGIC, content: RwLock::new(content) })
    }

    /// Reads what it holds.
    pub fn read<T: Held, R>(&self, work: impl FnOnce(&T) -> Result<R>) -> Result<R> {
        let content = self.content.try_read().map_err(|e| locked::<T, _>(&e))?;
        work(T::of(&content).ok_or_else(|| other::<T>(&content))?)
    }

    /// Changes what it holds.
    pub fn write<T: Held, R>(&self, work: impl FnOnce(&mut T) -> Result<R>) -> Result<R> {
        let mut content = self.content.try_write().map_err(|e| locked::<T, _>(&e))?;
        match T::of_mut(&mut content) {
            Some(it) => work(it),
            None => Err(other::<T>(&content)),
        }
    }

    /// Returns an error unless it contains a `T` that no other call works on.
    pub fn check_idle<T: Held>(&self) -> Result<()> {
        let content = match self.content.try_write() {
            // After a panic nothing else is left to do.
            Err(TryLockError::Poisoned(content)) => content.into_inner(),
            content => content.map_err(|e| locked::<T, _>(&e))?,
        };
        T::of(&content).map(drop).ok_or_else(|| other::<T>(&content))
    }
}

fn locked<T: Held, G>(error: &TryLockError<G>) -> Error {
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

fn other<T: Held>(content: &Content) -> Error {
    let found = match content {
        Content::Camera(_) => Camera::NAME,
        Content::Simulator(_) => Simulator::NAME,
        Content::Writer(_) => Writer::NAME,
    };
    Error::new(Kind::Usage, "handle").found(found).expected(T::NAME).remedy("look where it was made")
}
