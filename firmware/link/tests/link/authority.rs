//! Requests that move the aircraft, and requests of the operator that may not be lost or repeated.

use crate::autopilot::{commands, heartbeat};
use crate::conversation::{OWN, acks, command, param_set};
use crate::station::{Bench, STATION, VEHICLE};
use gleaner_link::*;
use gleaner_units::Ned;

const RETURN: u16 = 20;
const GUIDED: u32 = 4;
const LOITER: u32 = 5;

fn enables(bench: &mut Bench) -> Vec<Enable> {
    let enable = |event| match event {
        Event::Operator(OperatorRequest::Enable(enable)) => Some(enable),
        _ => None,
    };
    bench.events().into_iter().filter_map(enable).collect()
}

fn returns(bench: &mut Bench) -> usize {
    commands(bench).iter().filter(|sent| sent.0 == RETURN).count()
}

#[test]
fn a_repetition_needs_a_newer_heartbeat_in_our_mode() {
    let mut bench = Bench::connected();
    let now = bench.now();
    bench.component.request(now, AutopilotCommand::ReturnToLaunch).unwrap();
    bench.run(3_000);
    assert_eq!(returns(&mut bench), 1, "silence is no evidence");
    bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
    bench.run(500);
    assert_eq!(returns(&mut bench), 1);
    for (mode, armed) in [(LOITER, true), (GUIDED, false)] {
        bench.hear_packet(VEHICLE, &heartbeat(mode, armed, 4));
        bench.run(1_000);
        assert_eq!(returns(&mut bench), 0);
    }
}

#[test]
fn a_request_needs_a_fresh_heartbeat() {
    let mut bench = Bench::connected();
    bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
    bench.run(1_600);
    let now = bench.now();
    bench.component.request(now, AutopilotCommand::ReturnToLaunch).unwrap();
    bench.run(500);
    assert_eq!(returns(&mut bench), 0, "the last heartbeat is older than EVIDENCE_AGE");
    bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
    bench.run(50);
    assert_eq!(returns(&mut bench), 1);
}

#[test]
fn a_request_without_evidence_ends_unanswered() {
    let mut bench = Bench::connected();
    let now = bench.now();
    bench.component.request(now, AutopilotCommand::ReturnToLaunch).unwrap();
    for _ in 0..9 {
        bench.hear_packet(VEHICLE, &heartbeat(GUIDED, false, 4));
        bench.run(1_000);
    }
    assert_eq!(returns(&mut bench), 0);
    let command = AutopilotCommand::ReturnToLaunch;
    assert!(bench.events().contains(&Event::RequestEnded { command, outcome: Outcome::NoAnswer }));
}

#[test]
fn revocation_empties_the_queue_of_what_moves_the_aircraft() {
    let mut bench = Bench::connected();
    let now = bench.now();
    bench.component.request(now, AutopilotCommand::ReturnToLaunch).unwrap();
    bench.run(50);
    bench.component.steer(now, &PositionTarget::at(Ned::default())).unwrap();
    let before = bench.component.revocations();
    bench.component.revoke();
    assert_eq!(bench.component.revocations(), before + 1);
    let sent = bench.sent();
    assert!(sent.iter().all(|frame| frame.message_id != 84), "no target");
    let returns = sent.iter().filter(|frame| frame.message_id == 76 && frame.payload()[28..30] == [20, 0]);
    assert_eq!(returns.count(), 0, "no command");
    assert!(sent.iter().any(|frame| frame.message_id == 76), "requests for streams stay");
}

#[test]
fn another_mode_is_remembered_however_many_events_follow() {
    let mut bench = Bench::connected();
    bench.component.take_other_mode();
    for round in 0..40 {
        let mode = if round == 3 { LOITER } else { GUIDED };
        bench.hear_packet(VEHICLE, &heartbeat(mode, round % 2 == 0, 4));
    }
    assert!(bench.component.stats().events_dropped > 0);
    assert!(bench.component.take_other_mode());
    assert!(!bench.component.take_other_mode(), "once");
}

#[test]
fn off_engage_off_with_a_lost_first_transmission_is_off() {
    let mut bench = Bench::connected();
    let mode = |value, confirmation| command(OWN, 31011, value, confirmation);
    for (value, confirmation) in [(0.0, 0), (1.0, 0), (0.0, 1), (0.0, 2)] {
        bench.hear_packet(STATION, &mode(value, confirmation));
        bench.run(500);
    }
    assert_eq!(enables(&mut bench), [Enable::Off, Enable::Engage, Enable::Off, Enable::Off]);
    for _ in 0..3 {
        bench.hear_packet(STATION, &command(OWN, 31012, 0.0, 1));
        assert_eq!(bench.events(), [Event::Operator(OperatorRequest::ReturnNow)]);
    }
}

