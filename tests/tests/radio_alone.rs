//! `gleaner-sitl radio` beside an autopilot: it follows the vehicle's position over MAVLink and reports in each format.

use gleaner_radio::{Calibration, Format, JsonLines, Report, ReportDecoder, SemtechUdp};
use gleaner_tests::programs::Running;
use std::collections::BTreeSet;
use std::net::UdpSocket;
use std::time::Duration;

/// Reports of every device are sent at 5 Hz; this many datagrams hold all six.
const DATAGRAMS: usize = 40;

/// The devices that a radio with this format reports to a socket of ours.
fn reported(vehicle: &str, mission: &str, name: &str, mut format: Box<dyn Format>) -> BTreeSet<u32> {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let to = format!("udpout:{}", socket.local_addr().unwrap());
    let words = ["radio", "--mission", mission, "--vehicle", vehicle, "--reports", &to, "--format", name];
    let _radio = Running::start("gleaner-sitl", &words);
    let mut devices = BTreeSet::new();
    let mut buffer = [0; 2048];
    for _ in 0..DATAGRAMS {
        let length = socket.recv(&mut buffer).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut take = |report: Report| {
            assert!(report.snr.0.is_finite(), "{name}: {report:?}");
            devices.insert(report.device);
        };
        format.receive(&buffer[..length], &mut take, &mut |_| {});
    }
    devices
}

#[test]
fn the_radio_alone_follows_a_vehicle_and_reports_in_each_format() {
    let folder = tempfile::tempdir().unwrap();
    let mission = folder.path().join("mission.toml");
    let mission = mission.to_str().unwrap();
    let out = folder.path().join("flight");
    let mut words = vec!["serve", "--seed", "3", "--companion", "tcpin:127.0.0.1:0"];
    words.extend(["--radio", "tcpin:127.0.0.1:0", "--gcs", "udpin:127.0.0.1:0"]);
    words.extend(["--mission-out", mission, "--out", out.to_str().unwrap()]);
    let mut city = Running::start("gleaner-sitl", &words);
    let vehicle = city.line("gcs").replace("udpin:", "udpout:");
    city.line("mission");
    let all: BTreeSet<u32> = (1..=6).collect();
    let formats: [(&str, Box<dyn Format>); 3] = [
        ("cobs", Box::new(ReportDecoder::new())),
        ("json_lines", Box::new(JsonLines::new(Calibration::default()))),
        ("semtech_udp", Box::new(SemtechUdp::new(Calibration::LORA))),
    ];
    for (name, format) in formats {
        assert_eq!(reported(&vehicle, mission, name, format), all, "{name}");
    }
}
