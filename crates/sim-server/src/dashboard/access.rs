//! Where the server listens, and what whoever asks must know.

use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};

use axum::http::{HeaderMap, Uri, header};
use clap::Args;
use subtle::ConstantTimeEq;

use crate::failure::Failure;
use crate::output;

/// The options of commands with a server.
#[derive(Debug, Args)]
pub(crate) struct AccessArgs {
    /// Address to listen at. Another one than this computer's own needs a --token-file; nothing is
    /// encrypted.
    #[arg(long, value_name = "IP", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// File with a token of 16 to 256 letters, digits and -._~ that every request must carry
    /// (Authorization: Bearer TOKEN; a browser opens /?token=TOKEN once).
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
}

/// Who may ask.
#[derive(Debug, Clone)]
pub(crate) struct Access {
    pub(super) bind: IpAddr,
    token: Option<String>,
}

/// Name of the cookie that a browser keeps.
const COOKIE: &str = "tractrix_token";
/// Lengths of a token.
const LENGTHS: std::ops::RangeInclusive<usize> = 16..=256;

impl AccessArgs {
    /// Reads the token.
    ///
    /// # Errors
    /// [`Failure::Input`]: a token is missing, or cannot be used; names the file.
    pub(crate) fn read(&self) -> Result<Access, Failure> {
        let token = self.token_file.as_deref().map(read_token).transpose()?;
        let bind = self.bind;
        if !bind.is_loopback() {
            if token.is_none() {
                return Err(Failure::Input(format!(
                    "--bind {bind}: whoever reaches this computer could command the server; it \
                     needs a --token-file"
                )));
            }
            output::note(&format!(
                "warning: --bind {bind}: other computers reach the server, and nothing is encrypted"
            ));
        }
        Ok(Access { bind, token })
    }
}

/// The token of a file: its first line.
fn read_token(path: &Path) -> Result<String, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
    let token = text.lines().next().unwrap_or_default().trim();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-._~".contains(c);
    if !LENGTHS.contains(&token.len()) || !token.chars().all(plain) {
        let why = "its first line is to be a token of 16 to 256 letters, digits and -._~";
        return Err(Failure::file(path, why));
    }
    Ok(token.to_owned())
}

/// Whether a `Host`, with a port or without, is a name of this computer.
pub(crate) fn is_this_computer(host: &str) -> bool {
    matches!(without_port(host), "127.0.0.1" | "localhost" | "[::1]")
}

fn without_port(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.parse::<u16>().is_ok() => name,
        _ => host,
    }
}

fn is_address(name: &str) -> bool {
    match name.strip_prefix('[').and_then(|name| name.strip_suffix(']')) {
        Some(v6) => v6.parse::<std::net::Ipv6Addr>().is_ok(),
        None => name.parse::<Ipv4Addr>().is_ok(),
    }
}

impl Access {
    /// This computer, without a token.
    #[cfg(test)]
    pub(super) const fn loopback() -> Self {
        Self { bind: IpAddr::V4(Ipv4Addr::LOCALHOST), token: None }
    }

    /// Whether this name of a host may be asked for: a name of this computer, or, where others may
    /// ask, an address. A foreign name that leads here is not served (DNS rebinding).
    pub(super) fn serves(&self, host: &str) -> bool {
        is_this_computer(host) || (is_address(without_port(host)) && !self.bind.is_loopback())
    }

    /// Whether a request carries the token, if there is one.
    pub(super) fn admits(&self, headers: &HeaderMap) -> bool {
        let Some(token) = &self.token else { return true };
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let bearer = text(header::AUTHORIZATION).and_then(|value| value.strip_prefix("Bearer "));
        let cookies = text(header::COOKIE).unwrap_or_default().split(';');
        let mut cookies = cookies.filter_map(|cookie| cookie.trim().split_once('='));
        let kept = cookies.find(|(name, _)| *name == COOKIE).map(|(_, value)| value);
        bearer.into_iter().chain(kept).any(|given| same(given, token))
    }

