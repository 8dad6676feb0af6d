//! `gleaner ports`: the serial devices of this machine.

use gleaner_ports::serial_devices;
use std::process::ExitCode;

/// Prints each serial device with its stable name and what the USB device calls itself.
pub fn ports() -> ExitCode {
    let devices = serial_devices();
    if devices.is_empty() {
        println!("no serial devices: plug the autopilot in");
        return ExitCode::from(1);
    }
    println!("{:<16} {:<32} stable name", "device", "USB name");
    for device in devices {
        let by_id = device.by_id.map_or("-".to_owned(), |path| path.display().to_string());
        let usb_name = device.usb_name.unwrap_or_else(|| "-".to_owned());
        println!("{:<16} {usb_name:<32} {by_id}", device.path.display());
    }
    ExitCode::SUCCESS
}
