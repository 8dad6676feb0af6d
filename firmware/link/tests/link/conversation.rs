//! Requests of others and our answers.

use crate::seeded;
use crate::station::{Bench, STATION, VEHICLE, frames, golden};
use gleaner_link::*;
use gleaner_units::{MetresPerSecond, Ned};
use proptest::prelude::*;

const COMMAND_LONG: (u32, u8) = (76, 152);
const PARAM_SET: (u32, u8) = (23, 168);
const ACK: u32 = 77;
const PARAM_VALUE: u32 = 22;
const TEXT: u32 = 253;
pub const OWN: [u8; 2] = [42, 191];

pub fn command(target: [u8; 2], id: u16, first: f32, confirmation: u8) -> Packet {
    let mut payload = first.to_le_bytes().to_vec();
    payload.resize(28, 0);
    payload.extend_from_slice(&id.to_le_bytes());
    payload.extend_from_slice(&[target[0], target[1], confirmation]);
    Packet::from_payload(COMMAND_LONG.0, COMMAND_LONG.1, &payload).unwrap()
}

pub fn request_message(id: u32) -> Packet {
    command(OWN, 512, id as f32, 0)
}

/// A `TUNNEL` frame with this payload.
pub fn tunnel_of(payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0, 0x80, 0, 0, payload.len() as u8];
    bytes.extend_from_slice(payload);
    Packet::from_payload(385, 147, &bytes).unwrap().frame(STATION, 3).to_vec()
}

pub fn param_set(target: [u8; 2], name: &str, value: f32) -> Packet {
    let mut payload = [value.to_le_bytes().as_slice(), &target, name.as_bytes()].concat();
    payload.resize(22, 0);
    payload.push(9);
    Packet::from_payload(PARAM_SET.0, PARAM_SET.1, &payload).unwrap()
}

/// The results of the acknowledgements sent, all of which must go to the station.
pub fn acks(bench: &mut Bench) -> Vec<(u16, u8)> {
    let read = |frame: Frame| {
        let payload = frame.payload();
        assert_eq!(payload[8..], [STATION.system, STATION.component], "the ack goes to who asked");
        (u16::from_le_bytes([payload[0], payload[1]]), payload[2])
    };
    bench.sent_with_id(ACK).into_iter().map(read).collect()
}

pub fn texts(frames: &[Frame]) -> Vec<String> {
    let texts = frames.iter().filter(|frame| frame.message_id == TEXT);
    texts
        .map(|frame| {
            let text: Vec<u8> =
                frame.payload()[1..].iter().copied().take(50).take_while(|&byte| byte != 0).collect();
            String::from_utf8(text).unwrap()
        })
        .collect()
}

pub fn values(frames: &[Frame]) -> Vec<(u16, f32)> {
    let values = frames.iter().filter(|frame| frame.message_id == PARAM_VALUE);
    values
        .map(|frame| {
            let payload = frame.payload();
            assert_eq!(payload[4..6], [11, 0], "eleven parameters");
            assert_eq!(payload[24], 9, "REAL32");
            (
                u16::from_le_bytes([payload[6], payload[7]]),
                f32::from_le_bytes(payload[..4].try_into().unwrap()),
            )
        })
        .collect()
}

#[test]
fn operator_commands_are_acknowledged_done_and_mirrored() {
    let mut bench = Bench::connected();
    bench.hear_packet(STATION, &command(OWN, 31010, 0.25, 0));
    bench.hear_packet(STATION, &command(OWN, 31011, 2.0, 0));
    bench.hear_packet(STATION, &command(OWN, 31012, 0.0, 0));
    assert_eq!(acks(&mut bench), [(31010, 0), (31011, 0), (31012, 0)]);
    let asked = [
        Event::Operator(OperatorRequest::SetPreference(0.25)),
        Event::Operator(OperatorRequest::Enable(Enable::Shadow)),
        Event::Operator(OperatorRequest::ReturnNow),
    ];
    assert_eq!(bench.events(), asked);
    assert_eq!(bench.component.parameters().data_weight(), 0.25);
    assert_eq!(bench.component.parameters().enable(), Enable::Shadow);
    bench.run(50);
    assert_eq!(values(&bench.sent()), [(0, 0.25), (1, 2.0)]);
}

