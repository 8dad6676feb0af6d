//! The text that names a port.

mod suggestion;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use suggestion::suggest;

/// Baud rate of a serial endpoint that names none: the default of the first telemetry port of ArduPilot
/// (`SERIAL1_BAUD` 57) and PX4 (`SER_TEL1_BAUD` 57600).
pub const DEFAULT_BAUD: u32 = 57_600;

/// A host, by name or address, and a port number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SocketName {
    /// Name or address. IPv6 addresses stand in brackets and may carry a scope: `[fe80::1%eth0]`.
    pub host: String,
    /// Port number; 0 lets the system choose, for listening ports only.
    pub port: u16,
}

/// Where bytes come from and go to.
///
/// | text | meaning |
/// |---|---|
/// | `udpin:HOST:PORT` | listen for datagrams and answer their senders |
/// | `udpout:HOST:PORT` | send first, to one peer |
/// | `udpbcast:HOST:PORT` | send to a broadcast address, receive from any peer |
/// | `tcpin:HOST:PORT` | listen; one connection at a time |
/// | `tcpout:HOST:PORT` | connect, and connect again when the peer closes |
/// | `serial:PATH[:BAUD]` | a serial device, 8 data bits, no parity, 1 stop bit, no flow control |
///
/// Spellings of other programs are accepted as well: `udp:` is `udpin:`, `tcp:` is `tcpout:`, `//` may follow the
/// first colon, a comma may stand before the baud rate, a listening port may leave out the host
/// (`udp://:14550`), and a path that begins with `/` is a serial device. [`Endpoint`]'s `Display` prints the forms
/// of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// Listen for datagrams.
    UdpIn(SocketName),
    /// Send datagrams to one peer.
    UdpOut(SocketName),
    /// Send datagrams to a broadcast address.
    UdpBroadcast(SocketName),
    /// Listen for one connection.
    TcpIn(SocketName),
    /// Connect.
    TcpOut(SocketName),
    /// A serial device.
    Serial {
        /// The device file.
        path: PathBuf,
        /// Bits per second.
        baud: u32,
    },
}

/// A text that names no port: the fault, and the endpoint that was probably meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EndpointError {
    /// The text.
    pub text: String,
    /// What is wrong with it.
    pub fault: EndpointFault,
    /// The nearest right text, if there is one.
    pub suggestion: Option<String>,
}

impl fmt::Display for EndpointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "'{}' is not an endpoint: {}", self.text, self.fault)?;
        match &self.suggestion {
            Some(suggestion) => write!(f, ": did you mean {suggestion}?"),
            None => write!(f, ", as in {}", self.fault.example()),
        }
    }
}

impl std::error::Error for EndpointError {}

/// What is wrong with the text of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EndpointFault {
    /// The kind before the first colon is unknown.
    #[error("it must begin with udpin:, udpout:, udpbcast:, tcpin:, tcpout: or serial:")]
    Kind,
    /// No host.
    #[error("the host is missing, write HOST:PORT")]
    Host,
    /// The number after the last colon is missing or impossible.
    #[error("the port must be a number from 1 to 65535, write HOST:PORT")]
    Port,
    /// Without brackets the end of an IPv6 address cannot be distinguished from a port number.
    #[error("an IPv6 address stands in brackets")]
    Brackets,
    /// No device file.
    #[error("the device is missing")]
    Path,
    /// The baud rate is not a number above zero.
    #[error("the baud rate must be a whole number above 0")]
    Baud,
}

impl EndpointFault {
    const fn example(self) -> &'static str {
        match self {
            EndpointFault::Kind => "udpin:0.0.0.0:14550 or serial:/dev/ttyAMA0:921600",
            EndpointFault::Host => "udpout:192.168.1.10:14550",
            EndpointFault::Port => "tcpout:127.0.0.1:5760",
            EndpointFault::Brackets => "udpin:[::1]:14550",
            EndpointFault::Path | EndpointFault::Baud => "serial:/dev/ttyAMA0:921600",
        }
    }
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Endpoint, EndpointError> {
        let text = text.trim();
        parse(text).map_err(|fault| {
            // A suggestion that does not parse would be no help.
            let suggestion = suggest(text, fault).filter(|suggestion| parse(suggestion).is_ok());
            EndpointError { text: text.to_owned(), fault, suggestion }
        })
    }
}

