//! The radio's port and the format of its reports.

use crate::config::RadioFormat;
use gleaner_ports::{Endpoint, Peers, Port, PortError, State};
use gleaner_radio::{Format, JsonLines, Report, ReportDecoder, ReportStats, SemtechUdp};
use std::time::Instant;

/// An open radio port with the decoder of its format.
pub struct Radio {
    port: Port,
    format: Box<dyn Format + Send>,
    /// The counters when faults were described last.
    described: ReportStats,
}

impl Radio {
    /// Opens the port. Datagrams of every sender are read: several gateways may report.
    ///
    /// # Errors
    /// The port cannot be opened.
    pub fn open(endpoint: &Endpoint, format: RadioFormat) -> Result<Radio, PortError> {
        let format: Box<dyn Format + Send> = match format {
            RadioFormat::Cobs => Box::new(ReportDecoder::new()),
            RadioFormat::JsonLines(calibration) => Box::new(JsonLines::new(calibration)),
            RadioFormat::SemtechUdp(calibration) => Box::new(SemtechUdp::new(calibration)),
        };
        Ok(Radio { port: Port::open_for(endpoint, Peers::All)?, format, described: ReportStats::NONE })
    }

    /// The port, for waiting and for messages.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Opens a closed port again; reports a change of its state.
    pub fn maintain(&mut self, now: Instant) -> Option<State> {
        self.port.maintain(now)
    }

    /// Reads once into `buffer`, hands out the reports, and answers their sender. Returns the bytes of this read.
    pub fn receive<'b>(&mut self, buffer: &'b mut [u8], mut report: impl FnMut(Report)) -> &'b [u8] {
        let Radio { port, format, .. } = self;
        let length = port.receive(buffer);
        let bytes = buffer.get(..length).unwrap_or(&[]);
        // An empty read is no datagram.
        if !bytes.is_empty() {
            format.receive(bytes, &mut report, &mut |reply| port.reply(reply));
        }
        bytes
    }

    /// The counters of the format.
    pub fn stats(&self) -> ReportStats {
        self.format.stats()
    }

    /// What was refused since the last call, if anything was.
    pub fn new_faults(&mut self) -> Option<String> {
        let stats = self.stats();
        let before = std::mem::replace(&mut self.described, stats);
        let since = ReportStats {
            framing: stats.framing - before.framing,
            checksum: stats.checksum - before.checksum,
            malformed: stats.malformed - before.malformed,
            ..ReportStats::NONE
        };
        faults(&since)
    }
}

/// Bytes, reports, and what was refused.
pub fn describe(stats: &ReportStats) -> String {
    let ReportStats { bytes, reports, duplicates, .. } = stats;
    let mut line = format!("{bytes} bytes, {reports} reports");
    if *duplicates > 0 {
        line += &format!(", {duplicates} copies");
    }
    if let Some(faults) = faults(stats) {
        line += &format!(", {faults}");
    }
    line
}

fn faults(stats: &ReportStats) -> Option<String> {
    let faults: Vec<String> = [
        (stats.framing, "not of this format"),
        (stats.checksum, "with a wrong checksum"),
        (stats.malformed, "without a usable report"),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} {what}"))
    .collect();
    (!faults.is_empty()).then(|| faults.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_ports::wait;
    use gleaner_radio::Calibration;
    use std::net::UdpSocket;
    use std::time::Duration;

    const DEADLINE: Duration = Duration::from_secs(20);

    /// The radio, and a socket that sends to it.
    fn open(format: RadioFormat) -> (Radio, UdpSocket) {
        let radio = Radio::open(&"udpin:127.0.0.1:0".parse().unwrap(), format).unwrap();
        let gateway = UdpSocket::bind("127.0.0.1:0").unwrap();
        gateway.connect(radio.port().local_address().unwrap()).unwrap();
        gateway.set_read_timeout(Some(DEADLINE)).unwrap();
        (radio, gateway)
    }

    fn receive(radio: &mut Radio) -> Vec<Report> {
        assert!(wait(&[radio.port()], DEADLINE).unwrap(), "nothing arrived");
        let mut reports = Vec::new();
        radio.receive(&mut [0; 1024], |report| reports.push(report));
        reports
    }

    #[test]
    fn a_gateway_is_answered_and_faults_are_described_once() {
        let (mut radio, gateway) = open(RadioFormat::SemtechUdp(Calibration::LORA));
        gateway.send(&[2, 7, 8, 2, 0, 0, 0, 0, 0, 0, 0, 1]).unwrap();
        assert!(receive(&mut radio).is_empty());
        let mut answer = [0; 16];
        assert_eq!(gateway.recv(&mut answer).unwrap(), 4);
        assert_eq!(answer[..4], [2, 7, 8, 4], "PULL_ACK");
        gateway.send(b"+RCV=1,5,HELLO").unwrap();
        receive(&mut radio);
        assert_eq!(radio.new_faults().as_deref(), Some("1 not of this format"));
        assert_eq!(radio.new_faults(), None);
        assert!(radio.receive(&mut [0; 64], |_| {}).is_empty(), "nothing is left");
        assert_eq!(describe(&radio.stats()), "26 bytes, 0 reports, 1 not of this format");
    }

    #[test]
    fn json_lines_are_calibrated() {
        let calibration = Calibration { offset: gleaner_units::Db(3.0), slope: 2.0 };
        let (mut radio, gateway) = open(RadioFormat::JsonLines(calibration));
        gateway.send(b"{\"id\":4000000000,\"snr_db\":2.5}\n{\"id\":1}\n").unwrap();
        let reports = receive(&mut radio);
        assert_eq!(reports.len(), 1);
        assert_eq!((reports[0].device, reports[0].snr), (4_000_000_000, gleaner_units::Db(8.0)));
        assert_eq!(radio.new_faults().as_deref(), Some("1 without a usable report"));
    }
}
