//! LoRaWAN gateways: the Semtech UDP packet forwarder protocol, versions 1 and 2 (`PROTOCOL.TXT` of the packet
//! forwarder). One datagram is one message; this end is the server.
//!
//! | bytes | PUSH_DATA |
//! |---|---|
//! | 0 | version |
//! | 1..2 | token, returned in the answer |
//! | 3 | 0: PUSH_DATA (2: PULL_DATA, 5: TX_ACK) |
//! | 4..11 | EUI of the gateway |
//! | 12.. | JSON; uplinks stand in `rxpk` |
//!
//! A device is named by its DevAddr (bytes 1..4 of a data frame, little endian), or in a join request by the low half of
//! its DevEUI. Payloads are encrypted, so a report has no `remaining`. The SNR is the link margin, the SNR above the
//! limit of the spreading factor, after calibration.
//!
//! The messages are read here and not with a gateway crate: a server needs four header bytes and six keys, and gateways
//! differ in the others.

use super::{Calibration, Format, ReportStats, required_snr};
use crate::Report;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use gleaner_units::Db;
use serde::Deserialize;
use std::string::String;
use std::vec::Vec;

const PUSH_DATA: u8 = 0;
const PUSH_ACK: u8 = 1;
const PULL_DATA: u8 = 2;
const PULL_ACK: u8 = 4;
const TX_ACK: u8 = 5;

#[derive(Deserialize)]
struct Push {
    #[serde(default)]
    rxpk: Vec<Uplink>,
}

#[derive(Deserialize)]
struct Uplink {
    /// CRC: 1 correct, -1 wrong, 0 none.
    #[serde(default)]
    stat: i8,
    /// `SF7BW125` for LoRa, a number for FSK.
    datr: serde_json::Value,
    lsnr: Option<f32>,
    #[serde(default)]
    rsig: Vec<Antenna>,
    data: String,
}

#[derive(Deserialize)]
struct Antenna {
    lsnr: Option<f32>,
}

impl Uplink {
    /// The best SNR of all antennas, above the limit of the spreading factor.
    fn margin(&self) -> Option<Db> {
        let antennas = self.rsig.iter().map(|antenna| antenna.lsnr);
        let snr_db = antennas.chain([self.lsnr]).flatten().reduce(f32::max)?;
        let factor = self.datr.as_str()?.strip_prefix("SF")?.split("BW").next()?.parse().ok()?;
        Some(Db(snr_db - required_snr(factor)?.0))
    }

    fn frame(&self) -> Option<Vec<u8>> {
        STANDARD_NO_PAD.decode(self.data.trim_end_matches('=')).ok()
    }
}

