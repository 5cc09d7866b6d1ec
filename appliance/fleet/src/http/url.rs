//! Addresses of heads and stores.

use std::fmt;
use std::str::FromStr;

/// Where a server answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Url {
    /// Whether the connection is encrypted.
    pub tls: bool,
    /// Name or address, without brackets.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// What every path begins with; no slash at its end.
    pub path: String,
}

impl FromStr for Url {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "write it as http://HOST:PORT/PATH".to_owned();
        let (scheme, rest) = text.split_once("://").ok_or_else(wrong)?;
        let tls = match scheme {
            "http" => false,
            "https" => true,
            _ => return Err(wrong()),
        };
        let allowed = |c: char| c.is_ascii_graphic() && !"?#\"<>\\^`{|}@".contains(c);
        if !rest.chars().all(allowed) {
            return Err(wrong());
        }
        let (authority, path) = rest.split_once('/').unwrap_or((rest, ""));
        let (host, port) = match authority.rsplit_once(':') {
            // The colons of an IPv6 address are within its brackets.
            Some((host, port)) if !port.ends_with(']') => {
                (host, port.parse().map_err(|_| wrong())?)
            }
            _ => (authority, if tls { 443 } else { 80 }),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        if host.is_empty() {
            return Err(wrong());
        }
        let path = path.trim_end_matches('/');
        Ok(Self {
            tls,
            host: host.to_owned(),
            port,
            path: match path.is_empty() {
                true => String::new(),
                false => format!("/{path}"),
            },
        })
    }
}

impl Url {
    /// The header `Host`.
    pub fn authority(&self) -> String {
        match self.host.contains(':') {
            true => format!("[{}]:{}", self.host, self.port),
            false => format!("{}:{}", self.host, self.port),
        }
    }
}

impl fmt::Display for Url {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scheme = if self.tls { "https" } else { "http" };
        write!(f, "{scheme}://{}{}", self.authority(), self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_and_written() {
        for (text, written) in [
            ("http://a", "http://a:80"),
            ("https://a/", "https://a:443"),
            (
                "http://10.0.0.1:8080/h/0001/",
                "http://10.0.0.1:8080/h/0001",
            ),
            ("http://[::1]:8080", "http://[::1]:8080"),
            ("http://[fe80::1]", "http://[fe80::1]:80"),
        ] {
            assert_eq!(text.parse::<Url>().unwrap().to_string(), written);
        }
        for wrong in [
            "a",
            "ftp://a",
            "http://",
            "http://a:99999",
            "http://a b",
            "http://a\r\nb",
        ] {
            assert!(wrong.parse::<Url>().is_err(), "{wrong:?}");
        }
    }
}
