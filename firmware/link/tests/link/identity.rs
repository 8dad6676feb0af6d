//! Which vehicle is served, and who may command.

use crate::conversation::{OWN, acks, command, param_set, texts, values};
use crate::station::{Bench, STATION, VEHICLE};
use gleaner_link::*;

const ENGAGE: u16 = 31011;

/// A heartbeat of a vehicle: `MAV_TYPE`, `MAV_AUTOPILOT`, GUIDED, armed.
fn vehicle(kind: u8, autopilot: u8) -> Packet {
    Packet::from_payload(0, 50, &[4, 0, 0, 0, kind, autopilot, 0xD9, 4, 3]).unwrap()
}

/// Lets `seconds` pass while these send heartbeats.
fn beat(bench: &mut Bench, seconds: u64, senders: &[(Address, u8)]) {
    for _ in 0..seconds {
        for &(sender, kind) in senders {
            bench.hear_packet(sender, &vehicle(kind, 3));
        }
        bench.run(1_000);
    }
}

fn engage(bench: &mut Bench) -> Vec<(u16, u8)> {
    let Address { system, component } = bench.component.address();
    bench.hear_packet(STATION, &command([system, component], ENGAGE, 1.0, 0));
    bench.events();
    acks(bench)
}

#[test]
fn a_configured_system_id_pins_the_vehicle() {
    let mut bench = Bench::with(Settings::new(Some(7), 191).unwrap());
    beat(&mut bench, 5, &[(Address::new(42, 1), 2)]);
    assert_eq!(bench.component.address(), Address::new(7, 191));
    assert_eq!(bench.component.autopilot().address(), None, "42 is not the configured vehicle");
    beat(&mut bench, 2, &[(Address::new(42, 1), 2), (Address::new(7, 1), 2)]);
    assert_eq!(bench.component.autopilot().address(), Some(Address::new(7, 1)));
    assert_eq!(engage(&mut bench), [(ENGAGE, 0)], "a second vehicle does not matter");
}

#[test]
fn several_autopilots_without_a_configured_one_block() {
    let mut bench = Bench::fresh();
    beat(&mut bench, 6, &[(Address::new(1, 1), 2), (Address::new(2, 1), 2)]);
    assert_eq!(bench.component.autopilot().address(), None);
    let said = texts(&bench.sent());
    assert!(said.iter().any(|text| text.contains("set system_id")), "{said:?}");
    assert_eq!(engage(&mut bench), [(ENGAGE, 1)]);
    bench.hear_packet(STATION, &param_set([1, 191], "GLN_ENABLE", 1.0));
    assert_eq!(bench.events(), []);
    assert_eq!(bench.component.parameters().enable(), Enable::Off);
}

#[test]
fn a_second_vehicle_blocks_engaging_while_it_is_heard() {
    let mut bench = Bench::connected();
    beat(&mut bench, 2, &[(VEHICLE, 2), (Address::new(9, 1), 2)]);
    assert_eq!(bench.component.engage_block(), Some(EngageBlock::SeveralAutopilots(9)));
    bench.sent();
    assert_eq!(engage(&mut bench), [(ENGAGE, 1)]);
    beat(&mut bench, 11, &[(VEHICLE, 2)]);
    bench.sent();
    assert_eq!(engage(&mut bench), [(ENGAGE, 0)]);
}

#[test]
fn only_multirotors_are_served() {
    for kind in [1, 4, 10, 12, 19, 21] {
        let mut bench = Bench::fresh();
        beat(&mut bench, 5, &[(VEHICLE, kind)]);
        assert_eq!(bench.component.engage_block(), Some(EngageBlock::NotMultirotor(kind)));
        assert!(!bench.component.autopilot().companion_may_steer(), "mode 4 of MAV_TYPE {kind}");
        assert!(texts(&bench.sent()).contains(&format!("gleaner: MAV_TYPE {kind} is no multirotor")));
        assert_eq!(engage(&mut bench), [(ENGAGE, 1)]);
    }
    for kind in [2, 3, 13, 14, 15, 29, 35, 43] {
        let mut bench = Bench::fresh();
        beat(&mut bench, 5, &[(VEHICLE, kind)]);
        assert!(bench.component.autopilot().companion_may_steer(), "MAV_TYPE {kind}");
    }
}

#[test]
fn a_peripheral_is_never_the_autopilot() {
    // Gimbal, camera, companion, ADS-B, generic and a type of the future, all with an autopilot's MAV_AUTOPILOT.
    for kind in [26, 30, 18, 27, 0, 200] {
        let mut bench = Bench::fresh();
        beat(&mut bench, 5, &[(Address::new(42, 154), kind), (VEHICLE, 2)]);
        assert_eq!(bench.component.autopilot().address(), Some(VEHICLE), "MAV_TYPE {kind}");
        let mut alone = Bench::fresh();
        beat(&mut alone, 6, &[(Address::new(42, 154), kind)]);
        assert_eq!(alone.component.address(), Address::new(1, 191), "MAV_TYPE {kind} alone");
    }
}

#[test]
fn a_second_component_with_our_id_blocks_engaging() {
    let mut bench = Bench::connected();
    let twin = Packet::from_payload(0, 50, &[0, 0, 0, 0, 18, 8, 0, 4, 3]).unwrap();
    for step in 0..3 {
        bench.component.receive(bench.now(), &twin.frame(bench.component.address(), 200 + step));
        beat(&mut bench, 1, &[(VEHICLE, 2)]);
    }
    assert_eq!(bench.component.engage_block(), Some(EngageBlock::DuplicateId));
    let said = texts(&bench.sent());
    assert!(said.contains(&"gleaner: another component has our id 42/191".into()), "{said:?}");
    assert_eq!(engage(&mut bench), [(ENGAGE, 1)]);
    beat(&mut bench, 12, &[(VEHICLE, 2)]);
    bench.sent();
    assert_eq!(engage(&mut bench), [(ENGAGE, 0)], "the other one is gone");
}