#[test]
fn bad_commands_are_refused_and_change_nothing() {
    let mut bench = Bench::connected();
    for (id, first, result) in [
        (31010, f32::NAN, 2),
        (31010, 1.01, 2),
        (31010, -0.01, 2),
        (31011, 3.0, 2),
        (31011, 0.5, 2),
        (31011, f32::INFINITY, 2),
        (512, 30.0, 2),
        (511, 0.0, 3),
        (400, 1.0, 3),
        (31013, 1.0, 3),
    ] {
        bench.hear_packet(STATION, &command(OWN, id, first, 0));
        assert_eq!(acks(&mut bench), [(id, result)], "command {id} with {first}");
    }
    bench.status.may_engage = false;
    bench.run(50);
    bench.hear_packet(STATION, &command(OWN, 31011, 1.0, 0));
    assert_eq!(acks(&mut bench), [(31011, 1)], "temporarily rejected while the owner cannot engage");
    assert_eq!(bench.events(), []);
    assert_eq!(*bench.component.parameters(), Parameters::default());
}

#[test]
fn a_resend_is_answered_again_and_not_run_again() {
    let mut bench = Bench::connected();
    let engage = |confirmation| command(OWN, 31011, 1.0, confirmation);
    bench.hear_packet(STATION, &engage(0));
    bench.run(500);
    bench.hear_packet(STATION, &engage(1));
    bench.run(3_000);
    bench.hear_packet(STATION, &engage(2));
    bench.hear_packet(STATION, &engage(0));
    assert_eq!(acks(&mut bench), [(31011, 0); 4]);
    let engaged = Event::Operator(OperatorRequest::Enable(Enable::Engage));
    assert_eq!(bench.events().iter().filter(|&event| *event == engaged).count(), 1);
    // Something else in between makes it a new request; so does time.
    bench.hear_packet(STATION, &command(OWN, 31011, 0.0, 0));
    bench.hear_packet(STATION, &engage(0));
    bench.hear("heartbeat_copter_guided");
    bench.run(3_600);
    bench.hear_packet(STATION, &engage(0));
    assert_eq!(bench.events().iter().filter(|&event| *event == engaged).count(), 2);
    assert_eq!(acks(&mut bench).len(), 3);
    // A first transmission that was lost does not keep the second from counting.
    bench.hear_packet(STATION, &command(OWN, 31012, 0.0, 1));
    assert_eq!(bench.events(), [Event::Operator(OperatorRequest::ReturnNow)]);
}

#[test]
fn commands_for_others_are_left_alone() {
    let mut bench = Bench::connected();
    for target in [[42, 1], [43, 191], [43, 0], [42, 192]] {
        bench.hear_packet(STATION, &command(target, 31012, 0.0, 0));
    }
    bench.hear_packet(STATION, &command([42, 0], 400, 1.0, 0));
    assert_eq!(acks(&mut bench), []);
    assert_eq!(bench.events(), []);
    assert_eq!(bench.component.stats().for_others, 4);
}

#[test]
fn messages_are_sent_on_request() {
    let mut bench = Bench::connected();
    for id in [0, 148, 396] {
        bench.hear_packet(STATION, &request_message(id));
    }
    bench.run(50);
    let sent = bench.sent();
    for id in [0, 148, 396] {
        assert_eq!(sent.iter().filter(|frame| frame.message_id == id).count(), 1, "message {id}");
    }
    let information = sent.iter().find(|frame| frame.message_id == 396).unwrap();
    assert_eq!(information.payload()[16..23], *b"Gleaner");
    bench.hear_packet(STATION, &request_message(148));
    assert_eq!(bench.sent_with_id(148).len(), 1, "asked again, sent again");
}

#[test]
fn all_parameters_are_sent_in_small_portions() {
    let mut bench = Bench::connected();
    bench.hear("param_request_list");
    let mut told = Vec::new();
    for size in [3, 3, 3, 2] {
        bench.run(50);
        let portion = values(&bench.sent());
        assert_eq!(portion.len(), size);
        told.extend(portion);
    }
    let expected: Vec<(u16, f32)> = PARAMETERS.iter().map(|spec| (spec.id.index(), spec.default)).collect();
    assert_eq!(told, expected);
    bench.run(1_000);
    assert_eq!(values(&bench.sent()), []);
}

#[test]
fn one_parameter_is_sent_by_index_and_by_name() {
    let mut bench = Bench::connected();
    bench.hear("param_request_read_index");
    bench.run(50);
    assert_eq!(values(&bench.sent()), [(3, 10.0)]);
    bench.hear("param_request_read_name");
    bench.run(50);
    assert_eq!(values(&bench.sent()), [(5, 100.0)]);
}

