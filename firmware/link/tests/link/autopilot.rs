//! State of the autopilot, and our requests to it.

use crate::station::{Bench, STATION, VEHICLE, golden};
use gleaner_link::*;
use gleaner_units::{Duration, MetresPerSecond, Ned};

const COMMAND: u32 = 76;
const SECOND: Duration = Duration::from_secs(1);

pub fn heartbeat(custom_mode: u32, armed: bool, state: u8) -> Packet {
    let mode = custom_mode.to_le_bytes();
    let base = if armed { 0xD9 } else { 0x59 };
    Packet::from_payload(0, 50, &[mode[0], mode[1], mode[2], mode[3], 2, 3, base, state, 3]).unwrap()
}

fn position(time_boot_ms: u32) -> Packet {
    let mut payload = time_boot_ms.to_le_bytes().to_vec();
    payload.resize(28, 0);
    Packet::from_payload(32, 185, &payload).unwrap()
}

pub fn ack(command: u16, result: u8) -> Packet {
    let [low, high] = command.to_le_bytes();
    Packet::from_payload(77, 143, &[low, high, result, 0, 0, 0, 0, 0, 42, 191]).unwrap()
}

/// Commands sent: id, first and second parameter, confirmation.
pub fn commands(bench: &mut Bench) -> Vec<(u16, f32, f32, u8)> {
    let read = |frame: Frame| {
        let mut payload = frame.payload().to_vec();
        payload.resize(33, 0);
        let float = |at: usize| f32::from_le_bytes(payload[at..at + 4].try_into().unwrap());
        assert_eq!(payload[30..32], [VEHICLE.system, VEHICLE.component]);
        (u16::from_le_bytes([payload[28], payload[29]]), float(0), float(4), payload[32])
    };
    bench.sent_with_id(COMMAND).into_iter().map(read).collect()
}

/// Simulates an autopilot that sends a heartbeat a second and answers every command with `result`. Returns the
/// commands.
fn ask_and_answer(bench: &mut Bench, seconds: u64, result: u8) -> Vec<(u16, f32, f32, u8)> {
    let mut asked = Vec::new();
    for step in 0..seconds * 20 {
        if step % 20 == 0 {
            bench.hear("heartbeat_copter_guided");
        }
        bench.run(50);
        for command in commands(bench) {
            bench.hear_packet(VEHICLE, &ack(command.0, result));
            asked.push(command);
        }
    }
    asked
}

#[test]
fn connection_mode_arming_and_loss_are_events() {
    let mut bench = Bench::fresh();
    for _ in 0..5 {
        bench.hear("heartbeat_copter_guided");
        bench.run(1_000);
    }
    let first =
        [Event::AutopilotConnected, Event::ModeChanged(FlightMode::Guided), Event::ArmedChanged(true)];
    assert_eq!(bench.events(), first);
    bench.hear_packet(VEHICLE, &heartbeat(5, true, 4));
    assert_eq!(bench.events(), [Event::ModeChanged(FlightMode::Hold)]);
    assert!(!bench.component.autopilot().companion_may_steer());
    bench.hear_packet(VEHICLE, &heartbeat(5, false, 3));
    assert_eq!(bench.events(), [Event::ArmedChanged(false)]);
    bench.run(5_000);
    assert_eq!(bench.events(), [], "five seconds are not over");
    bench.run(50);
    assert_eq!(bench.events(), [Event::AutopilotLost]);
    assert_eq!(bench.component.autopilot().mode(), None);
    let steer = PositionTarget::at(Ned::default());
    let now = bench.now();
    assert_eq!(bench.component.steer(now, &steer), Err(NotSent::NoAutopilot));
    assert_eq!(bench.component.request(now, AutopilotCommand::Land), Err(NotSent::NoAutopilot));
    bench.hear("heartbeat_copter_guided");
    assert_eq!(bench.events(), first);
}