    /// The cookie for a browser that opens a page with the token in its address, and the address
    /// without it.
    pub(super) fn cookie_for(&self, uri: &Uri) -> Option<(String, String)> {
        let token = self.token.as_ref()?;
        let mut given = None;
        let others: Vec<&str> = uri
            .query()?
            .split('&')
            .filter(|pair| match pair.strip_prefix("token=") {
                Some(value) => {
                    given = Some(value);
                    false
                }
                None => true,
            })
            .collect();
        if !same(given?, token) {
            return None;
        }
        let query =
            if others.is_empty() { String::new() } else { format!("?{}", others.join("&")) };
        let cookie = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/");
        Some((cookie, format!("{}{query}", uri.path())))
    }
}

/// In a time that does not tell how much of it is right.
fn same(given: &str, token: &str) -> bool {
    given.as_bytes().ct_eq(token.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use axum::http::{HeaderName, HeaderValue};

    use super::*;

    const TOKEN: &str = "abcdefghijklmnop";

    fn access(bind: &str, token: Option<&str>) -> Access {
        Access { bind: bind.parse().unwrap(), token: token.map(str::to_owned) }
    }

    #[test]
    fn only_names_of_this_computer_are_served_and_addresses_where_others_may_ask() {
        let (own, open) = (access("127.0.0.1", None), access("0.0.0.0", Some(TOKEN)));
        for good in ["127.0.0.1:8080", "localhost:8080", "localhost", "[::1]:8080", "[::1]"] {
            assert!(own.serves(good) && open.serves(good), "{good}");
        }
        for address in ["192.168.1.7:8080", "10.0.0.1", "[fe80::1]:80"] {
            assert!(!own.serves(address) && open.serves(address), "{address}");
        }
        for bad in ["", "evil.example:8080", "127.0.0.1.evil.example", "localhost:x", "::1"] {
            assert!(!own.serves(bad) && !open.serves(bad), "{bad}");
        }
    }

    #[test]
    fn a_token_is_carried_in_a_header_or_a_cookie() {
        let access = access("127.0.0.1", Some(TOKEN));
        let with = |name: HeaderName, value: &'static str| {
            access.admits(&HeaderMap::from_iter([(name, HeaderValue::from_static(value))]))
        };
        assert!(with(header::AUTHORIZATION, "Bearer abcdefghijklmnop"));
        assert!(with(header::COOKIE, "a=b; tractrix_token=abcdefghijklmnop"));
        for wrong in
            ["Bearer abcdefghijklmno", "Bearer ", "abcdefghijklmnop", "Bearer abcdefghijklmnopq"]
        {
            assert!(!with(header::AUTHORIZATION, wrong), "{wrong}");
        }
        assert!(!with(header::COOKIE, "tractrix_token=") && !access.admits(&HeaderMap::new()));
        let cookie = |uri: &str| access.cookie_for(&uri.parse().unwrap());
        let (kept, place) = cookie("/runs?a=1&token=abcdefghijklmnop&b=2").unwrap();
        assert!(kept.contains("HttpOnly") && kept.contains("SameSite=Strict"));
        assert_eq!(place, "/runs?a=1&b=2");
        assert_eq!(cookie("/?token=wrong-wrong-wrong"), None);
    }

    #[test]
    fn other_computers_need_a_token_of_some_length() {
        let there = tempfile::tempdir().unwrap();
        let file = there.path().join("token");
        let args = |bind: &str, file: Option<&Path>| AccessArgs {
            bind: bind.parse().unwrap(),
            token_file: file.map(Path::to_owned),
        };
        assert!(args("0.0.0.0", None).read().unwrap_err().line().contains("--token-file"));
        for bad in ["", "short", "with space in the middle", &"x".repeat(257)] {
            std::fs::write(&file, bad).unwrap();
            assert!(args("127.0.0.1", Some(&file)).read().unwrap_err().line().contains("token"));
        }
        std::fs::write(&file, format!("{TOKEN}\n")).unwrap();
        assert!(args("0.0.0.0", Some(&file)).read().is_ok());
    }
}