#[test]
fn a_set_is_answered_with_the_value_in_force() {
    let mut bench = Bench::connected();
    let mut set = |name: &str, value: f32| {
        bench.hear_packet(STATION, &param_set(OWN, name, value));
        bench.run(200);
        let sent = bench.sent();
        (values(&sent), texts(&sent), bench.events())
    };
    let change = Event::Parameter(Change { id: ParameterId::Altitude, old: 60.0, new: 80.0 });
    let said = vec!["gleaner: GLN_ALT 80 by 255/190".into()];
    assert_eq!(set("GLN_ALT", 80.0), (vec![(2, 80.0)], said, vec![change]));
    for refused in [f32::NAN, f32::NEG_INFINITY, 19.9, 1e30] {
        let (told, said, events) = set("GLN_ALT", refused);
        assert_eq!((told, events), (vec![(2, 80.0)], vec![]));
        assert!(said[0].contains("GLN_ALT must be"), "{said:?}");
    }
    let (told, said, events) = set("GLN_ENABLE", 1.5);
    assert_eq!((told, events), (vec![(1, 0.0)], vec![]));
    assert_eq!(said.concat(), "gleaner: GLN_ENABLE must be a whole number, refused to 255/190");
    let (told, said, _) = set("NOT_OURS", 1.0);
    assert_eq!((told, said), (vec![], vec!["gleaner: no parameter NOT_OURS".into()]));
}

#[test]
fn long_texts_leave_in_at_most_ten_chunks_a_second() {
    let mut bench = Bench::connected();
    bench.run(1_000);
    bench.sent();
    let long = "x".repeat(100);
    for _ in 0..20 {
        bench.component.say(Severity::Info, format_args!("{long}"));
    }
    bench.component.say(Severity::Critical, format_args!("fault"));
    bench.run(1_000);
    let chunks = bench.sent_with_id(TEXT);
    assert!((9..=11).contains(&chunks.len()), "{} chunks in a second", chunks.len());
    let sequence: Vec<u8> =
        chunks.iter().take(3).map(|frame| frame.payload().get(53).copied().unwrap_or(0)).collect();
    assert_eq!(sequence, [0, 1, 2], "a full last chunk is followed by an empty one");
    bench.run(3_000);
    let sent = bench.sent();
    assert_eq!(texts(&sent).last().map(String::as_str), Some("fault"), "the severe one was kept");
    assert_eq!(bench.component.stats().texts_dropped, 13);
}

#[test]
fn the_heartbeat_depends_on_the_poll() {
    let mut bench = Bench::connected();
    let mut sent = 0;
    for _ in 0..100 {
        bench.run(50);
        sent += bench.sent_with_id(0).len();
    }
    assert_eq!(sent, 5);
    bench.run(3_000);
    assert_eq!(bench.sent_with_id(0).len(), 1, "a blocked wire does not collect them");
    bench.now_ms += 10_000;
    bench.hear("heartbeat_copter_guided");
    assert_eq!(bench.sent_with_id(0).len(), 0, "no poll, no heartbeat");
    bench.run(50);
    assert_eq!(bench.sent_with_id(0).len(), 1, "missed ones are not sent later");
}

#[test]
fn nothing_is_sent_before_the_system_is_known() {
    let mut bench = Bench::fresh();
    bench.run(4_900);
    assert_eq!(bench.sent(), []);
    bench.run(200);
    let sent = bench.sent();
    assert_eq!((sent[0].message_id, sent[0].sender), (0, Address::new(1, 191)));
    bench.hear("heartbeat_copter_guided");
    bench.run(3_100);
    assert_eq!(bench.component.address(), Address::new(42, 191), "adopted late");
}

#[test]
fn telemetry_never_costs_an_acknowledgement_or_a_setpoint() {
    let mut bench = Bench::connected();
    let now = bench.now();
    for step in 0..100u8 {
        bench.component.telemetry(now, "w_data", f32::from(step));
        bench.component.tunnel(TUNNEL_DECISION, &[step; 128]);
        let position = Ned { north_m: f32::from(step), east_m: 0.0, down_m: -60.0 };
        bench.component.steer(now, &PositionTarget::at(position)).unwrap();
    }
    bench.hear_packet(STATION, &command(OWN, 31012, 0.0, 0));
    let sent = bench.sent();
    let ids: Vec<u32> = sent.iter().map(|frame| frame.message_id).collect();
    assert_eq!(ids[..2], [84, ACK]);
    assert_eq!(sent[0].payload()[4..8], 99f32.to_le_bytes(), "only the newest target leaves");
    assert_eq!(ids.iter().filter(|&&id| id == 84).count(), 1);
    let stats = bench.component.stats().outgoing;
    assert_eq!((stats.bulk_dropped, stats.setpoints_replaced, stats.urgent_refused), (184, 99, 0));
    let sequence: Vec<u8> = sent.iter().map(|frame| frame.sequence.wrapping_sub(sent[0].sequence)).collect();
    assert_eq!(sequence, (0..sent.len() as u8).collect::<Vec<u8>>(), "what was dropped leaves no gap");
}

