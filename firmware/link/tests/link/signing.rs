//! MAVLink 2 signing, against frames that pymavlink signed.

use crate::station::{frames, golden};
use gleaner_link::*;

/// As in make_golden.py.
const LINK: u8 = 3;

fn key() -> SigningKey {
    SigningKey::from_passphrase("golden")
}

fn signing(wall: u64) -> Signing {
    Signing::new(key(), LINK, SigningTime::from_wire(wall), None)
}

fn frame(name: &str) -> Frame {
    frames(&golden(name)).remove(0)
}

#[test]
fn a_frame_signed_by_pymavlink_is_accepted_once() {
    let mut signing = signing(0);
    let signed = frame("signed_heartbeat");
    assert_eq!(signing.check(&signed), Ok(()));
    assert_eq!(signing.check(&signed), Err(SigningFault::Replayed));
    assert_eq!(signing.check(&frame("signed_heartbeat_later")), Ok(()));
    assert_eq!(signing.check(&signed), Err(SigningFault::Replayed));
    assert_eq!(signing.check(&frame("signed_unknown_link")), Ok(()), "a stream of its own");
    let stats = signing.stats();
    assert_eq!((stats.accepted, stats.replayed), (3, 2));
}

#[test]
fn our_signature_is_pymavlinks() {
    let mut signing = signing(123_456_788);
    let signed = signing.sign(&golden("heartbeat_copter_guided")).unwrap();
    assert_eq!(signed[..], golden("signed_heartbeat"), "the next timestamp is 123456789");
    let again = signing.sign(&golden("heartbeat_copter_guided")).unwrap();
    assert!(again > signed, "timestamps increase");
    assert_eq!(signing.sign(&golden("v1_command_ack")), None, "MAVLink 1 has no signatures");
    assert_eq!(signing.sign(&signed), None, "signed already");
    assert_eq!(signing.stats().signed, 2);
}

#[test]
fn wrong_unsigned_and_old_frames_are_dropped_and_counted() {
    let mut other = Signing::new(SigningKey::new([7; 32]), LINK, SigningTime::default(), None);
    assert_eq!(other.check(&frame("signed_heartbeat")), Err(SigningFault::Signature));
    let mut altered = golden("signed_heartbeat");
    *altered.last_mut().unwrap() ^= 1;
    assert_eq!(other.check(&frames(&altered)[0]), Err(SigningFault::Signature));
    for name in ["heartbeat_copter_guided", "v1_command_ack", "command_user_1"] {
        assert_eq!(other.check(&frame(name)), Err(SigningFault::Unsigned), "{name}");
    }
    // More than a minute after the timestamp of the frame.
    let minute = 6_000_000;
    assert_eq!(signing(123_456_789 + minute + 1).check(&frame("signed_heartbeat")), Err(SigningFault::Old));
    assert_eq!(signing(123_456_789 + minute).check(&frame("signed_heartbeat")), Ok(()));
    let stats = other.stats();
    assert_eq!((stats.wrong, stats.unsigned, stats.accepted), (2, 3, 0));
}

#[test]
fn radio_status_needs_no_signature_and_setup_never_passes() {
    let mut signing = signing(0);
    let status = Packet::from_payload(109, 185, &[0; 9]).unwrap().frame(Address::new(51, 68), 0);
    assert_eq!(signing.check(&frames(&status)[0]), Ok(()));
    assert_eq!(signing.check(&frame("signed_setup_signing")), Err(SigningFault::Setup));
    assert!(!may_forward(256) && may_forward(0) && may_forward(76));
    assert_eq!(signing.stats().setup, 1);
}

#[test]
fn a_restart_accepts_no_replay_and_goes_on_later() {
    let mut before = signing(123_000_000);
    assert_eq!(before.check(&frame("signed_heartbeat_later")), Ok(()));
    let last = before.sign(&golden("heartbeat_copter_guided")).unwrap();
    let stored = before.state().to_bytes();
    let state = SigningState::from_bytes(&stored).unwrap();
    assert_eq!(&state, before.state());
    // The clock of the computer starts at 1970.
    let mut after = Signing::new(key(), LINK, SigningTime::from_unix_micros(0), Some(state));
    assert_eq!(after.check(&frame("signed_heartbeat")), Err(SigningFault::Replayed));
    assert_eq!(after.check(&frame("signed_heartbeat_later")), Err(SigningFault::Replayed));
    assert_eq!(after.check(&frame("signed_unknown_link")), Err(SigningFault::Old), "a minute is added");
    let time = |frame: &[u8]| {
        u64::from_le_bytes([&frame[frame.len() - 12..frame.len() - 6], &[0, 0]].concat().try_into().unwrap())
    };
    let next = after.sign(&golden("heartbeat_copter_guided")).unwrap();
    assert!(time(&next) > time(&last));
}

#[test]
fn damaged_states_are_refused() {
    let mut signing = signing(123_000_000);
    signing.check(&frame("signed_heartbeat")).unwrap();
    let stored = signing.state().to_bytes();
    for at in 0..stored.len() {
        let mut damaged = stored.clone();
        damaged[at] ^= 0x40;
        assert!(SigningState::from_bytes(&damaged).is_err(), "byte {at}");
        assert!(SigningState::from_bytes(&stored[..at]).is_err(), "cut to {at}");
    }
}

#[test]
fn the_key_is_not_printed() {
    assert_eq!(format!("{:?}", SigningKey::new([0x5A; 32])), "SigningKey(..)");
}
