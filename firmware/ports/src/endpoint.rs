//! The text that names a port.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Baud rate of a serial endpoint that names none: the default of the first telemetry port of ArduPilot
/// (`SERIAL1_BAUD` 57) and PX4 (`SER_TEL1_BAUD` 57600).
pub const DEFAULT_BAUD: u32 = 57_600;

/// A host, by name or address, and a port number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SocketName {
    /// Name or address; IPv6 addresses stand in brackets.
    pub host: String,
    /// Port number; 0 lets the system choose, where we listen.
    pub port: u16,
}

/// Where bytes come from and go to.
///
/// | text | meaning |
/// |---|---|
/// | `udpin:HOST:PORT` | listen; answer everybody who has spoken (`udp:` is the same) |
/// | `udpout:HOST:PORT` | speak first, to one peer |
/// | `tcpin:HOST:PORT` | listen; one peer at a time, a new one replaces the old |
/// | `tcpout:HOST:PORT` | connect, and connect again when the peer closes |
/// | `serial:PATH[:BAUD]` | a serial device, 8 data bits, no parity, 1 stop bit, no flow control |
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// Listen for datagrams.
    UdpIn(SocketName),
    /// Send datagrams to one peer.
    UdpOut(SocketName),
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

/// A text that names no port, and why.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not an endpoint: {fault}")]
pub struct EndpointError {
    /// The text.
    pub text: String,
    /// What is wrong with it.
    pub fault: EndpointFault,
}

/// What is wrong with an endpoint's text. Each says what to write instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EndpointFault {
    /// The kind before the first colon is none of ours.
    #[error(
        "it must begin with udpin:, udpout:, tcpin:, tcpout: or serial:, as in udpin:0.0.0.0:14550 or serial:/dev/ttyAMA0:921600"
    )]
    Kind,
    /// No host.
    #[error("the host is missing, write HOST:PORT as in udpout:192.168.1.10:14550")]
    Host,
    /// The number after the last colon is missing or impossible.
    #[error("the port must be a number from 1 to 65535, write HOST:PORT as in tcpout:127.0.0.1:5760")]
    Port,
    /// An IPv6 address without brackets cannot be told from its port.
    #[error("an IPv6 address goes into brackets, as in udpin:[::1]:14550")]
    Brackets,
    /// No device file.
    #[error("the device is missing, as in serial:/dev/ttyAMA0:921600")]
    Path,
    /// The baud rate is not a number above zero.
    #[error("the baud rate must be a whole number above 0, as in serial:/dev/ttyAMA0:921600")]
    Baud,
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Endpoint, EndpointError> {
        parse(text.trim()).map_err(|fault| EndpointError { text: text.to_owned(), fault })
    }
}

fn parse(text: &str) -> Result<Endpoint, EndpointFault> {
    let (kind, rest) = text.split_once(':').ok_or(EndpointFault::Kind)?;
    match kind {
        "udpin" | "udp" => socket_name(rest, true).map(Endpoint::UdpIn),
        "udpout" => socket_name(rest, false).map(Endpoint::UdpOut),
        "tcpin" => socket_name(rest, true).map(Endpoint::TcpIn),
        "tcpout" => socket_name(rest, false).map(Endpoint::TcpOut),
        "serial" => serial(rest),
        _ => Err(EndpointFault::Kind),
    }
}

/// Only where we listen may the system choose the port.
fn socket_name(text: &str, listens: bool) -> Result<SocketName, EndpointFault> {
    let (host, port) = text.rsplit_once(':').ok_or(EndpointFault::Port)?;
    let port: u16 = port.parse().map_err(|_| EndpointFault::Port)?;
    if port == 0 && !listens {
        return Err(EndpointFault::Port);
    }
    let bracketed = host.starts_with('[') && host.ends_with(']');
    if host.is_empty() || host == "[]" {
        return Err(EndpointFault::Host);
    }
    if host.contains(':') && !bracketed {
        return Err(EndpointFault::Brackets);
    }
    Ok(SocketName { host: host.to_owned(), port })
}

/// Device names may contain colons themselves (`/dev/serial/by-path/...:1.0-port0`), so only a last part of
/// letters and digits counts as a baud rate.
fn serial(text: &str) -> Result<Endpoint, EndpointFault> {
    let (path, baud) = match text.rsplit_once(':') {
        Some((path, last)) if last.chars().all(|c| c.is_ascii_alphanumeric()) => {
            let baud = last.parse().ok().filter(|&baud| baud > 0).ok_or(EndpointFault::Baud)?;
            (path, baud)
        }
        _ => (text, DEFAULT_BAUD),
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
            Endpoint::TcpIn(name) => write!(f, "tcpin:{name}"),
            Endpoint::TcpOut(name) => write!(f, "tcpout:{name}"),
            Endpoint::Serial { path, baud } => write!(f, "serial:{}:{baud}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_round_trip() {
        for text in [
            "udpin:0.0.0.0:0",
            "udpout:gcs.local:14550",
            "tcpin:[::]:5760",
            "tcpout:127.0.0.1:5760",
            "serial:/dev/ttyAMA0:921600",
            "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0:57600",
        ] {
            assert_eq!(text.parse::<Endpoint>().unwrap().to_string(), text);
        }
        let by_path = "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0";
        assert_eq!(by_path.parse::<Endpoint>().unwrap().to_string(), format!("{by_path}:57600"));
        assert_eq!("udp:[::1]:5".parse::<Endpoint>(), "udpin:[::1]:5".parse());
    }

    #[test]
    fn each_mistake_has_its_own_answer() {
        use EndpointFault::*;
        for (text, fault) in [
            ("", Kind),
            ("14550", Kind),
            ("tcp:127.0.0.1:5760", Kind),
            ("/dev/ttyAMA0", Kind),
            ("udpin:14550", Port),
            ("udpin:0.0.0.0", Port),
            ("udpin:0.0.0.0:http", Port),
            ("udpin:0.0.0.0:65536", Port),
            ("udpout:127.0.0.1:0", Port),
            ("tcpout:127.0.0.1:0", Port),
            ("udpin::14550", Host),
            ("udpin:[]:14550", Host),
            ("udpin:::1:14550", Brackets),
            ("serial:", Path),
            ("serial::115200", Path),
            ("serial:/dev/ttyAMA0:0", Baud),
            ("serial:/dev/ttyAMA0:115k2", Baud),
            ("serial:/dev/ttyAMA0:", Baud),
        ] {
            let error = text.parse::<Endpoint>().unwrap_err();
            assert_eq!(error.fault, fault, "{text}");
            assert!(error.to_string().starts_with(&format!("'{text}' is not an endpoint: ")));
        }
    }
}
