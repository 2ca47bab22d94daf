//! Tests the server over TCP: access, requests, and text from files.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use spikelane::{Geometry, Result, SpikeFrames, reconstruct};
use spikelane_io::formats::{Layout, OpenOptions};
use spikelane_view::{ConnectionLimits, EndReason, Server, SourceOptions, Sources};
use tempfile::TempDir;

const WIDTH: usize = 19;
const HEIGHT: usize = 7;

/// Returns 60 readouts in which pixel `p` fires every `2 + p mod 5` readouts.
fn frames() -> SpikeFrames {
    let pixels = WIDTH * HEIGHT;
    let bit = |t: usize, p: usize| u8::from((t + p).is_multiple_of(2 + p % 5));
    let dense: Vec<u8> = (0..60).flat_map(|t| (0..pixels).map(move |p| bit(t, p))).collect();
    SpikeFrames::from_dense(geometry(), &dense).unwrap()
}

fn geometry() -> Geometry {
    Geometry::new(WIDTH as u32, HEIGHT as u32).unwrap()
}

/// A running server.
struct TestServer {
    _folder: TempDir,
    port: u16,
    token: String,
    one_time_address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<EndReason>>>,
}

struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).unwrap()
    }
}

impl TestServer {
    /// Starts a server of the files or folders that `prepare` writes to a folder.
    fn start(prepare: impl FnOnce(&TempDir) -> Vec<PathBuf>) -> Self {
        Self::start_with_limits(ConnectionLimits::default(), prepare)
    }

    fn start_with_limits(limits: ConnectionLimits, prepare: impl FnOnce(&TempDir) -> Vec<PathBuf>) -> Self {
        let folder = TempDir::new().unwrap();
        let paths = prepare(&folder);
        let open = OpenOptions::default().with_layout(Some(Layout::DatTop)).with_geometry(Some(geometry()));
        let options = SourceOptions::default().with_open(open).with_readout_hz(Some(1000.0));
        let sources = Sources::open(&paths, &options).unwrap();
        let server = Server::bind_with_limits(sources, None, limits).unwrap();
        let (address, one_time_address) = (server.address(), server.one_time_address().unwrap());
        let (port, token) = address.strip_prefix("http://127.0.0.1:").unwrap().split_once('/').unwrap();
        let (port, token) = (port.parse().unwrap(), token.trim_end_matches('/').to_owned());
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = std::thread::spawn(move || server.run(&mut || flag.load(Ordering::Relaxed)));
        Self { _folder: folder, port, token, one_time_address, stop, thread: Some(thread) }
    }

    fn of_one_stream() -> Self {
        Self::of_one_stream_with_limits(ConnectionLimits::default())
    }

    fn of_one_stream_with_limits(limits: ConnectionLimits) -> Self {
        Self::start_with_limits(limits, |folder| {
            let path = folder.path().join("a.dat");
            std::fs::write(&path, frames().as_bytes()).unwrap();
            vec![path]
        })
    }

    fn connect(&self) -> TcpStream {
        TcpStream::connect(("127.0.0.1", self.port)).unwrap()
    }

    fn send(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Answer { status, head, body: bytes[end + 4..].to_vec() }
    }

    /// Sends a request as the page does.
    fn get(&self, path: &str) -> Answer {
        let (port, token) = (self.port, &self.token);
        self.send(&format!("GET /{token}/{path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n"))
    }

    /// Opens a page, and returns its connection after the first event.
    fn open_page(&self) -> TcpStream {
        let mut stream = self.connect();
        let (port, token) = (self.port, &self.token);
        let request = format!("GET /{token}/api/open HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        next_event(&mut stream);
        stream
    }
}

/// Reads until the end of the next event.
fn next_event(stream: &mut TcpStream) {
    let (mut last, mut byte) = ([0; 8], [0]);
    while last != *b": open\n\n" {
        stream.read_exact(&mut byte).unwrap();
        last.rotate_left(1);
        last[7] = byte[0];
    }
}

/// Returns whether the server has closed a connection. Waits for a short time.
fn is_closed(mut stream: &TcpStream) -> bool {
    stream.set_read_timeout(Some(Duration::from_millis(2))).unwrap();
    match stream.read(&mut [0]) {
        Ok(n) => n == 0,
        Err(e) => !matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut),
    }
}

impl Drop for TestServer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap().unwrap();
        }
    }
}

