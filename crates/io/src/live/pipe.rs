//! A pipe or socket as a sink.

use std::io::{ErrorKind, Write};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::live::sink::{Delivery, Policy, Sink, Stop, wait};
use spikelane::error::{Error, Kind, Result};

/// How long the end waits for a consumer that takes nothing once the user has asked to stop.
const PATIENCE: Duration = Duration::from_millis(500);

/// Bursts on their way into anything that can be written to; a thread writes, so that a slow consumer is seen.
pub struct Pipe {
    bursts: Option<SyncSender<Vec<u8>>>,
    empty: Receiver<Vec<u8>>,
    thread: Option<JoinHandle<std::io::Result<()>>>,
    policy: Policy,
    stop: Stop,
    about: String,
}

impl Pipe {
    /// Writes to `into`, called `about` in errors, with room for `bursts` bursts (at least 1) before it.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn new(
        into: Box<dyn Write + Send>,
        about: &str,
        bursts: usize,
        policy: Policy,
        stop: Stop,
    ) -> Result<Self> {
        let (sender, full) = sync_channel(bursts.max(1));
        let (back, empty) = channel();
        let thread = std::thread::Builder::new().name("sink".into());
        let thread = thread.spawn(move || write(into, &full, &back));
        let thread = thread.map_err(|e| Error::io("a thread to write readouts", e))?;
        let (bursts, thread) = (Some(sender), Some(thread));
        Ok(Self { bursts, empty, thread, policy, stop, about: about.to_owned() })
    }

    /// What made the writing thread end before its time.
    fn ended(&mut self) -> Result<Delivery> {
        self.bursts = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(e)))
                if e.kind() != ErrorKind::BrokenPipe && e.kind() != ErrorKind::ConnectionReset =>
            {
                Err(Error::io(&self.about, e))
            }
            Some(Err(_)) => Err(Error::new(Kind::Io, &self.about).found("a thread that ended")),
            _ => Ok(Delivery::Gone),
        }
    }
}

fn write(
    mut into: Box<dyn Write + Send>,
    full: &Receiver<Vec<u8>>,
    back: &std::sync::mpsc::Sender<Vec<u8>>,
) -> std::io::Result<()> {
    for burst in full {
        into.write_all(&burst)?;
        // Nobody waits for it at the end.
        let _ = back.send(burst);
    }
    into.flush()
}

impl Sink for Pipe {
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery> {
        let Some(bursts) = &self.bursts else { return Ok(Delivery::Gone) };
        let mut burst = self.empty.try_recv().unwrap_or_default();
        burst.clear();
        burst.extend_from_slice(frames);
        let mut waiting = Some(burst);
        let mut offer = || {
            let burst = waiting.take()?;
            match bursts.try_send(burst) {
                Ok(()) => Some(Some(Delivery::Taken)),
                Err(TrySendError::Disconnected(_)) => Some(None),
                Err(TrySendError::Full(burst)) if self.policy == Policy::Block => {
                    waiting = Some(burst);
                    None
                }
                Err(TrySendError::Full(_)) => Some(Some(Delivery::Dropped)),
            }
        };
        match wait(&self.stop, &mut offer) {
            Some(Some(delivery)) => Ok(delivery),
            Some(None) => self.ended(),
            None => Ok(Delivery::Gone),
        }
    }

    fn finish(&mut self) -> Result<()> {
        self.bursts = None;
        let Some(thread) = &self.thread else { return Ok(()) };
        let mut asked = None;
        while !thread.is_finished() {
            if self.stop.is_raised() && asked.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
                // The thread hangs in a write that nobody reads, and ends with the process.
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.ended().map(drop)
    }
}
