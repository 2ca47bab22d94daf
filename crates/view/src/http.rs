//! The part of HTTP/1.1 that the viewer needs: GET requests without a body, and one request per connection.

use std::borrow::Cow;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Largest request line with headers in bytes.
const MAX_HEAD_BYTES: usize = 16 << 10;

const MAX_HEADERS: usize = 64;

/// Longest time in which a client must accept a part of the response. Only a client with the token receives a response
/// that does not fit into the buffer of the system.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// The policy of all responses. The page loads nothing from other origins, and no inline script runs.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
     connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// The policy of report pages from files. Scripts, forms and external sources are off.
pub(crate) const REPORT_POLICY: &str =
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'";

/// The request line and the headers that the viewer checks.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) is_get: bool,
    /// Path without the query.
    pub(crate) path: String,
    /// Text after `?`.
    pub(crate) query: String,
    /// `None` if the header is missing or occurs twice.
    pub(crate) host: Option<String>,
    /// All `Origin` headers.
    pub(crate) origins: Vec<String>,
}

/// A response. Its body has a known length.
pub(crate) struct Response {
    status: u16,
    content_type: &'static str,
    policy: &'static str,
    headers: Vec<(&'static str, String)>,
    body: Cow<'static, [u8]>,
}

impl Response {
    pub(crate) fn new(content_type: &'static str, body: impl Into<Cow<'static, [u8]>>) -> Self {
        let body = body.into();
        Self { status: 200, content_type, policy: CONTENT_SECURITY_POLICY, headers: Vec::new(), body }
    }

    pub(crate) fn json(value: &serde_json::Value) -> Self {
        Self::new("application/json", value.to_string().into_bytes())
    }

    /// Returns a response whose body contains little-endian 32-bit floats.
    pub(crate) fn floats(values: &[f32]) -> Self {
        let body = if cfg!(target_endian = "little") {
            bytemuck::cast_slice(values).to_vec()
        } else {
            values.iter().flat_map(|v| v.to_le_bytes()).collect()
        };
        Self::new("application/octet-stream", body)
    }

    pub(crate) fn text(status: u16, text: &str) -> Self {
        Self { status, ..Self::new("text/plain; charset=utf-8", text.as_bytes().to_vec()) }
    }

    /// Returns a response that leads the browser to `path`.
    pub(crate) fn redirect(path: String) -> Self {
        Self::text(303, "").with_header("Location", path)
    }

    pub(crate) fn with_status(self, status: u16) -> Self {
        Self { status, ..self }
    }

    pub(crate) fn with_policy(self, policy: &'static str) -> Self {
        Self { policy, ..self }
    }

    /// Adds a header. The value must be ASCII without control characters.
    pub(crate) fn with_header(mut self, name: &'static str, value: String) -> Self {
        self.headers.push((name, value));
        self
    }

    /// Writes the response. `with_body` is false for requests that only check the headers.
    ///
    /// # Errors
    /// If the client has closed the connection.
    pub(crate) fn write(&self, mut stream: &TcpStream) -> std::io::Result<()> {
        let mut head = head(self.status, self.content_type, self.policy);
        for (name, value) in &self.headers {
            head.push_str(&format!("{name}: {value}\r\n"));
        }
        head.push_str(&format!("Content-Length: {}\r\n\r\n", self.body.len()));
        stream.write_all(head.as_bytes())?;
        stream.write_all(&self.body)?;
        stream.flush()
    }
}

/// Writes the head of an endless event stream.
///
/// # Errors
/// If the client has closed the connection.
pub(crate) fn write_event_head(mut stream: &TcpStream) -> std::io::Result<()> {
    let head = head(200, "text/event-stream", CONTENT_SECURITY_POLICY);
    stream.write_all(format!("{head}\r\n").as_bytes())?;
    stream.flush()
}

fn head(status: u16, content_type: &str, policy: &str) -> String {
    let reason = match status {
        200 => "OK",
        303 => "See Other",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        _ => "Error",
    };
    format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: {content_type}\r\nContent-Security-Policy: {policy}\r\n\
         X-Content-Type-Options: nosniff\r\nCache-Control: no-store\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\
         Connection: close\r\n"
    )
}

/// Reads a request. `None` means that the client sent no valid request before `deadline`.
pub(crate) fn read_request(mut stream: &TcpStream, deadline: Instant) -> Option<Request> {
    stream.set_write_timeout(Some(WRITE_TIMEOUT)).ok()?;
    stream.set_nodelay(true).ok()?;
    let mut bytes = Vec::new();
    let mut piece = [0; 4096];
    loop {
        // The time is limited for the whole request. A limit for each read would allow a byte every few seconds.
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return None;
        }
        stream.set_read_timeout(Some(left)).ok()?;
        match stream.read(&mut piece) {
            Ok(n) if n > 0 => bytes.extend_from_slice(&piece[..n]),
            _ => return None,
        }
        match parse(&bytes) {
            Ok(None) if bytes.len() < MAX_HEAD_BYTES => {}
            Ok(read) => return read,
            Err(()) => return None,
        }
    }
}

/// Parses the head of a request. `Ok(None)` means that the head is incomplete.
fn parse(bytes: &[u8]) -> Result<Option<Request>, ()> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut head = httparse::Request::new(&mut headers);
    if head.parse(bytes).map_err(|_| ())?.is_partial() {
        return Ok(None);
    }
    let values = |name: &str| -> Vec<String> {
        let same = head.headers.iter().filter(|h| h.name.eq_ignore_ascii_case(name));
        same.map(|h| String::from_utf8_lossy(h.value).into_owned()).collect()
    };
    let target = head.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let hosts = values("host");
    Ok(Some(Request {
        is_get: head.method == Some("GET"),
        path: path.to_owned(),
        query: query.to_owned(),
        host: if hosts.len() == 1 { hosts.into_iter().next() } else { None },
        origins: values("origin"),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_without_its_last_line_is_incomplete() {
        assert_eq!(parse(b"GET / HTTP/1.1\r\nHost: a\r\n"), Ok(None));
    }

    #[test]
    fn two_hosts_count_as_no_host() {
        let request = parse(b"GET /a?b=c HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n").unwrap().unwrap();
        assert_eq!((request.path.as_str(), request.query.as_str(), request.host), ("/a", "b=c", None));
    }
}
