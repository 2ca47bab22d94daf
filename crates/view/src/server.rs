//! The server: one thread per connection, and the end of the server after the last page is closed.

use std::io::Write as _;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::threads;

use crate::access::AccessRule;
use crate::api::Api;
use crate::http::{Response, read_request, write_event_head};
use crate::jobs::Jobs;
use crate::sources::Sources;

/// Largest number of connections at the same time.
const MAX_CONNECTIONS: usize = 64;

/// Time after which the server ends when no page is open. A reload takes less time.
const CLOSE_DELAY: Duration = Duration::from_secs(5);

/// Interval of the events that an open page receives. A closed page is noticed after two intervals.
const HEARTBEAT_INTERVAL: Duration = Duration::from_millis(500);

/// Interval of the checks whether the server must end.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// The reason why a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EndReason {
    /// The last page was closed.
    PagesClosed,
    /// The caller requested the end.
    Stopped,
}

/// A server on the loopback interface of this machine.
///
/// # Examples
/// ```
/// use spikelane_view::{EndReason, Server, SourceOptions, Sources};
/// let server = Server::bind(Sources::open(&[], &SourceOptions::default())?, None)?;
/// assert!(server.address().starts_with("http://127.0.0.1:"));
/// assert_eq!(server.run(&mut || true)?, EndReason::Stopped);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub struct Server {
    listener: TcpListener,
    shared: Arc<Shared>,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // The address contains the token.
        f.debug_struct("Server").field("sources", &self.shared.api.sources).finish_non_exhaustive()
    }
}

struct Shared {
    api: Api,
    rule: AccessRule,
    has_ended: AtomicBool,
    connections: AtomicUsize,
    pages: Mutex<Pages>,
}

/// The pages that are open.
#[derive(Default)]
struct Pages {
    open: usize,
    /// Time at which the last page was closed. `None` if a page is open or no page was opened yet.
    closed: Option<Instant>,
}

impl Server {
    /// Binds to 127.0.0.1. Without `port`, the system selects a free port.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if the port is in use, or if the system has no random numbers.
    pub fn bind(sources: Sources, port: Option<u16>) -> Result<Self> {
        let place = format!("port {}", port.unwrap_or(0));
        let listener =
            TcpListener::bind((Ipv4Addr::LOCALHOST, port.unwrap_or(0))).map_err(|e| Error::io(&place, e))?;
        let port = listener.local_addr().map_err(|e| Error::io(&place, e))?.port();
        let shared = Shared {
            api: Api { sources, jobs: Jobs::default() },
            rule: AccessRule::new(port)?,
            has_ended: AtomicBool::new(false),
            connections: AtomicUsize::new(0),
            pages: Mutex::default(),
        };
        Ok(Self { listener, shared: Arc::new(shared) })
    }

    /// Returns the address of the page. It contains a random token, which every request must contain.
    #[must_use]
    pub fn address(&self) -> String {
        self.shared.rule.address()
    }

    /// Answers requests until the last page is closed, or until `should_stop` returns true.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if the system cannot start a thread.
    pub fn run(self, should_stop: &mut dyn FnMut() -> bool) -> Result<EndReason> {
        let address = self.listener.local_addr().map_err(|e| Error::io("address of the viewer", e))?;
        let input = (self.listener, Arc::clone(&self.shared));
        threads::spawn("viewer", input, |(listener, shared)| accept(&listener, &shared))
            .map_err(|_| Error::new(ErrorKind::Io, "thread of the viewer").found("no free thread"))?;
        let reason = loop {
            if should_stop() {
                break EndReason::Stopped;
            }
            if self.shared.pages().closed.is_some_and(|at| at.elapsed() >= CLOSE_DELAY) {
                break EndReason::PagesClosed;
            }
            std::thread::sleep(CHECK_INTERVAL);
        };
        self.shared.has_ended.store(true, Ordering::Relaxed);
        // The thread that accepts connections checks the flag after the next connection.
        drop(TcpStream::connect(address));
        Ok(reason)
    }
}

impl Shared {
    fn pages(&self) -> std::sync::MutexGuard<'_, Pages> {
        self.pages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming() {
        if shared.has_ended.load(Ordering::Relaxed) {
            return;
        }
        let Ok(stream) = stream else {
            std::thread::sleep(CHECK_INTERVAL);
            continue;
        };
        let slot = ConnectionSlot::new(shared);
        if shared.connections.load(Ordering::Relaxed) <= MAX_CONNECTIONS {
            // If the system starts no thread, the connection is closed.
            drop(threads::spawn("connection", (stream, slot), |(stream, slot)| answer(stream, &slot.0)));
        }
    }
}

/// Counts a connection until it is dropped.
struct ConnectionSlot(Arc<Shared>);

impl ConnectionSlot {
    fn new(shared: &Arc<Shared>) -> Self {
        shared.connections.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(shared))
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        self.0.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

fn answer(mut stream: TcpStream, shared: &Arc<Shared>) {
    let Some(request) = read_request(&mut stream) else { return };
    let response = match shared.rule.accepted_path(&request) {
        None => Response::text(403, "Open the address that the program printed. It contains a token.\n"),
        Some(_) if !request.is_get => Response::text(405, "only GET requests are answered\n"),
        Some("api/open") => return serve_heartbeat(&mut stream, shared),
        Some(path) => shared.api.respond(path, &request.query),
    };
    // A browser that has closed the connection needs no answer.
    let _ = response.write(&mut stream);
}

/// Counts a page until it is dropped.
struct OpenPage<'a>(&'a Shared);

impl<'a> OpenPage<'a> {
    fn new(shared: &'a Shared) -> Self {
        let mut pages = shared.pages();
        pages.open += 1;
        pages.closed = None;
        drop(pages);
        Self(shared)
    }
}

impl Drop for OpenPage<'_> {
    fn drop(&mut self) {
        let mut pages = self.0.pages();
        pages.open -= 1;
        pages.closed = (pages.open == 0).then(Instant::now);
    }
}

/// Sends events until the page is closed. A timer of the page would not work, because browsers slow down the timers of
/// hidden pages.
fn serve_heartbeat(stream: &mut TcpStream, shared: &Shared) {
    let _page = OpenPage::new(shared);
    if write_event_head(stream).is_err() {
        return;
    }
    while !shared.has_ended.load(Ordering::Relaxed) {
        if stream.write_all(b": open\n\n").and_then(|()| stream.flush()).is_err() {
            return;
        }
        std::thread::sleep(HEARTBEAT_INTERVAL);
    }
}