fn parse(text: &str) -> Result<Endpoint, EndpointFault> {
    if text.starts_with('/') {
        return serial(text);
    }
    let (kind, rest) = text.split_once(':').ok_or(EndpointFault::Kind)?;
    // As in a URL: udpin://0.0.0.0:14540, serial:///dev/ttyACM0:57600.
    let rest = rest.strip_prefix("//").unwrap_or(rest);
    match kind {
        "udpin" | "udp" => listening(rest).map(Endpoint::UdpIn),
        "udpout" => remote(rest).map(Endpoint::UdpOut),
        "udpbcast" => remote(rest).map(Endpoint::UdpBroadcast),
        "tcpin" => listening(rest).map(Endpoint::TcpIn),
        "tcpout" | "tcp" => remote(rest).map(Endpoint::TcpOut),
        "serial" => serial(rest),
        _ => Err(EndpointFault::Kind),
    }
}

/// Where to listen: no host means all addresses of this machine, and port 0 lets the system choose.
fn listening(text: &str) -> Result<SocketName, EndpointFault> {
    let mut name = socket_name(text)?;
    if name.host.is_empty() {
        "0.0.0.0".clone_into(&mut name.host);
    }
    Ok(name)
}

fn remote(text: &str) -> Result<SocketName, EndpointFault> {
    let name = socket_name(text)?;
    match name {
        SocketName { port: 0, .. } => Err(EndpointFault::Port),
        SocketName { host, .. } if host.is_empty() => Err(EndpointFault::Host),
        name => Ok(name),
    }
}

fn socket_name(text: &str) -> Result<SocketName, EndpointFault> {
    // "udpin://0.0.0.0:14540/" is a common form of the URL.
    let text = text.strip_suffix('/').unwrap_or(text);
    let (host, port) = text.rsplit_once(':').ok_or(EndpointFault::Port)?;
    let port: u16 = port.parse().map_err(|_| EndpointFault::Port)?;
    let bracketed = host.starts_with('[') && host.ends_with(']');
    if host == "[]" {
        return Err(EndpointFault::Host);
    }
    if host.contains(':') && !bracketed {
        return Err(EndpointFault::Brackets);
    }
    Ok(SocketName { host: host.to_owned(), port })
}

/// Device names may contain colons (`/dev/serial/by-path/...:1.0-port0`), so only a last part of letters and
/// digits counts as a baud rate. A comma always separates the baud rate.
fn serial(text: &str) -> Result<Endpoint, EndpointFault> {
    let last = text.rsplit_once(',').or_else(|| {
        let split = text.rsplit_once(':');
        split.filter(|(_, last)| last.chars().all(|c| c.is_ascii_alphanumeric()))
    });
    let (path, baud) = match last {
        Some((path, last)) => (path, last.parse().ok().filter(|&baud| baud > 0).ok_or(EndpointFault::Baud)?),
        None => (text, DEFAULT_BAUD),
    };
    if path.is_empty() {
        return Err(EndpointFault::Path);
    }
    Ok(Endpoint::Serial { path: PathBuf::from(path), baud })
}

impl fmt::Display for SocketName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

/// The text that parses to the same endpoint.
impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Endpoint::UdpIn(name) => write!(f, "udpin:{name}"),
            Endpoint::UdpOut(name) => write!(f, "udpout:{name}"),
            Endpoint::UdpBroadcast(name) => write!(f, "udpbcast:{name}"),
            Endpoint::TcpIn(name) => write!(f, "tcpin:{name}"),
            Endpoint::TcpOut(name) => write!(f, "tcpout:{name}"),
            Endpoint::Serial { path, baud } => write!(f, "serial:{}:{baud}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests;
