//! The rules that decide which requests are answered.

use std::sync::{Mutex, PoisonError};

use crate::http::Request;
use spikelane::error::{Result, error};

/// Number of random bytes of a token.
const TOKEN_BYTES: usize = 16;

/// Accepts the requests of pages that this process served.
///
/// Another web page could send requests to this machine, and a DNS name of another site could point to this machine.
/// The token, the `Host` and the `Origin` refuse both.
#[derive(Debug)]
pub(crate) struct AccessRule {
    token: String,
    /// The token of the one-time address. `None` after its first use.
    one_time_token: Mutex<Option<String>>,
    port: u16,
}

impl AccessRule {
    /// Draws random tokens.
    ///
    /// # Errors
    /// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the system has no random numbers.
    pub(crate) fn new(port: u16) -> Result<Self> {
        Ok(Self { token: random_token()?, one_time_token: Mutex::new(Some(random_token()?)), port })
    }

    /// Returns the address of the page.
    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}{}", self.port, self.page_path())
    }

    /// Returns the path of the page.
    pub(crate) fn page_path(&self) -> String {
        format!("/{}/", self.token)
    }

    /// Returns the address that leads to the page once. `None` if it was used.
    pub(crate) fn one_time_address(&self) -> Option<String> {
        let token = self.one_time_token.lock().unwrap_or_else(PoisonError::into_inner);
        token.as_ref().map(|token| format!("http://127.0.0.1:{}/{token}", self.port))
    }

    /// Returns whether the request is the first use of the one-time address. `is_own_client` is called only for a request of
    /// this address. If it returns false, the address remains unused.
    pub(crate) fn use_one_time_address(
        &self,
        request: &Request,
        is_own_client: impl FnOnce() -> bool,
    ) -> bool {
        let mut token = self.one_time_token.lock().unwrap_or_else(PoisonError::into_inner);
        let given = request.path.strip_prefix('/').unwrap_or_default();
        let is_equal = |token: &String| equals_in_constant_time(given.as_bytes(), token.as_bytes());
        let is_used =
            request.is_get && is_local(request) && token.as_ref().is_some_and(is_equal) && is_own_client();
        if is_used {
            *token = None;
        }
        is_used
    }

    /// Returns the path after the token. `None` if the request must be refused.
    pub(crate) fn accepted_path<'a>(&self, request: &'a Request) -> Option<&'a str> {
        if !is_local(request) {
            return None;
        }
        let (token, path) = request.path.strip_prefix('/')?.split_once('/')?;
        equals_in_constant_time(token.as_bytes(), self.token.as_bytes()).then_some(path)
    }
}

/// Returns whether the request has a local `Host` and only local origins. The port can be another one than that of the server,
/// because `ssh -L`, editors and proxies forward ports. A page of another site has its own name in both headers.
pub(crate) fn is_local(request: &Request) -> bool {
    let is_local_origin = |origin: &String| {
        let host = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
        host.is_some_and(is_local_host)
    };
    request.host.as_deref().is_some_and(is_local_host) && request.origins.iter().all(is_local_origin)
}

/// Returns whether `host` is a name of this machine, with or without a port.
fn is_local_host(host: &str) -> bool {
    let rest = ["127.0.0.1", "localhost", "[::1]"].iter().find_map(|name| host.strip_prefix(name));
    rest.is_some_and(|rest| {
        rest.is_empty() || rest.strip_prefix(':').is_some_and(|port| port.parse::<u16>().is_ok())
    })
}

fn random_token() -> Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(|e| error!(Io, "random token of the viewer"; found "{e}"))?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Compares two texts. The time does not depend on the position of the first difference.
fn equals_in_constant_time(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && std::hint::black_box(a.iter().zip(b).fold(0, |sum, (a, b)| sum | (a ^ b))) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(rule: &AccessRule) -> Request {
        Request {
            is_get: true,
            path: format!("/{}/api/sources", rule.token),
            query: String::new(),
            host: Some("127.0.0.1:80".into()),
            origins: Vec::new(),
        }
    }

    #[test]
    fn tokens_of_two_servers_differ() {
        assert_ne!(AccessRule::new(80).unwrap().token, AccessRule::new(80).unwrap().token);
    }

    #[test]
    fn the_one_time_address_is_used_once_and_only_by_an_own_client() {
        let rule = AccessRule::new(80).unwrap();
        let address = rule.one_time_address().unwrap();
        let path = address.strip_prefix("http://127.0.0.1:80").unwrap().to_owned();
        assert!(!address.contains(&rule.token));
        let foreign = Request { host: Some("evil.example:80".into()), ..request(&rule) };
        assert!(!rule.use_one_time_address(&Request { path: path.clone(), ..foreign }, || true));
        assert!(!rule.use_one_time_address(&request(&rule), || true));
        let once = Request { path, ..request(&rule) };
        assert_eq!(rule.accepted_path(&once), None);
        assert!(!rule.use_one_time_address(&once, || false));
        assert!(rule.use_one_time_address(&once, || true));
        assert!(!rule.use_one_time_address(&once, || true));
        assert_eq!(rule.one_time_address(), None);
    }

    #[test]
    fn the_token_and_local_hosts_with_any_port_are_accepted() {
        let rule = AccessRule::new(80).unwrap();
        for host in ["127.0.0.1:80", "localhost:80", "localhost:9999", "127.0.0.1", "[::1]:9999", "[::1]"] {
            let origins = vec![format!("http://{host}"), format!("https://{host}")];
            let with = Request { host: Some(host.into()), origins, ..request(&rule) };
            assert_eq!(rule.accepted_path(&with), Some("api/sources"), "{host}");
        }
    }

    #[test]
    fn every_wrong_host_origin_and_token_is_refused() {
        let rule = AccessRule::new(80).unwrap();
        for host in [
            None,
            Some("evil.example:80"),
            Some("127.0.0.1.evil.example:80"),
            Some("localhost.evil.example"),
            Some("127.0.0.1:"),
            Some("localhost:80:80"),
            Some("localhost:99999"),
            Some("192.168.0.2:80"),
        ] {
            let host = host.map(str::to_owned);
            assert_eq!(rule.accepted_path(&Request { host, ..request(&rule) }), None);
        }
        for origin in
            ["null", "http://evil.example", "ftp://127.0.0.1:80", "http://127.0.0.1:80.evil.example"]
        {
            let origins = vec!["http://127.0.0.1:80".to_owned(), origin.to_owned()];
            assert_eq!(rule.accepted_path(&Request { origins, ..request(&rule) }), None, "{origin}");
        }
        let token = &rule.token;
        let wrong =
            [String::from("/"), "/api/sources".into(), format!("/{}/", &token[1..]), format!("/{token}")];
        for path in wrong.into_iter().chain([format!("/{token}0/x"), format!("//{token}/x")]) {
            assert_eq!(rule.accepted_path(&Request { path, ..request(&rule) }), None);
        }
    }
}