#[test]
fn an_old_request_to_engage_that_is_resent_is_refused() {
    let mut bench = Bench::connected();
    let mode = |value, confirmation| command(OWN, 31011, value, confirmation);
    bench.hear_packet(STATION, &mode(1.0, 0));
    bench.hear_packet(STATION, &command(OWN, 31010, 0.5, 0));
    bench.run(60_000);
    assert_eq!(enables(&mut bench), [Enable::Engage]);
    bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
    acks(&mut bench);
    for confirmation in [1, 2] {
        bench.hear_packet(STATION, &mode(1.0, confirmation));
        assert_eq!((acks(&mut bench), enables(&mut bench)), (vec![(31011, 1)], vec![]));
    }
    bench.hear_packet(STATION, &mode(1.0, 0));
    assert_eq!(enables(&mut bench), [Enable::Engage], "a new request, however soon");
}

#[test]
fn an_older_command_is_no_resend_of_the_newest() {
    let mut bench = Bench::connected();
    let mode = |value, confirmation| command(OWN, 31011, value, confirmation);
    for (value, confirmation) in [(1.0, 0), (2.0, 0), (1.0, 1)] {
        bench.hear_packet(STATION, &mode(value, confirmation));
        bench.run(500);
    }
    assert_eq!(enables(&mut bench), [Enable::Engage, Enable::Shadow, Enable::Engage]);
}

#[test]
fn a_return_with_nothing_to_return_is_denied() {
    let mut bench = Bench::connected();
    bench.status.may_return = false;
    bench.run(50);
    bench.sent();
    bench.hear_packet(STATION, &command(OWN, 31012, 0.0, 0));
    let acks = bench.sent_with_id(77);
    assert_eq!(acks[0].payload()[2], 2, "MAV_RESULT_DENIED");
    assert_eq!(bench.events(), []);
}

#[test]
fn the_parameter_engages_on_a_change_and_not_on_a_repetition() {
    let mut bench = Bench::connected();
    let set = |bench: &mut Bench, value| {
        bench.hear_packet(STATION, &param_set(OWN, "GLN_ENABLE", value));
        enables(bench)
    };
    assert_eq!(set(&mut bench, 1.0), [Enable::Engage]);
    assert_eq!(set(&mut bench, 1.0), [], "it has that value");
    // The pilot took over: the owner shows the truth, and the station repeats what it saw no answer to.
    bench.component.set_parameter(ParameterId::Enable, 0.0).unwrap();
    bench.run(2_000);
    assert_eq!(set(&mut bench, 1.0), [], "repeated");
    bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
    bench.run(8_100);
    bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
    assert_eq!(set(&mut bench, 1.0), [Enable::Engage], "asked again");
    for _ in 0..3 {
        assert_eq!(set(&mut bench, 0.0), [Enable::Off], "off always acts");
    }
    assert_eq!(set(&mut bench, 1.0), [Enable::Engage], "after an off it is no repetition");
}

#[test]
fn a_target_that_is_not_ours_is_seen() {
    let mut bench = Bench::connected();
    let followed = |north_m: f32, ignored: u16| {
        let mut payload = vec![0; 51];
        payload[4..8].copy_from_slice(&north_m.to_le_bytes());
        payload[12..16].copy_from_slice(&(-60.0_f32).to_le_bytes());
        payload[48..50].copy_from_slice(&ignored.to_le_bytes());
        Packet::from_payload(85, 140, &payload).unwrap()
    };
    let target = PositionTarget::at(Ned { north_m: 20.0, east_m: 0.0, down_m: -60.0 });
    for _ in 0..3 {
        let now = bench.now();
        bench.component.steer(now, &target).unwrap();
        bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
        bench.hear_packet(VEHICLE, &followed(20.0, 0x0DF8));
        bench.run(1_000);
    }
    assert_eq!(bench.component.foreign_target(), None);
    bench.hear_packet(STATION, &followed(300.0, 0x0DF8));
    assert_eq!(bench.component.foreign_target(), None, "that is not the autopilot");
    bench.hear_packet(VEHICLE, &followed(300.0, 0x0DF8));
    assert!(bench.component.foreign_target().is_some());
}

#[test]
fn rc_channels_are_asked_for_once_one_is_mapped() {
    let mut bench = Bench::connected();
    let asked = |bench: &mut Bench| {
        let mut asked = 0;
        for _ in 0..15 {
            bench.hear_packet(VEHICLE, &heartbeat(GUIDED, true, 4));
            bench.run(1_000);
            asked += commands(bench).iter().filter(|sent| (sent.0, sent.1) == (511, 65.0)).count();
        }
        asked
    };
    assert_eq!(asked(&mut bench), 0);
    bench.component.set_parameter(ParameterId::DataWeightChannel, 6.0).unwrap();
    assert!(asked(&mut bench) > 0);
}
