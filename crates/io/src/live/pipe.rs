//! A sink that writes to a pipe or socket.

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::live::sink::{Delivery, OverflowPolicy, Sink, StopFlag, wait_for};
use spikelane::error::{Error, Result, error};

/// Maximum time that `finish` waits for a consumer after the user requested a stop.
const STOP_TIMEOUT: Duration = Duration::from_millis(500);

/// A sink that writes bursts to any writer. A separate thread writes, so that the sink can detect a slow consumer.
pub struct PipeSink {
    bursts: Option<SyncSender<Vec<u8>>>,
    empty: Receiver<Vec<u8>>,
    thread: Option<JoinHandle<std::io::Result<()>>>,
    policy: OverflowPolicy,
    stop: StopFlag,
    description: String,
}

impl PipeSink {
    /// Creates a sink that writes to `into`. The queue contains up to `bursts` bursts (at least 1). Error messages
    /// refer to the sink as `description`.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub fn new(
        into: Box<dyn Write + Send>,
        description: &str,
        bursts: usize,
        policy: OverflowPolicy,
        stop: StopFlag,
    ) -> Result<Self> {
        let (sender, full) = sync_channel(bursts.max(1));
        let (back, empty) = channel();
        let thread = std::thread::Builder::new().name("sink".into());
        let thread = thread.spawn(move || write(into, &full, &back));
        let thread = thread.map_err(|e| Error::io("a thread to write readouts", e))?;
        let (bursts, thread) = (Some(sender), Some(thread));
        Ok(Self { bursts, empty, thread, policy, stop, description: description.to_owned() })
    }

    /// Joins the writing thread. Returns the error that ended the thread, or `Closed` if the consumer disconnected.
    fn join_writer(&mut self) -> Result<Delivery> {
        self.bursts = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(e)))
                if e.kind() != io::ErrorKind::BrokenPipe && e.kind() != io::ErrorKind::ConnectionReset =>
            {
                Err(Error::io(&self.description, e))
            }
            Some(Err(_)) => Err(error!(Io, "{}", self.description; found "a thread that ended")),
            _ => Ok(Delivery::Closed),
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
        // `send` fails if the sink was dropped. The buffer is then not needed again.
        let _ = back.send(burst);
    }
    into.flush()
}

impl Sink for PipeSink {
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery> {
        let Some(bursts) = &self.bursts else { return Ok(Delivery::Closed) };
        let mut burst = self.empty.try_recv().unwrap_or_default();
        burst.clear();
        burst.extend_from_slice(frames);
        let mut pending = Some(burst);
        let mut offer = || {
            let burst = pending.take()?;
            match bursts.try_send(burst) {
                Ok(()) => Some(Some(Delivery::Accepted)),
                Err(TrySendError::Disconnected(_)) => Some(None),
                Err(TrySendError::Full(burst)) if self.policy == OverflowPolicy::Block => {
                    pending = Some(burst);
                    None
                }
                Err(TrySendError::Full(_)) => Some(Some(Delivery::Dropped)),
            }
        };
        match wait_for(&self.stop, &mut offer) {
            Some(Some(delivery)) => Ok(delivery),
            Some(None) => self.join_writer(),
            None => Ok(Delivery::Closed),
        }
    }

    fn finish(&mut self) -> Result<()> {
        self.bursts = None;
        let Some(thread) = &self.thread else { return Ok(()) };
        let mut stop_time = None;
        while !thread.is_finished() {
            if self.stop.is_raised() && stop_time.get_or_insert_with(Instant::now).elapsed() > STOP_TIMEOUT {
                // The writing thread is blocked, because the consumer does not read. The thread ends when the process
                // ends.
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.join_writer().map(drop)
    }
}
