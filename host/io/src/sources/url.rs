//! Addresses of sources, taken apart.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use super::SourceError;

/// Tells the prefix of an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// `ati+udp://HOST[:PORT]`
    Ati,
    /// `rtde://HOST[:PORT]`
    Rtde,
    /// `ws://HOST[:PORT]`
    WebSocket,
    /// `xsens://DEVICE`
    Xsens,
    /// `serial:DEVICE`
    SerialLines,
    /// `udp://HOST:PORT`
    UdpLines,
    /// `-`
    StandardInput,
}

/// The schemes as they are written, with what each takes behind `?`.
const SCHEMES: [(&str, Scheme, &[&str]); 6] = [
    ("ati+udp://", Scheme::Ati, &["cpf", "cpt", "rate_hz", "http_port", "tcp_port"]),
    ("rtde://", Scheme::Rtde, &["rate_hz", "wrench", "pose", "accel"]),
    ("ws://", Scheme::WebSocket, &["topic", "stamp", "clock"]),
    ("xsens://", Scheme::Xsens, &["baud"]),
    ("serial:", Scheme::SerialLines, &["baud", "columns"]),
    ("udp://", Scheme::UdpLines, &["columns", "from"]),
];

/// Holds the address of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceUrl {
    text: String,
    /// The protocol.
    pub scheme: Scheme,
    /// Host and port, device, or nothing.
    pub place: String,
    settings: BTreeMap<String, String>,
}

impl fmt::Display for SourceUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for SourceUrl {
    type Err = SourceError;

    fn from_str(text: &str) -> Result<Self, SourceError> {
        let wrong = |reason: String| SourceError::Url { url: text.to_owned(), reason };
        let (address, settings) = text.split_once('?').unwrap_or((text, ""));
        let (scheme, place, known) = if address == "-" {
            (Scheme::StandardInput, "", &["columns"][..])
        } else {
            SCHEMES
                .iter()
                .find_map(|(prefix, scheme, known)| Some((*scheme, address.strip_prefix(prefix)?, *known)))
                .ok_or_else(|| {
                    let known: Vec<&str> = SCHEMES.iter().map(|(prefix, ..)| *prefix).collect();
                    wrong(format!(
                        "it begins with none of {}, and is not - for standard input",
                        known.join(", ")
                    ))
                })?
        };
        if place.is_empty() && scheme != Scheme::StandardInput {
            return Err(wrong("host or device is missing".to_owned()));
        }
        let mut url =
            Self { text: text.to_owned(), scheme, place: place.to_owned(), settings: BTreeMap::new() };
        for setting in settings.split('&').filter(|s| !s.is_empty()) {
            let (key, value) = setting
                .split_once('=')
                .ok_or_else(|| wrong(format!("{setting:?} is no setting: write key=value")))?;
            if !known.contains(&key) {
                return Err(wrong(format!("there is no setting {key}; there {}", listed(known))));
            }
            if url.settings.insert(key.to_owned(), value.to_owned()).is_some() {
                return Err(wrong(format!("{key} is there twice")));
            }
        }
        Ok(url)
    }
}

fn listed(known: &[&str]) -> String {
    match known {
        [one] => format!("is {one}"),
        several => format!("are {}", several.join(", ")),
    }
}

impl SourceUrl {
    /// Returns a setting as it is written.
    pub fn setting(&self, key: &str) -> Option<&str> {
        self.settings.get(key).map(String::as_str)
    }

    /// Returns a setting that is a number greater than zero.
    ///
    /// # Errors
    /// It is there and is none.
    pub fn number(&self, key: &str) -> Result<Option<f64>, SourceError> {
        let Some(text) = self.setting(key) else { return Ok(None) };
        let number = text.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
        number.map(Some).ok_or_else(|| self.wrong(format!("{key}={text}: a number greater than zero")))
    }

