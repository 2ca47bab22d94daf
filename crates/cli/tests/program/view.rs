//! Tests the command `view` with a program in the place of the browser.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt as _;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::program_support::TestFolder;

/// Sends a request to an address without a fragment, and returns the response.
fn get(address: &str) -> String {
    let (host, path) = address.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    stream.write_all(format!("GET /{path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).unwrap();
    let mut response = String::new();
    stream.read_to_string(&mut response).unwrap();
    response
}

#[test]
fn the_browser_receives_an_address_without_the_token() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 16 --height 16 --readouts 20 -o a");
    let browser = if cfg!(target_os = "macos") { "bin/open" } else { "bin/xdg-open" };
    std::fs::create_dir(place.path("bin")).unwrap();
    let program = place.write(browser, "#!/bin/sh\nprintf '%s\\n' \"$@\" > new && mv new arguments\n");
    std::fs::set_permissions(program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", place.path("bin").display(), std::env::var("PATH").unwrap());
    let mut view = place.command("view a.dat --state z=2");
    let mut view = view.env("PATH", path).stdout(Stdio::piped()).spawn().unwrap();
    let mut printed = String::new();
    BufReader::new(view.stdout.take().unwrap()).read_line(&mut printed).unwrap();
    // The limit only ends a test that fails.
    let start = Instant::now();
    while !place.path("arguments").exists() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    let arguments = String::from_utf8(place.read("arguments")).unwrap();
    let page = printed.trim_end().strip_suffix("#z=2").unwrap();
    let token = page.trim_end_matches('/').rsplit('/').next().unwrap();
    let given = arguments.trim_end().strip_suffix("#z=2").unwrap();
    assert!(token.len() == 32 && !arguments.contains(token), "{arguments}");
    let redirect = get(given);
    assert!(redirect.starts_with("HTTP/1.1 303 ") && redirect.contains(&format!("Location: /{token}/\r\n")));
    assert!(get(page).starts_with("HTTP/1.1 200 "));
    assert!(get(given).starts_with("HTTP/1.1 403 "), "the address leads to the page once");
    view.kill().unwrap();
    view.wait().unwrap();
}
