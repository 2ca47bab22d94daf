//! The open connections of a server, and their limits.

use std::collections::VecDeque;
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Limits of the connections to a server.
///
/// If the number of connections reaches its limit, a new connection replaces the oldest connection without an accepted
/// request. Any process of the machine can open connections, but only a request with the token is accepted.
///
/// # Examples
/// ```
/// use std::time::Duration;
/// use spikelane_view::ConnectionLimits;
/// let limits = ConnectionLimits::default().with_connections(8).with_request_time(Duration::from_secs(2));
/// assert_eq!((limits.connections, limits.request_time.as_secs()), (8, 2));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ConnectionLimits {
    /// Largest number of connections at the same time.
    pub connections: usize,
    /// Longest time from the start of a connection to the last byte of its request.
    pub request_time: Duration,
}

impl Default for ConnectionLimits {
    /// 64 connections and 10 s.
    fn default() -> Self {
        Self { connections: 64, request_time: Duration::from_secs(10) }
    }
}

impl ConnectionLimits {
    /// Sets the largest number of connections at the same time, at least 1.
    #[must_use]
    pub fn with_connections(mut self, connections: usize) -> Self {
        self.connections = connections.max(1);
        self
    }

    /// Sets the longest time from the start of a connection to the last byte of its request.
    #[must_use]
    pub fn with_request_time(mut self, request_time: Duration) -> Self {
        self.request_time = request_time;
        self
    }
}

/// All open connections.
#[derive(Debug)]
pub(crate) struct Connections {
    pub(crate) limits: ConnectionLimits,
    open: Mutex<OpenConnections>,
    /// Notified when a connection ends and when a request is accepted.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct OpenConnections {
    count: usize,
    /// The connections without an accepted request, the oldest first. Any process of the machine can create them.
    unaccepted: VecDeque<Arc<TcpStream>>,
}

impl Connections {
    pub(crate) fn new(limits: ConnectionLimits) -> Self {
        Self { limits, open: Mutex::default(), changed: Condvar::new() }
    }

    /// Adds a connection. If the limit is reached, the function closes the oldest connection without an accepted request
    /// and waits for its end. If all requests are accepted, it closes `stream` and returns `None`.
    pub(crate) fn admit(self: &Arc<Self>, stream: TcpStream) -> Option<Connection> {
        let mut open = self.lock();
        while open.count >= self.limits.connections {
            // The thread of the connection still answers a request that has arrived completely.
            let _ = open.unaccepted.pop_front()?.shutdown(Shutdown::Read);
            open = self.changed.wait(open).unwrap_or_else(PoisonError::into_inner);
        }
        let stream = Arc::new(stream);
        open.count += 1;
        open.unaccepted.push_back(Arc::clone(&stream));
        drop(open);
        Some(Connection { stream, all: Arc::clone(self) })
    }

    fn lock(&self) -> MutexGuard<'_, OpenConnections> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An open connection. The connection ends when this value is dropped.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: Arc<TcpStream>,
    all: Arc<Connections>,
}

impl Connection {
    pub(crate) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Keeps the connection open when the limit is reached, because its request is accepted.
    pub(crate) fn set_accepted(&self) {
        self.remove_unaccepted(&mut self.all.lock());
        self.all.changed.notify_all();
    }

    fn remove_unaccepted(&self, open: &mut OpenConnections) {
        open.unaccepted.retain(|stream| !Arc::ptr_eq(stream, &self.stream));
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        let mut open = self.all.lock();
        self.remove_unaccepted(&mut open);
        open.count -= 1;
        drop(open);
        self.all.changed.notify_all();
    }
}