#[test]
fn requests_without_the_token_or_from_elsewhere_are_refused() {
    let server = TestServer::of_one_stream();
    let (port, token) = (server.port, &server.token);
    let good = format!("/{token}/api/sources");
    let local = format!("Host: 127.0.0.1:{port}\r\n");
    let refused = [
        (String::from("/"), local.clone()),
        (String::from("/api/sources"), local.clone()),
        (format!("/{}/api/sources", "0".repeat(32)), local.clone()),
        (format!("/{}/api/sources", &token[..31]), local.clone()),
        (good.clone(), String::new()),
        (good.clone(), format!("Host: evil.example:{port}\r\n")),
        (good.clone(), "Host: 127.0.0.1.evil.example\r\n".to_owned()),
        (good.clone(), format!("{local}{local}")),
        (good.clone(), format!("{local}Origin: http://evil.example\r\n")),
        (good.clone(), format!("{local}Origin: null\r\n")),
    ];
    for (path, headers) in refused {
        let answer = server.send(&format!("GET {path} HTTP/1.1\r\n{headers}\r\n"));
        assert_eq!(answer.status, 403, "{path} {headers}");
        assert!(!String::from_utf8_lossy(&answer.body).contains("a.dat"));
    }
    let accepted =
        server.send(&format!("GET {good} HTTP/1.1\r\n{local}Origin: http://localhost:{port}\r\n\r\n"));
    assert_eq!(accepted.status, 200);
    assert_eq!(server.send(&format!("POST {good} HTTP/1.1\r\n{local}Content-Length: 0\r\n\r\n")).status, 405);
}

#[test]
fn every_response_has_the_policy_that_forbids_external_sources() {
    let server = TestServer::of_one_stream();
    for path in ["", "app.js", "api/sources", "api/nothing"] {
        let head = server.get(path).head.to_lowercase();
        for text in ["content-security-policy: default-src 'none';", "nosniff", "no-store", "no-referrer"] {
            assert!(head.contains(text), "{path}: {head}");
        }
        assert!(!head.contains("unsafe") && !head.contains("http:") && !head.contains("https:"));
    }
}

#[test]
fn indices_and_paths_outside_the_list_are_errors() {
    let server = TestServer::of_one_stream();
    for s in ["1", "0.0", "0.0.clean", "-1", "18446744073709551615", "../a.dat", "/etc/passwd", ""] {
        let answer = server.get(&format!("api/stream?s={s}"));
        assert_eq!(answer.status, 400, "{s}");
        assert!(answer.json()["error"].as_str().is_some());
    }
    for path in ["../a.dat", "a.dat", "api/../a.dat", "static/app.js", "%2e%2e/a.dat", "api/report?s=0"] {
        assert!(server.get(path).status >= 400, "{path}");
    }
    for query in ["at=60&method=tfp&window=5", "at=1&method=x&window=5", "at=-1&method=tfp&window=5", "at=1"]
    {
        assert_eq!(server.get(&format!("api/image?s=0&{query}")).status, 400, "{query}");
    }
    for query in
        ["x=19&y=0&from=0&to=60", "x=0&y=7&from=0&to=60", "x=0&y=0&from=0&to=61", "x=0&y=0&from=9&to=9"]
    {
        assert_eq!(server.get(&format!("api/pixel?s=0&{query}")).status, 400, "{query}");
    }
    assert_eq!(server.get("api/region?s=0&x=0&y=0&w=20&h=1&from=0&to=60").status, 400);
}

#[test]
fn images_are_the_reconstructions_of_the_library() {
    let server = TestServer::of_one_stream();
    let frames = frames();
    let expected = [
        ("tfp", 11, reconstruct::tfp(frames.view(), 30, 5).unwrap()),
        ("span", 21, reconstruct::span_rates(frames.view(), 30, 10).unwrap()),
        ("tfi", 20, reconstruct::tfi(frames.view(), 30, 20).unwrap()),
        ("bits", 1, frames.frame(30).iter_bits()),
    ];
    for (method, window, rates) in expected {
        let body = server.get(&format!("api/image?s=0&at=30&method={method}&window={window}")).body;
        assert_eq!(decoded(&body), rates, "{method}");
    }
}

/// Decodes an image as the page does: a table of rates and one index per pixel, or the rates themselves.
fn decoded(body: &[u8]) -> Vec<f32> {
    let word = |i: usize| u32::from_le_bytes(body[i..i + 4].try_into().unwrap());
    let (width, length) = (word(0) as usize, word(4) as usize);
    match width {
        0 => (8..body.len()).step_by(4).map(|i| f32::from_bits(word(i))).collect(),
        1 => body[8 + 4 * length..].iter().map(|i| f32::from_bits(word(8 + 4 * usize::from(*i)))).collect(),
        _ => {
            let indices = body[8 + 4 * length..].chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]]));
            indices.map(|i| f32::from_bits(word(8 + 4 * usize::from(i)))).collect()
        }
    }
}

/// The bits of a frame as floats.
trait FrameBits {
    fn iter_bits(&self) -> Vec<f32>;
}

