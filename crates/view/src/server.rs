//! The server: one thread per connection, and the end of the server after the last page is closed.

use std::io::Write as _;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use spikelane::error::{Error, Result, error};
use spikelane::unstable::threads;

use crate::access::{self, AccessRule};
use crate::api::Api;
use crate::connections::{Connection, ConnectionLimits, Connections};
use crate::http::{Response, read_request, write_event_head};
use crate::jobs::Jobs;
use crate::peer::is_own_client;
use crate::sources::Sources;

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
    connections: Arc<Connections>,
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
    /// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the port is in use, or if the system has no random numbers.
    pub fn bind(sources: Sources, port: Option<u16>) -> Result<Self> {
        Self::bind_with_limits(sources, port, ConnectionLimits::default())
    }

    /// Binds as [`bind`](Self::bind) does, with other limits of the connections.
    ///
    /// # Errors
    /// As [`bind`](Self::bind).
    pub fn bind_with_limits(sources: Sources, port: Option<u16>, limits: ConnectionLimits) -> Result<Self> {
        let place = format!("port {}", port.unwrap_or(0));
        let listener =
            TcpListener::bind((Ipv4Addr::LOCALHOST, port.unwrap_or(0))).map_err(|e| Error::io(&place, e))?;
        let port = listener.local_addr().map_err(|e| Error::io(&place, e))?.port();
        let shared = Shared {
            api: Api { sources, jobs: Jobs::default() },
            rule: AccessRule::new(port)?,
            has_ended: AtomicBool::new(false),
            connections: Arc::new(Connections::new(limits)),
            pages: Mutex::default(),
        };
        Ok(Self { listener, shared: Arc::new(shared) })
    }

    /// Returns the address of the page. It contains a random token, which every request must contain.
    #[must_use]
    pub fn address(&self) -> String {
        self.shared.rule.address()
    }

    /// Returns an address that leads to the page once. `None` if it was used.
    ///
    /// It does not contain the token of [`address`](Self::address), so it can be an argument of a program, which other users
    /// of the machine can read. On Linux, a client of another user cannot use the address, unless the user is root.
    #[must_use]
    pub fn one_time_address(&self) -> Option<String> {
        self.shared.rule.one_time_address()
    }

    /// Answers requests until the last page is closed, or until `should_stop` returns true.
    ///
    /// # Errors
    /// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the system cannot start a thread.
    pub fn run(self, should_stop: &mut dyn FnMut() -> bool) -> Result<EndReason> {
        let address = self.listener.local_addr().map_err(|e| Error::io("address of the viewer", e))?;
        let input = (self.listener, Arc::clone(&self.shared));
        threads::spawn("viewer", input, |(listener, shared)| accept(&listener, &shared))
            .map_err(|_| error!(Io, "thread of the viewer"; found "no free thread"))?;
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
        if let Some(connection) = shared.connections.admit(stream) {
            // If the system starts no thread, the connection is closed.
            let input = (connection, Arc::clone(shared));
            drop(threads::spawn("connection", input, |(connection, shared)| answer(&connection, &shared)));
        }
    }
}

fn answer(connection: &Connection, shared: &Shared) {
    let stream = connection.stream();
    let deadline = Instant::now() + shared.connections.limits.request_time;
    let Some(request) = read_request(stream, deadline) else { return };
    let rule = &shared.rule;
    let response = match rule.accepted_path(&request) {
        None if rule.use_one_time_address(&request, || is_own_client(stream)) => {
            Response::redirect(rule.page_path())
        }
        None if !access::is_local(&request) => Response::text(
            403,
            "The viewer answers only requests to 127.0.0.1, localhost or [::1], and only requests of its own pages.\n\
             To open it from another machine, forward a port: ssh -L PORT:127.0.0.1:PORT server\n",
        ),
        None => Response::text(403, "Open the address that the program printed. It contains a token.\n"),
        Some(path) => {
            connection.set_accepted();
            match path {
                _ if !request.is_get => Response::text(405, "only GET requests are answered\n"),
                "api/open" => return serve_heartbeat(stream, shared),
                path => shared.api.respond(path, &request.query),
            }
        }
    };
    // A browser that has closed the connection needs no answer.
    let _ = response.write(stream);
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
fn serve_heartbeat(mut stream: &TcpStream, shared: &Shared) {
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
