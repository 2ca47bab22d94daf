//! The rules that decide which requests are answered.

use crate::http::Request;
use spikelane::error::{Error, ErrorKind, Result};

/// Number of random bytes of a token.
const TOKEN_BYTES: usize = 16;

/// Accepts the requests of pages that this process served.
///
/// Another web page could send requests to this machine, and a DNS name of another site could point to this machine.
/// The token, the `Host` and the `Origin` refuse both.
#[derive(Debug)]
pub(crate) struct AccessRule {
    token: String,
    port: u16,
}

impl AccessRule {
    /// Draws a random token.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if the system has no random numbers.
    pub(crate) fn new(port: u16) -> Result<Self> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)
            .map_err(|e| Error::new(ErrorKind::Io, "random token of the viewer").found(e))?;
        Ok(Self { token: bytes.iter().map(|b| format!("{b:02x}")).collect(), port })
    }

    /// Returns the address of the page.
    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Returns the path after the token. `None` if the request must be refused.
    pub(crate) fn accepted_path<'a>(&self, request: &'a Request) -> Option<&'a str> {
        let hosts = [format!("127.0.0.1:{}", self.port), format!("localhost:{}", self.port)];
        let is_host = |text: &str| hosts.iter().any(|host| host == text);
        if !request.host.as_deref().is_some_and(is_host) {
            return None;
        }
        if !request.origins.iter().all(|o| o.strip_prefix("http://").is_some_and(is_host)) {
            return None;
        }
        let (token, path) = request.path.strip_prefix('/')?.split_once('/')?;
        equals_in_constant_time(token.as_bytes(), self.token.as_bytes()).then_some(path)
    }
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
    fn the_token_and_both_local_hosts_are_accepted() {
        let rule = AccessRule::new(80).unwrap();
        let mut with = request(&rule);
        assert_eq!(rule.accepted_path(&with), Some("api/sources"));
        with.host = Some("localhost:80".into());
        with.origins = vec!["http://localhost:80".into()];
        assert_eq!(rule.accepted_path(&with), Some("api/sources"));
    }

    #[test]
    fn every_wrong_host_origin_and_token_is_refused() {
        let rule = AccessRule::new(80).unwrap();
        for host in [None, Some("127.0.0.1"), Some("127.0.0.1:81"), Some("evil.example:80"), Some("[::1]:80")]
        {
            let host = host.map(str::to_owned);
            assert_eq!(rule.accepted_path(&Request { host, ..request(&rule) }), None);
        }
        for origin in
            ["null", "http://evil.example", "https://127.0.0.1:80", "http://127.0.0.1:80.evil.example"]
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
