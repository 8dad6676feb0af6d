//! Parameter encodings, component metadata, MAVLink FTP.

use crate::conversation::{OWN, request_message, texts, values};
use crate::station::{Bench, STATION};
use gleaner_link::*;

/// `PARAM_SET` with a `MAV_PARAM_TYPE`.
fn typed_set(name: &str, value: f32, kind: u8) -> Packet {
    let mut payload = [value.to_le_bytes().as_slice(), &OWN, name.as_bytes()].concat();
    payload.resize(22, 0);
    payload.push(kind);
    Packet::from_payload(23, 168, &payload).unwrap()
}

#[test]
fn integer_typed_sets_are_converted_or_refused() {
    let mut bench = Bench::connected();
    let bits = |number: i32| f32::from_bits(number as u32);
    let mut set = |name: &str, value, kind| {
        bench.hear_packet(STATION, &typed_set(name, value, kind));
        bench.run(300);
        let sent = bench.sent();
        (values(&sent)[0].1, texts(&sent).concat())
    };
    for (name, value, kind, now) in [
        ("GLN_RESERVE", bits(12), 6, 12.0),
        ("GLN_RESERVE", 14.0, 6, 14.0),
        ("GLN_ALT", bits(50), 6, 50.0),
        ("GLN_ENABLE", bits(2), 2, 2.0),
        ("GLN_W_RC", bits(6), 6, 6.0),
        ("GLN_W_RC", bits(0), 6, 0.0),
        ("GLN_W_DATA", bits(1), 6, 1.0),
    ] {
        assert_eq!(set(name, value, kind).0, now, "{name} {value:e} as type {kind}");
    }
    for (name, value, kind, why) in [
        ("GLN_RESERVE", bits(12), 9, "integer bits in a REAL32"),
        ("GLN_RESERVE", 0.5, 6, "typed integer, but is none"),
        ("GLN_RESERVE", 12.0, 10, "type 10 unsupported"),
        ("GLN_RESERVE", bits(-1), 6, "GLN_RESERVE must be 0..50 units"),
    ] {
        let (value_now, said) = set(name, value, kind);
        assert_eq!(value_now, 14.0);
        assert!(said.contains(why), "{said:?} lacks {why:?}");
    }
}

#[test]
fn a_parameter_cache_checksum_is_not_missed_aloud() {
    let mut bench = Bench::connected();
    let mut payload = [&(-1_i16).to_le_bytes(), &OWN[..], b"_HASH_CHECK"].concat();
    payload.resize(20, 0);
    bench.hear_packet(STATION, &Packet::from_payload(20, 214, &payload).unwrap());
    bench.run(200);
    assert_eq!(texts(&bench.sent()), Vec::<String>::new());
}

#[test]
fn file_transfer_is_refused_at_once() {
    let mut bench = Bench::connected();
    let request = |target: [u8; 2]| {
        // Sequence 513, session 3, opcode 4 (open for reading).
        let payload = [0, target[0], target[1], 1, 2, 3, 4, 7, 0, 0, 0, 0, 0, 0, 0, b'@'];
        Packet::from_payload(110, 84, &payload).unwrap()
    };
    bench.hear_packet(STATION, &request([42, 1]));
    bench.hear_packet(STATION, &request([42, 0]));
    assert_eq!(bench.sent_with_id(110), []);
    bench.hear_packet(STATION, &request(OWN));
    let sent = bench.sent_with_id(110);
    // To its sender: sequence 514, session 3, NAK (129), one byte: unknown command (7).
    assert_eq!(sent[0].payload(), [0, 255, 190, 2, 2, 3, 129, 1, 4, 0, 0, 0, 0, 0, 0, 7]);
    assert_eq!(sent.len(), 1);
}

#[test]
fn metadata_is_named_once_there_is_some() {
    let mut bench = Bench::connected();
    bench.hear_packet(STATION, &request_message(397));
    assert_eq!(bench.sent_with_id(77)[0].payload()[2], 2, "denied");
    let uri = "http://10.0.0.2:8080/general.json";
    assert!(bench.component.set_metadata(uri, 0x0102_0304));
    bench.run(4_000);
    bench.sent();
    bench.hear_packet(STATION, &request_message(397));
    let sent = bench.sent_with_id(397);
    assert_eq!(sent[0].payload()[4..8], [4, 3, 2, 1]);
    assert_eq!(&sent[0].payload()[8..], uri.as_bytes());
    assert!(!bench.component.set_metadata(&"x".repeat(101), 0));
}

#[test]
fn all_telemetry_names_fit_and_are_sent() {
    let mut bench = Bench::connected();
    let telemetry = Telemetry { unit_percent: Some(1.2), snr_offset_db: Some(-3.0), ..Telemetry::default() };
    bench.component.send_telemetry(bench.now(), &telemetry);
    let names: Vec<String> = bench
        .sent_with_id(251)
        .iter()
        .map(|frame| String::from_utf8_lossy(&frame.payload()[8..]).trim_end_matches('\0').into())
        .collect();
    assert_eq!(names, ["unit_pct", "snr_off"]);
    assert!(telemetry.values().iter().all(|(name, _)| name.len() <= 10));
}