/// LoRaWAN 1.0.4, section 4: the message type is in the upper three bits of the first byte.
fn device(frame: &[u8]) -> Option<u32> {
    const JOIN_REQUEST: u8 = 0b000;
    const UNCONFIRMED_UP: u8 = 0b010;
    const CONFIRMED_UP: u8 = 0b100;
    let at = match frame.first()? >> 5 {
        UNCONFIRMED_UP | CONFIRMED_UP => 1,
        // Type (1), JoinEUI (8), DevEUI (8, little endian).
        JOIN_REQUEST => 9,
        _ => return None,
    };
    frame.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

/// The server's side of the protocol.
#[derive(Clone, Debug)]
pub struct SemtechUdp {
    calibration: Calibration,
    /// Frames read last, to recognise copies from other antennas and gateways.
    recent: Vec<Vec<u8>>,
    stats: ReportStats,
}

impl Default for SemtechUdp {
    fn default() -> SemtechUdp {
        SemtechUdp::new(Calibration::LORA)
    }
}

impl SemtechUdp {
    const REMEMBERED: usize = 64;

    /// A server whose reports are calibrated; [`Calibration::LORA`] unless the radio was measured.
    #[must_use]
    pub const fn new(calibration: Calibration) -> SemtechUdp {
        const STATS: ReportStats = ReportStats::NONE;
        SemtechUdp { calibration, recent: Vec::new(), stats: STATS }
    }

    fn push(&mut self, json: &[u8], report: &mut dyn FnMut(Report)) {
        let Ok(push) = serde_json::from_slice::<Push>(json) else {
            count(&mut self.stats.malformed);
            return;
        };
        let mut uplinks: Vec<(Db, Uplink)> = Vec::new();
        for uplink in push.rxpk {
            match uplink.margin() {
                _ if uplink.stat != 1 => count(&mut self.stats.checksum),
                Some(margin) => uplinks.push((margin, uplink)),
                None => count(&mut self.stats.malformed),
            }
        }
        // The best copy of a frame first: the others are dropped.
        uplinks.sort_by(|(a, _), (b, _)| b.0.total_cmp(&a.0));
        for (margin, uplink) in uplinks {
            self.uplink(margin, &uplink, report);
        }
    }

    fn uplink(&mut self, margin: Db, uplink: &Uplink, report: &mut dyn FnMut(Report)) {
        let named = uplink.frame().and_then(|frame| Some((device(&frame)?, frame)));
        let Some((device, frame)) = named else {
            count(&mut self.stats.malformed);
            return;
        };
        if self.recent.contains(&frame) {
            count(&mut self.stats.duplicates);
            return;
        }
        if self.recent.len() == SemtechUdp::REMEMBERED {
            self.recent.remove(0);
        }
        self.recent.push(frame);
        count(&mut self.stats.reports);
        report(Report { device, snr: self.calibration.apply(margin), remaining: None, age_ms: 0 });
    }
}

impl Format for SemtechUdp {
    fn receive(&mut self, bytes: &[u8], report: &mut dyn FnMut(Report), reply: &mut dyn FnMut(&[u8])) {
        self.stats.count_bytes(bytes);
        match *bytes {
            [version @ 1..=2, token0, token1, PUSH_DATA, _, _, _, _, _, _, _, _, ref json @ ..] => {
                reply(&[version, token0, token1, PUSH_ACK]);
                self.push(json, report);
            }
            [version @ 1..=2, token0, token1, PULL_DATA, _, _, _, _, _, _, _, _] => {
                reply(&[version, token0, token1, PULL_ACK]);
            }
            [1..=2, _, _, TX_ACK, ..] => {}
            _ => count(&mut self.stats.framing),
        }
    }

    fn stats(&self) -> ReportStats {
        self.stats
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A data frame of device 26011BDA with this frame counter.
    fn data(counter: u8) -> String {
        STANDARD_NO_PAD.encode([0x40, 0xDA, 0x1B, 0x01, 0x26, 0x80, counter, 0, 1, 0xAA, 1, 2, 3, 4])
    }

    fn push_data(rxpk: &str) -> Vec<u8> {
        let mut bytes = std::vec![2, 0x12, 0x34, PUSH_DATA, 0xAA, 0x55, 0x5A, 0, 0, 0, 1, 1];
        bytes.extend_from_slice(std::format!("{{\"rxpk\":[{rxpk}]}}").as_bytes());
        bytes
    }

    fn uplink(data: &str, factor: u8, lsnr: f32, stat: i8) -> String {
        std::format!(
            r#"{{"tmst":3512348611,"chan":2,"rfch":0,"freq":866.349812,"stat":{stat},"modu":"LORA","datr":"SF{factor}BW125","codr":"4/6","rssi":-35,"lsnr":{lsnr},"size":14,"data":"{data}"}}"#
        )
    }

    fn read(format: &mut SemtechUdp, bytes: &[u8]) -> (Vec<Report>, Vec<Vec<u8>>) {
        let (mut reports, mut replies) = (Vec::new(), Vec::new());
        format.receive(bytes, &mut |report| reports.push(report), &mut |bytes| replies.push(bytes.to_vec()));
        (reports, replies)
    }

    #[test]
    fn an_uplink_becomes_a_report_and_is_acknowledged() {
        let mut format = SemtechUdp::default();
        let (reports, replies) = read(&mut format, &push_data(&uplink(&data(1), 7, 5.1, 1)));
        // 5.1 dB at SF7 is 12.6 dB above the limit; the limit is 5 dB on the policy's scale.
        let report = Report { device: 0x2601_1BDA, snr: Db(17.6), remaining: None, age_ms: 0 };
        assert_eq!(reports, [report]);
        assert_eq!(replies, [[2, 0x12, 0x34, PUSH_ACK]]);
        let (_, replies) = read(&mut format, &[2, 7, 8, PULL_DATA, 0, 0, 0, 0, 0, 0, 0, 1]);
        assert_eq!(replies, [[2, 7, 8, PULL_ACK]]);
    }

    #[test]
    fn the_best_antenna_counts_and_copies_are_dropped() {
        let mut format = SemtechUdp::default();
        let antennas = uplink(&data(1), 12, -19.0, 1)
            .replace("\"rssi\"", r#""rsig":[{"ant":0,"lsnr":-18.0},{"ant":1,"lsnr":-12.0}],"rssi""#);
        let copy = uplink(&data(1), 12, -17.0, 1);
        let (reports, _) = read(&mut format, &push_data(&std::format!("{copy},{antennas}")));
        assert_eq!(reports.iter().map(|report| report.snr).collect::<Vec<_>>(), [Db(13.0)]);
        let (reports, _) = read(&mut format, &push_data(&copy));
        assert_eq!((reports.len(), format.stats().duplicates), (0, 2));
    }

    #[test]
    fn bad_crcs_other_modulations_and_noise_are_counted() {
        let mut format = SemtechUdp::default();
        let bad = [uplink(&data(1), 7, 5.0, -1), uplink(&data(2), 7, 5.0, 0)].join(",");
        let fsk = uplink(&data(3), 7, 5.0, 1).replace("\"SF7BW125\"", "50000");
        let downlink = uplink(&STANDARD_NO_PAD.encode([0x60, 1, 2, 3, 4]), 7, 5.0, 1);
        for rxpk in [bad, fsk, downlink] {
            assert!(read(&mut format, &push_data(&rxpk)).0.is_empty());
        }
        for noise in
            [&b"+RCV=1,5,HELLO,-99,40"[..], &[], &[2, 0, 0], &[2, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, b'{']]
        {
            assert!(read(&mut format, noise).0.is_empty());
        }
        let stats = format.stats();
        assert_eq!((stats.reports, stats.checksum, stats.malformed, stats.framing), (0, 2, 3, 3));
    }

    #[test]
    fn a_join_request_is_named_by_its_dev_eui() {
        let mut frame = std::vec![0x00; 9];
        frame.extend_from_slice(&[0xDA, 0x1B, 0x01, 0x26, 0x7E, 0xD5, 0xB3, 0x70, 1, 2, 3, 4, 5, 6]);
        let join = uplink(&STANDARD_NO_PAD.encode(frame), 9, 0.0, 1);
        let (reports, _) = read(&mut SemtechUdp::default(), &push_data(&join));
        assert_eq!(reports[0].device, 0x2601_1BDA);
    }
}
