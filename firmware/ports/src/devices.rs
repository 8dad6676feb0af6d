//! The serial devices of this machine.

use serialport::SerialPortType;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// UARTs that belong to the processor itself. They have no USB name, and their bus is not one of those that
/// `serialport` lists.
const ONBOARD: [&str; 5] = ["ttyAMA", "ttyTHS", "ttymxc", "ttyPS", "ttySC"];

/// A serial device that is present.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SerialDevice {
    /// The device file.
    pub path: PathBuf,
    /// The name under `/dev/serial/by-id`, which does not change when devices are plugged in another order.
    pub by_id: Option<PathBuf>,
    /// Manufacturer and product, as the USB device states them.
    pub usb_name: Option<String>,
}

impl fmt::Display for SerialDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.by_id.as_ref().unwrap_or(&self.path).display())?;
        match &self.usb_name {
            Some(name) => write!(f, " ({name})"),
            None => Ok(()),
        }
    }
}

/// The serial devices of this machine, by path. Empty where they cannot be listed.
#[must_use]
pub fn serial_devices() -> Vec<SerialDevice> {
    // `serialport` panics when this folder is missing, as it is in some containers.
    let class = Path::new("/sys/class/tty");
    let listed = if class.is_dir() { serialport::available_ports().unwrap_or_default() } else { Vec::new() };
    let by_id = links(Path::new("/dev/serial/by-id"));
    let mut devices: Vec<SerialDevice> = listed
        .into_iter()
        .map(|port| device(PathBuf::from(port.port_name), usb_name(&port.port_type), &by_id))
        .collect();
    for path in onboard(class) {
        if devices.iter().all(|device| device.path != path) {
            devices.push(device(path, None, &by_id));
        }
    }
    devices.sort_by(|a, b| a.path.cmp(&b.path));
    devices
}

fn device(path: PathBuf, usb_name: Option<String>, by_id: &[(PathBuf, PathBuf)]) -> SerialDevice {
    let link = by_id.iter().find(|(_, target)| *target == path).map(|(link, _)| link.clone());
    SerialDevice { path, by_id: link, usb_name }
}

fn usb_name(kind: &SerialPortType) -> Option<String> {
    let SerialPortType::UsbPort(usb) = kind else { return None };
    let words = [usb.manufacturer.as_deref(), usb.product.as_deref()];
    let words: Vec<&str> =
        words.into_iter().flatten().map(str::trim).filter(|word| !word.is_empty()).collect();
    Some(match words[..] {
        [] => format!("USB {:04x}:{:04x}", usb.vid, usb.pid),
        // Many products repeat the manufacturer.
        [manufacturer, product] if product.starts_with(manufacturer) => product.to_owned(),
        _ => words.join(" "),
    })
}

/// Each link in `folder` with the device file that it points to.
fn links(folder: &Path) -> Vec<(PathBuf, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some((entry.path(), entry.path().canonicalize().ok()?))).collect()
}

/// The processor's own UARTs that have hardware behind them.
fn onboard(class: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(class).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        (ONBOARD.iter().any(|start| name.starts_with(start)) && entry.path().join("device").exists())
            .then_some(name)
    });
    names.map(|name| Path::new("/dev").join(name)).filter(|path| path.exists()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::UsbPortInfo;

    fn usb(manufacturer: Option<&str>, product: Option<&str>) -> SerialPortType {
        SerialPortType::UsbPort(UsbPortInfo {
            vid: 0x3162,
            pid: 0x0053,
            serial_number: None,
            manufacturer: manufacturer.map(str::to_owned),
            product: product.map(str::to_owned),
        })
    }

    #[test]
    fn usb_devices_have_a_readable_name() {
        for (manufacturer, product, name) in [
            (Some("Holybro"), Some("Pixhawk6C"), "Holybro Pixhawk6C"),
            (Some("Silicon Labs"), Some("Silicon Labs CP2102N"), "Silicon Labs CP2102N"),
            (None, Some(" FT232R "), "FT232R"),
            (None, None, "USB 3162:0053"),
        ] {
            assert_eq!(usb_name(&usb(manufacturer, product)).as_deref(), Some(name));
        }
        assert_eq!(usb_name(&SerialPortType::Unknown), None);
    }

    #[test]
    fn the_stable_name_is_preferred() {
        let by_id = [(PathBuf::from("/dev/serial/by-id/usb-Holybro"), PathBuf::from("/dev/ttyACM0"))];
        let named = device("/dev/ttyACM0".into(), Some("Holybro Pixhawk6C".into()), &by_id);
        assert_eq!(named.to_string(), "/dev/serial/by-id/usb-Holybro (Holybro Pixhawk6C)");
        assert_eq!(device("/dev/ttyAMA0".into(), None, &by_id).to_string(), "/dev/ttyAMA0");
    }
}
