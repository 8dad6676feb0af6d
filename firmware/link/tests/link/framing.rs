//! Frames among noise.

use crate::seeded;
use crate::station::{frames, golden};
use gleaner_link::{Frame, FrameDecoder};
use proptest::prelude::*;

const NAMES: [&str; 8] = [
    "heartbeat_copter_guided",
    "battery_status",
    "local_position_ned",
    "command_user_1",
    "tunnel_radio_report",
    "signed_heartbeat",
    "v1_local_position_ned",
    "statustext",
];

fn decode_chunked(wire: &[u8], chunk: usize) -> (Vec<Frame>, FrameDecoder) {
    let mut decoder = FrameDecoder::new();
    let mut found = Vec::new();
    for mut bytes in wire.chunks(chunk) {
        while !bytes.is_empty() {
            let taken = decoder.push(bytes);
            assert!(taken > 0, "a drained decoder takes bytes");
            bytes = &bytes[taken..];
            found.extend(std::iter::from_fn(|| decoder.next_frame()));
        }
    }
    (found, decoder)
}

/// Noise that likes magic bytes, small lengths and the ids of known messages.
fn noise() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![4 => any::<u8>(), 2 => Just(0xFD), 1 => Just(0xFE), 3 => Just(0), 1 => 0u8..40];
    proptest::collection::vec(byte, 0..120)
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn no_noise_and_no_split_costs_a_frame(
        items in proptest::collection::vec((0..NAMES.len(), noise()), 1..12),
        chunk in 1usize..700,
    ) {
        let mut wire = Vec::new();
        let mut expected = Vec::new();
        for (name, noise) in &items {
            wire.extend_from_slice(noise);
            let packet = golden(NAMES[*name]);
            expected.extend(frames(&packet));
            wire.extend_from_slice(&packet);
        }
        // A false magic byte may wait for as much as the longest frame before it is given up.
        wire.extend_from_slice(&[0; 280]);
        let (found, decoder) = decode_chunked(&wire, chunk);
        let mut rest = found.iter();
        for frame in &expected {
            prop_assert!(rest.any(|other| other == frame), "lost {frame:?}");
        }
        prop_assert_eq!(decoder.stats().frames as usize, found.len());
    }

    #[test]
    fn a_damaged_frame_is_dropped_and_the_next_one_is_not(
        name in 0..NAMES.len(), next in 0..NAMES.len(), at in 0usize..300, flip in 1u8..=255, cut in proptest::option::of(1usize..300),
    ) {
        let mut damaged = golden(NAMES[name]);
        // Behind the checksum of a signed frame lies a signature that nobody verifies.
        let checked = damaged.len() - if NAMES[name].starts_with("signed") { 13 } else { 0 };
        match cut {
            None => damaged[at % checked] ^= flip,
            Some(cut) => damaged.truncate(cut % checked),
        }
        let good = golden(NAMES[next]);
        let wire = [damaged, good.clone(), vec![0; 280]].concat();
        let (found, decoder) = decode_chunked(&wire, 64);
        prop_assert_eq!(&found, &frames(&good));
        prop_assert!(cut == Some(0) || decoder.stats().garbage_bytes > 0);
    }

    #[test]
    fn nothing_makes_a_component_panic(
        bytes in proptest::collection::vec(noise(), 0..30), names in proptest::collection::vec(0..NAMES.len(), 0..30),
    ) {
        let mut bench = crate::station::Bench::connected();
        for (noise, name) in bytes.iter().zip(names) {
            let now = bench.now();
            bench.component.receive(now, noise);
            bench.hear(NAMES[name]);
            bench.run(100);
        }
        frames(&bench.sent_bytes());
    }
}

#[test]
fn each_kind_of_damage_has_its_counter() {
    let good = golden("heartbeat_copter_guided");
    let damage = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        let (found, decoder) = decode_chunked(&[bytes, good.clone()].concat(), 1_000);
        assert_eq!(found.len(), 1);
        decoder.stats()
    };
    assert_eq!(damage(12, 0x55).bad_crc, 1);
    assert_eq!(damage(9, 0x55).unknown_message, 1);
    assert_eq!(damage(2, 0x04).incompatible, 1);
    assert_eq!(damage(0, 0x55).garbage_bytes, good.len() as u32);
    let (_, decoder) = decode_chunked(&golden("signed_heartbeat"), 1_000);
    assert_eq!((decoder.stats().signed, decoder.stats().garbage_bytes), (1, 0));
}
