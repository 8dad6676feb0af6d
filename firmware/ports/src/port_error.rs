//! Ports that cannot be opened.

use crate::devices::{SerialDevice, serial_devices};
use crate::endpoint::Endpoint;
use std::borrow::Cow;
use std::fmt;
use std::io;

/// A port that could not be opened at the start: what, why, what to do.
#[derive(Debug)]
pub struct PortError {
    /// The endpoint that could not be opened.
    pub endpoint: Endpoint,
    /// What failed.
    pub action: &'static str,
    /// Why.
    pub source: io::Error,
}

impl fmt::Display for PortError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PortError { endpoint, action, source } = self;
        let advice = match endpoint {
            Endpoint::Serial { .. } => serial_advice(source, serial_devices),
            _ => Cow::Borrowed(socket_advice(source)),
        };
        write!(f, "{endpoint}: {action}: {source}: {advice}")
    }
}

impl std::error::Error for PortError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.source)
    }
}

fn serial_advice(error: &io::Error, devices: impl FnOnce() -> Vec<SerialDevice>) -> Cow<'static, str> {
    use io::ErrorKind::*;
    Cow::Borrowed(match error.kind() {
        NotFound => return Cow::Owned(missing(&devices())),
        PermissionDenied => "add this user to the group that owns the device, often dialout",
        ResourceBusy => "another program has the device open, stop it",
        InvalidInput => "the device does not support this baud rate, use another",
        _ => "check that this is a serial device",
    })
}

fn missing(devices: &[SerialDevice]) -> String {
    let names: Vec<String> = devices.iter().map(SerialDevice::to_string).collect();
    match names[..] {
        [] => "plug the device in; there are no serial devices".to_owned(),
        _ => format!("plug the device in, or correct its name; there are: {}", names.join(", ")),
    }
}

fn socket_advice(error: &io::Error) -> &'static str {
    use io::ErrorKind::*;
    match error.kind() {
        PermissionDenied => "use a port number above 1023, or udpbcast: for a broadcast address",
        AddrInUse => "stop the other program that uses this port, or choose another number",
        AddrNotAvailable => "use an address of this machine, or 0.0.0.0 for all of them",
        ConnectionRefused | TimedOut => "start the other side first, or correct host and port",
        _ => "correct host and port",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_device_lists_those_that_are_there() {
        let error = io::Error::from(io::ErrorKind::NotFound);
        let pixhawk = || SerialDevice {
            path: "/dev/ttyACM0".into(),
            by_id: None,
            usb_name: Some("Holybro Pixhawk6C".into()),
        };
        let uart = || SerialDevice { path: "/dev/ttyAMA0".into(), by_id: None, usb_name: None };
        assert_eq!(
            serial_advice(&error, || vec![pixhawk(), uart()]),
            "plug the device in, or correct its name; there are: /dev/ttyACM0 (Holybro Pixhawk6C), /dev/ttyAMA0"
        );
        assert_eq!(serial_advice(&error, Vec::new), "plug the device in; there are no serial devices");
    }
}