#[test]
fn a_flood_of_commands_is_postponed() {
    let mut bench = Bench::connected();
    for step in 0..200u8 {
        bench.hear_packet(STATION, &command(OWN, 31010, f32::from(step) / 255.0, 0));
    }
    let accepted = acks(&mut bench).len();
    let done = bench.events().len();
    assert_eq!(accepted, done, "every acknowledged command has its event");
    assert_eq!(bench.component.stats().commands_postponed as usize, 200 - accepted);
    assert_eq!(bench.component.stats().events_dropped, 0);
}

#[test]
fn a_flood_of_reports_leaves_room_for_the_operator() {
    let mut bench = Bench::connected();
    for _ in 0..100 {
        bench.hear("tunnel_radio_report");
    }
    bench.hear_packet(STATION, &command(OWN, 31012, 0.0, 0));
    let events = bench.events();
    let Some(Event::RadioReport(payload)) = events.first() else { panic!("{events:?}") };
    assert_eq!(payload[..2], [0xAC, 2]);
    assert_eq!(events.last(), Some(&Event::Operator(OperatorRequest::ReturnNow)));
}

#[test]
fn timesync_is_answered() {
    let mut bench = Bench::connected();
    bench.hear("timesync_request");
    let answer = &bench.sent_with_id(111)[0];
    let now_ns = bench.now().as_micros() as i64 * 1_000;
    assert_eq!(answer.payload()[..8], now_ns.to_le_bytes());
    assert_eq!(answer.payload()[8..16], 987_654_321_012i64.to_le_bytes());
    assert_eq!(answer.payload()[16..], [VEHICLE.system, VEHICLE.component]);
}

#[test]
fn numbers_that_are_not_finite_never_leave() {
    let mut bench = Bench::connected();
    let now = bench.now();
    for bad in [f32::NAN, f32::INFINITY] {
        for axis in 0..3 {
            let mut at = [0.0; 3];
            at[axis] = bad;
            let position = Ned { north_m: at[0], east_m: at[1], down_m: at[2] };
            assert_eq!(bench.component.steer(now, &PositionTarget::at(position)), Err(NotSent::NotFinite));
            let velocity = Some(Velocity { north_mps: at[0], east_mps: at[1], down_mps: at[2] });
            let target = PositionTarget { position: Ned::default(), velocity };
            assert_eq!(bench.component.steer(now, &target), Err(NotSent::NotFinite));
        }
        let speed = AutopilotCommand::ChangeSpeed(MetresPerSecond(bad));
        assert_eq!(bench.component.request(now, speed), Err(NotSent::NotFinite));
        bench.component.telemetry(now, "w_data", bad);
    }
    assert_eq!(bench.sent(), []);
}

#[test]
fn our_own_echo_is_ignored() {
    let mut bench = Bench::connected();
    bench.hear_packet(Address::new(42, 191), &command(OWN, 31012, 0.0, 0));
    assert_eq!(bench.events(), []);
    assert_eq!(bench.sent(), []);
    assert_eq!(frames(&golden("own_heartbeat"))[0].sender, bench.component.address());
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn every_command_to_us_gets_exactly_one_answer(
        commands in proptest::collection::vec((any::<u16>(), 31_010u16..31_015, any::<bool>(), any::<f32>(), any::<u8>()), 1..6)
    ) {
        let mut bench = Bench::connected();
        let ids: Vec<u16> = commands.iter().map(|&(wild, user, is_user, _, _)| if is_user { user } else { wild }).collect();
        for (id, (_, _, _, first, confirmation)) in ids.iter().zip(&commands) {
            bench.hear_packet(STATION, &command(OWN, *id, *first, *confirmation));
        }
        let answered: Vec<u16> = acks(&mut bench).into_iter().map(|(id, _)| id).collect();
        prop_assert_eq!(answered, ids);
    }
}