    /// Returns a setting that is a port or a rate of a line, up to `most`.
    ///
    /// # Errors
    /// It is there and is none.
    pub fn integer(&self, key: &str, most: u32) -> Result<Option<u32>, SourceError> {
        let Some(text) = self.setting(key) else { return Ok(None) };
        let number = text.parse::<u32>().ok().filter(|v| (1..=most).contains(v));
        number.map(Some).ok_or_else(|| self.wrong(format!("{key}={text}: a whole number from 1 to {most}")))
    }

    /// Returns host and port, the port being `default` if none is written.
    ///
    /// # Errors
    /// The port is no number.
    pub fn host_and_port(&self, default: u16) -> Result<(String, u16), SourceError> {
        let (host, port) = match self.place.rsplit_once(':') {
            // An address of version 6 has colons of its own.
            Some((host, port)) if !host.contains(':') || host.ends_with(']') => (host, Some(port)),
            _ => (self.place.as_str(), None),
        };
        let port = match port {
            None => default,
            Some(port) => port.parse().map_err(|_| self.wrong(format!("{port:?} is no port")))?,
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        if host.is_empty() || host.contains('/') {
            return Err(self.wrong("a host and a port, HOST:PORT, and nothing else before ?".to_owned()));
        }
        Ok((host.to_owned(), port))
    }

    /// Returns true if both are the same line or the same network port.
    pub fn same_place(&self, other: &Self) -> bool {
        self.scheme == other.scheme && self.place == other.place
    }

    /// Returns the error of an address that is not as it is to be.
    pub fn wrong(&self, reason: impl Into<String>) -> SourceError {
        SourceError::Url { url: self.text.clone(), reason: reason.into() }
    }

    /// Returns the error of a place where nobody is.
    pub fn unreachable(&self, reason: impl Into<String>) -> SourceError {
        SourceError::Unreachable { url: self.text.clone(), reason: reason.into() }
    }

    /// Returns the error of somebody who says something else.
    pub fn protocol(&self, reason: impl Into<String>) -> SourceError {
        SourceError::Protocol { url: self.text.clone(), reason: reason.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<SourceUrl, SourceError> {
        text.parse()
    }

    #[test]
    fn addresses_are_taken_apart() {
        let ati = parsed("ati+udp://192.168.1.1?cpf=1000000&cpt=1000000").unwrap();
        assert_eq!(ati.host_and_port(49_152).unwrap(), ("192.168.1.1".to_owned(), 49_152));
        assert_eq!(ati.number("cpf").unwrap(), Some(1e6));
        let bridge = parsed("ws://[::1]:9000?topic=/ft/wrench").unwrap();
        assert_eq!(bridge.host_and_port(8765).unwrap(), ("::1".to_owned(), 9000));
        assert_eq!(bridge.setting("topic"), Some("/ft/wrench"));
        assert_eq!(parsed("serial:/dev/ttyUSB0?baud=9600").unwrap().place, "/dev/ttyUSB0");
        assert_eq!(parsed("-").unwrap().scheme, Scheme::StandardInput);
    }

    #[test]
    fn faults_of_an_address_are_reported() {
        for (text, part) in [
            ("tcp://a", "begins with none of ati+udp://"),
            ("rtde://", "host or device is missing"),
            ("ws://a?topik=/x", "there are topic, stamp, clock"),
            ("xsens:///dev/x?baud", "write key=value"),
            ("ws://a?topic=/x&topic=/y", "topic is there twice"),
        ] {
            let said = parsed(text).unwrap_err().to_string();
            assert!(said.starts_with(text) && said.contains(part), "{said}");
        }
        let said = |text: &str, key: &str| parsed(text).unwrap().number(key).unwrap_err().to_string();
        assert!(said("ati+udp://a?cpf=0", "cpf").contains("greater than zero"));
        assert!(parsed("udp://:1").unwrap().host_and_port(1).is_err());
        assert!(parsed("udp://a:x").unwrap().host_and_port(1).is_err());
    }
}