#[test]
fn other_components_are_not_the_autopilot() {
    let mut bench = Bench::connected();
    for other in [Address::new(42, 2), Address::new(43, 1), STATION, Address::new(42, 191)] {
        bench.hear_packet(other, &heartbeat(5, false, 5));
        bench.hear_packet(other, &position(1_000));
    }
    bench.hear("heartbeat_station");
    assert_eq!(bench.events(), []);
    assert!(bench.component.autopilot().companion_may_steer());
    assert_eq!(bench.component.autopilot().position(bench.now(), SECOND), None);
}

#[test]
fn failsafes_begin_once_and_come_from_both_messages() {
    let mut bench = Bench::connected();
    bench.hear_packet(VEHICLE, &heartbeat(4, true, 5));
    bench.hear_packet(VEHICLE, &heartbeat(4, true, 5));
    assert_eq!(bench.events(), [Event::FailsafeBegan(Failsafe::System)]);
    bench.hear("battery_status");
    bench.hear("battery_status");
    assert_eq!(bench.events(), [Event::FailsafeBegan(Failsafe::Battery)]);
    bench.hear("heartbeat_copter_guided");
    assert_eq!(
        bench.component.autopilot().failsafe(),
        Some(Failsafe::Battery),
        "the battery's is still there"
    );
    assert_eq!(bench.component.autopilot().battery_percent(bench.now(), SECOND), Some(90));
}

#[test]
fn ready_needs_estimator_origin_and_a_fresh_position() {
    let mut bench = Bench::connected();
    for (name, ready) in [
        ("sys_status", false),
        ("local_position_ned", false),
        ("gps_global_origin", false),
        ("ekf_status_report", true),
    ] {
        bench.hear(name);
        assert_eq!(bench.component.autopilot().is_ready(bench.now()), ready, "after {name}");
    }
    bench.run(1_050);
    assert!(!bench.component.autopilot().is_ready(bench.now()), "the position is too old");
    bench.hear("local_position_ned_nan");
    assert!(!bench.component.autopilot().is_ready(bench.now()));
    assert_eq!(bench.component.stats().bad_coordinates, 1);
    assert_eq!(bench.component.autopilot().rc_pulse_us(bench.now(), 5), None);
    bench.hear("rc_channels");
    assert_eq!(bench.component.autopilot().rc_pulse_us(bench.now(), 5), Some(1800));
}

#[test]
fn every_stream_is_requested_until_it_arrives() {
    let mut bench = Bench::connected();
    let asked = ask_and_answer(&mut bench, 6, 0);
    let streams: Vec<(f32, f32)> =
        asked.iter().filter(|ask| ask.0 == 511).map(|ask| (ask.1, ask.2)).collect();
    for (id, interval_us) in [
        (32, 100_000),
        (245, 500_000),
        (193, 500_000),
        (147, 500_000),
        (1, 500_000),
        (242, 1_000_000),
        (33, 500_000),
        (85, 83_333),
    ] {
        assert!(streams.contains(&(id as f32, interval_us as f32)), "message {id} not in {streams:?}");
    }
    assert!(!streams.iter().any(|&(id, _)| id == 65.0), "no RC channel is mapped");
    assert!(asked.iter().any(|ask| (ask.0, ask.1) == (512, 49.0)), "the origin is asked for");
    assert!(
        !streams.iter().any(|&(id, _)| id == 230.0),
        "PX4's estimator report is not requested from ArduPilot"
    );
    // None came: asked for again. One comes: asked for no more.
    let mut positions = 0;
    for second in 0..20 {
        for _ in 0..4 {
            bench.hear_packet(VEHICLE, &position(200_000 + second * 1_000));
        }
        let again = ask_and_answer(&mut bench, 1, 0);
        positions += again.iter().filter(|ask| (ask.0, ask.1) == (511, 32.0)).count();
    }
    assert_eq!(positions, 0);
    assert!(
        ask_and_answer(&mut bench, 10, 0).iter().any(|ask| (ask.0, ask.1) == (511, 32.0)),
        "it stopped coming"
    );
}