impl FrameBits for spikelane::spikes::SpikeFrame<'_> {
    fn iter_bits(&self) -> Vec<f32> {
        let pixel = |p: usize| f32::from(u8::from(self.get(p / WIDTH, p % WIDTH)));
        (0..WIDTH * HEIGHT).map(pixel).collect()
    }
}

#[test]
fn a_summary_finishes_and_its_rates_are_the_counts() {
    let server = TestServer::of_one_stream();
    assert_eq!(server.get("api/rates?s=0").status, 400, "not computed yet");
    let deadline = Instant::now() + Duration::from_secs(60);
    while server.get("api/job?task=summary&s=0").json()["state"] != "done" {
        assert!(Instant::now() < deadline);
        std::thread::sleep(Duration::from_millis(20));
    }
    let body = server.get("api/rates?s=0").body;
    let frames = frames();
    for (p, bytes) in body.chunks(4).enumerate() {
        let count = (0..60).filter(|t| frames.get(*t, p / WIDTH, p % WIDTH)).count();
        assert_eq!(f32::from_le_bytes(bytes.try_into().unwrap()), (count as f64 / 60.0) as f32);
    }
    assert_eq!(body.len(), 4 * WIDTH * HEIGHT);
}

#[test]
fn names_from_files_are_json_text_and_reports_run_no_scripts() {
    let server = TestServer::start(|folder| {
        let out = folder.path().join("out");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join("<img src=x onerror=alert(1)>.dat"), frames().as_bytes()).unwrap();
        std::fs::write(out.join("report.html"), "<script>alert(1)</script><p>text").unwrap();
        std::fs::write(folder.path().join("secret.html"), "secret").unwrap();
        vec![out]
    });
    let sources = server.get("api/sources");
    assert!(sources.head.contains("Content-Type: application/json"));
    let names = &sources.json()["sources"][0]["items"];
    assert_eq!(names[0]["name"], "<img src=x onerror=alert(1)>.dat");
    let report = server.get("api/report?s=0");
    assert!(report.head.contains("Content-Security-Policy: sandbox; default-src 'none'"), "{}", report.head);
    assert_eq!(report.body, b"<script>alert(1)</script><p>text");
}

#[test]
fn maps_in_an_output_folder_are_not_listed_as_streams() {
    let server = TestServer::start(|folder| {
        let out = folder.path().join("out");
        std::fs::create_dir(&out).unwrap();
        let map = spikelane::unstable::npy::map_to_bytes(&[0.5; 6], 3).unwrap();
        std::fs::write(out.join("dark_pa.npy"), map).unwrap();
        std::fs::write(out.join("report.html"), "<p>text").unwrap();
        std::fs::write(out.join("stream.dat"), frames().as_bytes()).unwrap();
        vec![out]
    });
    let items = server.get("api/sources").json()["sources"][0]["items"].clone();
    assert_eq!(items, serde_json::json!([{"name": "stream.dat"}]));
}

#[cfg(unix)]
#[test]
fn a_link_in_a_folder_does_not_lead_outside() {
    let server = TestServer::start(|folder| {
        let out = folder.path().join("out");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(folder.path().join("outside.dat"), frames().as_bytes()).unwrap();
        std::fs::write(out.join("inside.dat"), frames().as_bytes()).unwrap();
        std::os::unix::fs::symlink("../outside.dat", out.join("link.dat")).unwrap();
        vec![out]
    });
    let items = server.get("api/sources").json()["sources"][0]["items"].clone();
    assert_eq!(items, serde_json::json!([{"name": "inside.dat"}]));
}

#[test]
fn an_endless_request_is_cut_off() {
    let server = TestServer::of_one_stream();
    let mut stream = server.connect();
    // The server may close the connection before everything is written.
    let _ = stream.write_all(&[b'a'; 64 << 10]);
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert!(rest.is_empty());
    assert_eq!(server.get("api/sources").status, 200);
}

#[test]
fn a_request_of_single_bytes_is_closed_after_the_time_of_a_request() {
    let limits = ConnectionLimits::default().with_request_time(Duration::from_millis(50));
    let server = TestServer::of_one_stream_with_limits(limits);
    let mut stream = server.connect();
    stream.write_all(b"GET /").unwrap();
    let deadline = Instant::now() + Duration::from_secs(30);
    while !is_closed(&stream) && stream.write_all(b"a").is_ok() {
        assert!(Instant::now() < deadline, "each byte extended the time");
    }
}

#[test]
fn connections_without_the_token_cannot_take_all_places() {
    let server = TestServer::of_one_stream_with_limits(ConnectionLimits::default().with_connections(4));
    let mut page = server.open_page();
    let strangers: Vec<TcpStream> = (0..40)
        .map(|_| {
            let mut stream = server.connect();
            stream.write_all(b"GET /").unwrap();
            stream
        })
        .collect();
    for _ in 0..3 {
        assert_eq!(server.get("api/sources").status, 200);
    }
    // The oldest connections were closed for the newest connections, but the open page remains.
    assert!(strangers[..30].iter().all(is_closed));
    next_event(&mut page);
    next_event(&mut page);
}

