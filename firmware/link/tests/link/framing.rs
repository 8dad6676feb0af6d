//! Frames among noise, and payloads that look like frames.

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
        while let Some(mut frame) = decoder.read(&mut bytes) {
            // When a frame was found is another question than which frames were found.
            frame.late = false;
            found.push(frame);
        }
        assert!(bytes.is_empty(), "all bytes are taken in");
    }
    (found, decoder)
}

/// A damaged header claims 200 bytes of payload: the heartbeats behind it wait until its end has arrived. Only those that
/// were complete before are late.
#[test]
fn a_frame_that_waited_behind_a_damaged_one_is_late() {
    let heartbeat = golden("heartbeat_copter_guided");
    let mut damaged = golden("battery_status");
    damaged.truncate(10);
    damaged[1] = 200;
    let mut decoder = FrameDecoder::new();
    let early = [damaged.as_slice(), &heartbeat].concat();
    assert!(decoder.read(&mut &*early).is_none(), "the damaged frame may still be whole");
    let rest = heartbeat.repeat(12);
    let mut rest = &rest[..];
    let late: Vec<bool> = std::iter::from_fn(|| decoder.read(&mut rest)).map(|frame| frame.late).collect();
    assert_eq!((late[0], late[1]), (true, false), "{late:?}");
}

/// Noise with many magic bytes, small lengths and ids of known messages.
fn noise() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![4 => any::<u8>(), 2 => Just(0xFD), 1 => Just(0xFE), 3 => Just(0), 1 => 0u8..40];
    proptest::collection::vec(byte, 0..120)
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn noise_costs_only_the_frames_close_behind_it(
        before in proptest::collection::vec(0..NAMES.len(), 0..6),
        noise in noise(),
        behind in proptest::collection::vec(0..NAMES.len(), 1..6),
        chunk in 1usize..700,
    ) {
        let packets = |names: &[usize]| names.iter().map(|&name| golden(NAMES[name])).collect::<Vec<_>>().concat();
        // 30 heartbeats are longer than twice the longest frame.
        let close = golden("heartbeat_copter_guided").repeat(30);
        let (before, behind) = (packets(&before), packets(&behind));
        let wire = [before.as_slice(), &noise, &close, &behind, &[0; 300]].concat();
        let (found, decoder) = decode_chunked(&wire, chunk);
        let (before, behind) = (frames(&before), frames(&behind));
        prop_assert_eq!(&found[..before.len()], before);
        prop_assert_eq!(&found[found.len() - behind.len()..], behind);
        prop_assert_eq!(decoder.stats().frames as usize, found.len());
    }

    #[test]
    fn clean_bytes_in_any_pieces_lose_nothing(
        names in proptest::collection::vec(0..NAMES.len(), 1..12), chunk in 1usize..700,
    ) {
        let wire = names.iter().map(|&name| golden(NAMES[name])).collect::<Vec<_>>().concat();
        let (found, decoder) = decode_chunked(&wire, chunk);
        prop_assert_eq!(found, frames(&wire));
        prop_assert_eq!(decoder.stats().garbage_bytes, 0);
    }

    #[test]
    fn a_damaged_frame_is_dropped_and_the_next_one_is_not(
        name in 0..NAMES.len(), next in 0..NAMES.len(), at in 0usize..300, flip in 1u8..=255, cut in proptest::option::of(1usize..300),
    ) {
        let mut damaged = golden(NAMES[name]);
        // The decoder does not verify the signature behind the checksum.
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

/// A MAVLink 2 frame with an id outside the dialect. Its checksum cannot be known.
fn unknown_frame(payload: &[u8]) -> Vec<u8> {
    let header = [0xFD, payload.len() as u8, 0, 0, 7, 255, 190, 0x39, 0x30, 0xD0];
    [&header, payload, &[0x12, 0x34]].concat()
}

#[test]
fn a_frame_inside_an_unknown_frame_is_data() {
    let engage = golden("command_user_1");
    let heartbeat = golden("heartbeat_copter_guided");
    let carrier = unknown_frame(&engage.repeat(3));
    for chunk in [1, 7, 1_000] {
        let wire = [heartbeat.clone(), carrier.repeat(5), heartbeat.clone()].concat();
        let (found, decoder) = decode_chunked(&wire, chunk);
        assert_eq!(found, frames(&heartbeat.repeat(2)), "in chunks of {chunk}");
        assert_eq!(decoder.stats().unknown_message, 5);
    }
}

#[test]
fn a_datagram_of_an_unknown_frame_holds_no_frame() {
    let mut bench = crate::station::Bench::connected();
    let carrier = unknown_frame(&golden("command_user_1"));
    // Also when the datagram is cut, and when the next one begins with noise.
    for length in [carrier.len(), carrier.len() - 1, carrier.len() - 20] {
        let now = bench.now();
        bench.component.receive_datagram(now, &carrier[..length]);
        bench.component.receive_datagram(now, &[0; 300]);
        bench.run(100);
    }
    assert_eq!(bench.events(), []);
    bench.component.receive_datagram(bench.now(), &golden("command_user_1"));
    assert_eq!(bench.events().len(), 1);
}

#[test]
fn a_frame_inside_a_damaged_frame_is_data() {
    let engage = golden("command_user_1");
    let mut carrier = crate::conversation::tunnel_of(&engage);
    carrier[12] ^= 1;
    let heartbeat = golden("heartbeat_copter_guided");
    let wire = [heartbeat.clone(), carrier, heartbeat.clone()].concat();
    let (found, decoder) = decode_chunked(&wire, 50);
    assert_eq!(found, frames(&heartbeat.repeat(2)));
    assert_eq!(decoder.stats().bad_crc, 1);
}

#[test]
fn a_lost_byte_in_an_unknown_frame_costs_one_frame_more() {
    let heartbeat = golden("heartbeat_copter_guided");
    let mut carrier = unknown_frame(&golden("command_user_1"));
    carrier.remove(20);
    let wire = [heartbeat.clone(), carrier, heartbeat.repeat(4)].concat();
    let (found, _) = decode_chunked(&wire, 1_000);
    assert_eq!(found.len(), 1 + 3);
}