#[test]
fn an_echo_of_our_heartbeats_is_no_second_component() {
    let mut bench = Bench::connected();
    for _ in 0..20 {
        beat(&mut bench, 1, &[(VEHICLE, 2)]);
        let echo = bench.sent_bytes();
        bench.component.receive(bench.now(), &echo);
    }
    assert_eq!((bench.component.engage_block(), bench.component.stats().duplicate_id), (None, 0));
}

#[test]
fn a_broadcast_engages_nothing_and_gets_no_answer() {
    let mut bench = Bench::connected();
    for target in [[0, 0], [42, 0], [0, 191]] {
        for (id, first) in [(ENGAGE, 1.0), (31010, 0.25), (31012, 0.0), (400, 1.0), (512, 30.0)] {
            bench.hear_packet(STATION, &command(target, id, first, 0));
        }
        bench.hear_packet(STATION, &param_set(target, "GLN_ENABLE", 1.0));
        bench.hear_packet(STATION, &param_set(target, "NOT_OURS", 1.0));
    }
    assert_eq!(bench.events(), []);
    bench.run(100);
    let sent = bench.sent();
    assert_eq!(texts(&sent), Vec::<String>::new());
    assert_eq!(sent.iter().filter(|frame| frame.message_id == 77).count(), 0);
    assert_eq!(bench.component.stats().not_addressed, 3 * 4);
    bench.hear_packet(STATION, &param_set([42, 0], "GLN_SPEED", 8.0));
    bench.run(50);
    assert_eq!(values(&bench.sent()), [(3, 8.0)], "parameters that do not engage follow the routing rules");
}

/// A stranger that tries ten times a second must not hide what the operator is told.
#[test]
fn refusals_of_a_stranger_leave_room_for_the_operators_texts() {
    let mut bench = Bench::connected();
    let stranger = Address::new(77, 5);
    let mut said = vec![];
    for second in 0..30 {
        for request in 0..10 {
            bench.hear_packet(stranger, &command(OWN, ENGAGE, 1.0, request));
            bench.hear_packet(stranger, &param_set(OWN, "GLN_NONE", 80.0));
            bench.run(100);
        }
        bench.hear_packet(STATION, &command(OWN, 31010, 0.01 * second as f32, 0));
        said.extend(texts(&bench.sent()));
        bench.events();
    }
    let of = |part: &str| said.iter().filter(|text| text.contains(part)).count();
    assert_eq!(of("by 255/190"), 29, "{said:?}");
    assert!((6..=9).contains(&(of("refused: not an operator") + of("no parameter"))), "{said:?}");
    assert!(of("more)") >= 2, "{said:?}");
}

#[test]
fn only_operators_command_and_each_is_named() {
    let mut bench = Bench::connected();
    let stranger = Address::new(77, 5);
    bench.hear_packet(stranger, &command(OWN, ENGAGE, 1.0, 0));
    bench.hear_packet(stranger, &param_set(OWN, "GLN_ALT", 80.0));
    bench.run(300);
    let sent = bench.sent();
    let ack = sent.iter().find(|frame| frame.message_id == 77).unwrap();
    assert_eq!((ack.payload()[2], &ack.payload()[8..]), (2, &[77, 5][..]), "denied, to its sender");
    assert_eq!(values(&sent), [(2, 60.0)]);
    let said = texts(&sent).concat();
    assert!(said.contains("gleaner: engage by 77/5 refused: not an operator"), "{said}");
    assert!(said.contains("gleaner: GLN_ALT by 77/5 refused: not an operato"), "{said}");
    assert_eq!((bench.events(), bench.component.stats().not_allowed), (vec![], 2));
    bench.hear_packet(STATION, &command(OWN, ENGAGE, 1.0, 0));
    bench.hear_packet(STATION, &command(OWN, 31010, 0.25, 0));
    bench.run(300);
    let said = texts(&bench.sent());
    assert_eq!(said, ["gleaner: engage by 255/190", "gleaner: preference 0.25 by 255/190"]);
}

#[test]
fn the_allow_list_is_a_setting() {
    let mut operators = Operators::none();
    assert!(operators.add("250/100".parse().unwrap()));
    let mut bench = Bench::with(Settings::new(Some(42), 191).unwrap().with_operators(operators));
    beat(&mut bench, 2, &[(VEHICLE, 2)]);
    assert_eq!(engage(&mut bench), [(ENGAGE, 2)], "255 is not on this list");
    bench.hear_packet(Address::new(250, 100), &command(OWN, ENGAGE, 1.0, 0));
    assert_eq!(bench.events(), [Event::Operator(OperatorRequest::Enable(Enable::Engage))]);
}

#[test]
fn reports_come_from_the_vehicle_or_an_operator() {
    let mut bench = Bench::connected();
    let report = Packet::from_payload(385, 147, &[64, 156, 0, 0, 3, 1, 2, 3]).unwrap();
    for sender in [Address::new(3, 68), Address::new(77, 1)] {
        bench.hear_packet(sender, &report);
    }
    assert_eq!((bench.events(), bench.component.stats().foreign_reports), (vec![], 2));
    for sender in [Address::new(42, 68), STATION] {
        bench.hear_packet(sender, &report);
        assert_eq!(bench.events().len(), 1, "{sender}");
    }
}