#[test]
fn the_one_time_address_leads_to_the_page_once() {
    let server = TestServer::of_one_stream();
    let host = format!("127.0.0.1:{}", server.port);
    let path = server.one_time_address.strip_prefix(&format!("http://{host}")).unwrap();
    assert!(!path.contains(&server.token));
    let send = |host: &str| server.send(&format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    assert_eq!(send("evil.example").status, 403);
    let first = send(&host);
    assert_eq!(first.status, 303);
    assert!(first.head.contains(&format!("\r\nLocation: /{}/\r\n", server.token)), "{}", first.head);
    assert_eq!(send(&host).status, 403);
}

#[test]
fn unusual_forms_of_a_request_get_one_plain_answer_or_none() {
    let server = TestServer::of_one_stream();
    let (port, token) = (server.port, &server.token);
    let (path, host) = (format!("/{token}/api/sources"), format!("Host: 127.0.0.1:{port}\r\n"));
    let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n";
    let many = "X: y\r\n".repeat(100);
    let long = format!("X: {}\r\n", "y".repeat(17 << 10));
    for (request, status) in [
        (format!("GET {path} HTTP/1.0\r\n\r\n"), Some(403)),
        (format!("GET {path} HTTP/1.0\r\n{host}\r\n"), Some(200)),
        (format!("GET {path} HTTP/1.1\r\n{host}{upgrade}\r\n"), Some(200)),
        (format!("GET {path} HTTP/1.1\r\n{host}{upgrade}Origin: http://evil.example\r\n\r\n"), Some(403)),
        (format!("GET http://127.0.0.1:{port}{path} HTTP/1.1\r\n{host}\r\n"), Some(403)),
        (format!("GET http://evil.example/ HTTP/1.1\r\n{host}\r\n"), Some(403)),
        (format!("CONNECT evil.example:80 HTTP/1.1\r\n{host}\r\n"), Some(403)),
        (format!("GET {path} HTTP/1.1\r\n{host}\r\n").repeat(3), Some(200)),
        (format!("HEAD {path} HTTP/1.1\r\n{host}\r\n"), Some(405)),
        (format!("GET {path} HTTP/1.1\r\n{host}{many}\r\n"), None),
        (format!("GET {path} HTTP/1.1\r\n{host}{long}\r\n"), None),
        (format!("GET {path}\r\n\r\n"), None),
        ("\u{16}\u{3}\u{1}\u{0}TLS".to_owned(), None),
    ] {
        let mut stream = server.connect();
        // The server may close the connection before everything is written.
        let _ = stream.write_all(request.as_bytes());
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes);
        let found = text.strip_prefix("HTTP/1.1 ").map(|rest| rest[..3].parse::<u16>().unwrap());
        assert_eq!(found, status, "{request}");
        assert!(text.matches("HTTP/1.1 ").count() <= 1 && !text.contains("evil"), "{text}");
    }
}

#[test]
fn the_server_ends_after_the_last_page_is_closed_but_not_on_a_reload() {
    let mut server = TestServer::of_one_stream();
    drop(server.open_page());
    std::thread::sleep(Duration::from_secs(2));
    let reloaded = server.open_page();
    std::thread::sleep(Duration::from_secs(5));
    assert!(!server.thread.as_ref().unwrap().is_finished(), "a page is open");
    drop(reloaded);
    let reason = server.thread.take().unwrap().join().unwrap().unwrap();
    assert_eq!(reason, EndReason::PagesClosed);
}

#[test]
fn a_folder_without_anything_to_show_is_refused() {
    let folder = TempDir::new().unwrap();
    let error = Sources::open(&[folder.path().to_owned()], &SourceOptions::default()).unwrap_err();
    assert_eq!(error.kind(), spikelane::ErrorKind::Input);
    assert!(error.to_string().contains("expected a data set, a recording set"), "{error}");
}

#[test]
fn a_page_above_the_limit_is_refused_with_the_settings_that_help() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("large.dat");
    std::fs::write(&path, vec![0; 16 << 20]).unwrap();
    let open = OpenOptions::default()
        .with_layout(Some(Layout::DatTop))
        .with_geometry(Geometry::new(1024, 1024).ok());
    let sources = Sources::open(&[path], &SourceOptions::default().with_open(open)).unwrap();
    let error = spikelane_view::export_page(&sources, 0..128, None).unwrap_err().to_string();
    assert!(error.contains("at most 20 MB") && error.contains("choose at most"), "{error}");
    assert!(spikelane_view::export_page(&sources, 0..10, None).is_ok());
}
