//! Checks the Host header of requests.
//!
//! Another site can let its own name resolve to this device (DNS rebinding) and then read it
//! through its visitor's browser. It cannot forge the Host header, so only IP addresses,
//! `localhost` and configured names are answered.

use axum::http::{HeaderMap, HeaderName, StatusCode, Uri, header};
use std::net::{IpAddr, Ipv6Addr};

use super::problem::{Answered, Problem};

/// Checks that a request names one host, and that this is the device.
///
/// # Errors
/// 400 where it names several, 421 where it names none or another.
pub fn check(uri: &Uri, headers: &HeaderMap, configured: &[String]) -> Answered<()> {
    let host = only(headers, &header::HOST);
    let several = headers.get_all(header::HOST).iter().count() > 1;
    // The request line may name a host, too.
    let named = uri.authority().map(|authority| authority.as_str());
    if several || named.is_some_and(|named| host.is_some_and(|host| host != named)) {
        let words = "the request names more than one host: send one Host header, and in the request line a path only";
        return Err(Problem::unclear(words));
    }
    if is_allowed(host.unwrap_or(""), configured) {
        return Ok(());
    }
    let words = "this device does not go by the name in the Host header; use its IP address, or add the name to the config";
    Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, words))
}

/// The text of a header; none if it is missing, repeated, or not text.
pub fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).into_iter();
    let first = values.next()?;
    let once = values.next().is_none();
    once.then(|| first.to_str().ok())?
}

/// Whether a request with this Host header is meant for this device.
fn is_allowed(header: &str, configured: &[String]) -> bool {
    let name = if let Some(rest) = header.strip_prefix('[') {
        let Some((address, port)) = rest.split_once(']') else {
            return false;
        };
        return address.parse::<Ipv6Addr>().is_ok()
            && (port.is_empty() || is_port(port.strip_prefix(':')));
    } else if let Some((name, port)) = header.split_once(':') {
        if !is_port(Some(port)) {
            return false;
        }
        name
    } else {
        header
    };
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok()
        || configured
            .iter()
            .any(|allowed| name.eq_ignore_ascii_case(allowed))
}

fn is_port(text: Option<&str>) -> bool {
    text.is_some_and(|text| text.parse::<u16>().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_localhost_and_configured_names_are_answered_and_nothing_else() {
        let configured = ["sensor-7.local".to_owned()];
        for fine in [
            "127.0.0.1:8080",
            "10.0.0.5",
            "[::1]:8080",
            "[fe80::1]",
            "localhost",
            "LocalHost:80",
            "Sensor-7.local:8080",
        ] {
            assert!(is_allowed(fine, &configured), "{fine}");
        }
        for other in [
            "",
            "evil.example",
            "evil.example:8080",
            "127.0.0.1.evil.example",
            "localhost:x",
            "[::1",
            "[evil]",
            "[::1]x",
        ] {
            assert!(!is_allowed(other, &configured), "{other}");
        }
    }
}