#[test]
fn a_silent_or_unwilling_autopilot_is_not_flooded() {
    for result in [3, 255] {
        let mut bench = Bench::connected();
        let mut asked = Vec::new();
        for _ in 0..30 {
            bench.hear("heartbeat_copter_guided");
            bench.run(1_000);
            let now = commands(&mut bench);
            if result != 255 {
                now.iter().for_each(|ask| bench.hear_packet(VEHICLE, &ack(ask.0, result)));
            }
            asked.extend(now);
        }
        assert!(asked.len() <= 40, "{} askings in 30 s", asked.len());
        let kinds: std::collections::BTreeSet<u32> = asked.iter().map(|ask| ask.1 as u32).collect();
        assert_eq!(kinds.len(), 9, "each of eight streams and the origin had its turn: {kinds:?}");
    }
}

#[test]
fn after_a_reboot_everything_is_requested_again() {
    let mut bench = Bench::connected();
    bench.hear("gps_global_origin");
    bench.hear_packet(VEHICLE, &position(500_000));
    ask_and_answer(&mut bench, 3, 0);
    bench.events();
    bench.hear_packet(VEHICLE, &position(499_500));
    assert_eq!(bench.events(), [], "out of order by half a second");
    bench.hear_packet(VEHICLE, &position(1_200));
    assert_eq!(bench.events(), [Event::AutopilotRebooted]);
    assert_eq!(bench.component.autopilot().origin(), None);
    let asked = ask_and_answer(&mut bench, 1, 0);
    assert!(asked.iter().any(|ask| (ask.0, ask.1) == (511, 32.0)));
    assert!(asked.iter().any(|ask| (ask.0, ask.1) == (512, 49.0)));
}

#[test]
fn a_wrapped_clock_is_no_reboot() {
    let mut bench = Bench::connected();
    bench.hear_packet(VEHICLE, &position(u32::MAX - 10));
    bench.hear_packet(VEHICLE, &position(90));
    assert_eq!(bench.events(), []);
}

#[test]
fn a_request_is_sent_three_times_and_then_given_up() {
    let mut bench = Bench::connected();
    ask_and_answer(&mut bench, 5, 0);
    let now = bench.now();
    bench.component.request(now, AutopilotCommand::Land).unwrap();
    let mut confirmations = Vec::new();
    for _ in 0..5 {
        bench.hear("heartbeat_copter_guided");
        bench.run(1_000);
        confirmations.extend(commands(&mut bench).iter().filter(|ask| ask.0 == 21).map(|ask| ask.3));
    }
    assert_eq!(confirmations, [0, 1, 2]);
    let ended = Event::RequestEnded { command: AutopilotCommand::Land, outcome: Outcome::NoAnswer };
    assert_eq!(bench.events(), [ended]);
}

#[test]
fn a_request_ends_with_its_acknowledgement() {
    let mut bench = Bench::connected();
    let ask = |bench: &mut Bench, command| {
        let now = bench.now();
        bench.component.request(now, command).unwrap();
        bench.run(100);
    };
    ask(&mut bench, AutopilotCommand::ReturnToLaunch);
    bench.hear("command_ack_from_autopilot");
    assert_eq!(bench.events(), [], "that was the answer to another command");
    bench.hear_packet(STATION, &ack(20, 0));
    assert_eq!(bench.events(), [], "that was not the autopilot");
    bench.hear_packet(VEHICLE, &ack(20, 4));
    let command = AutopilotCommand::ReturnToLaunch;
    let outcome = Outcome::Refused(CommandResult::Failed);
    assert_eq!(bench.events(), [Event::RequestEnded { command, outcome }]);
    let slow = AutopilotCommand::ChangeSpeed(MetresPerSecond(4.0));
    let fast = AutopilotCommand::ChangeSpeed(MetresPerSecond(9.0));
    ask(&mut bench, slow);
    ask(&mut bench, fast);
    bench.hear_packet(VEHICLE, &ack(178, 0));
    let superseded = Event::RequestEnded { command: slow, outcome: Outcome::Superseded };
    assert_eq!(
        bench.events(),
        [superseded, Event::RequestEnded { command: fast, outcome: Outcome::Accepted }]
    );
    assert!(!golden("own_land").is_empty());
}
