//! Packets of pymavlink are read; ours are compared with pymavlink byte by byte.

use crate::station::{Bench, STATION, VEHICLE, frames, golden, message};
use gleaner_link::*;
use gleaner_units::{GeoPoint, Metres, MetresPerSecond, Ned};

#[test]
fn headers_of_both_versions_and_of_signed_frames_are_read() {
    let frame = &frames(&golden("local_position_ned"))[0];
    assert_eq!((frame.sender, frame.sequence, frame.message_id), (VEHICLE, 7, 32));
    assert_eq!((frame.version, frame.signature), (WireVersion::V2, None));
    let old = &frames(&golden("v1_local_position_ned"))[0];
    assert_eq!((old.version, Message::decode(old)), (WireVersion::V1, Message::decode(frame)));
    let signed = &frames(&golden("signed_heartbeat"))[0];
    assert!(signed.signature.is_some());
    assert_eq!(Message::decode(signed).unwrap(), message("heartbeat_copter_guided"));
}

#[test]
fn heartbeats_of_all_senders_are_read() {
    let copter = Heartbeat {
        autopilot: 3,
        vehicle: 2,
        armed: true,
        base_mode: 0xD9,
        custom_mode: 4,
        state: SystemState::Active,
    };
    assert_eq!(message("heartbeat_copter_guided"), Some(Message::Heartbeat(copter)));
    let Some(Message::Heartbeat(px4)) = message("heartbeat_px4_offboard") else { panic!() };
    assert_eq!((px4.custom_mode, px4.state), (0x0006_0000, SystemState::Critical));
    let Some(Message::Heartbeat(future)) = message("heartbeat_of_the_future") else { panic!() };
    assert_eq!((future.autopilot, future.vehicle, future.armed), (99, 200, false));
}

#[test]
fn vehicle_state_is_read_in_our_units() {
    let position = LocalPosition {
        time_boot_ms: 123_456,
        position: Ned { north_m: 12.5, east_m: -34.25, down_m: -60.0 },
        velocity: Velocity { north_mps: 1.5, east_mps: -2.5, down_mps: 0.25 },
    };
    assert_eq!(message("local_position_ned"), Some(Message::LocalPosition(position)));
    let point = GeoPoint { lat_deg_e7: 473_977_418, lon_deg_e7: 85_455_938 };
    let global = GlobalPosition {
        time_boot_ms: 123_456,
        point,
        altitude_amsl_mm: 548_030,
        altitude_above_home: Metres(60.010_002),
    };
    assert_eq!(message("global_position_int"), Some(Message::GlobalPosition(global)));
    let local = Some(Ned { north_m: 1.0, east_m: 2.0, down_m: -0.5 });
    let home = HomePosition { point, altitude_amsl_mm: 488_030, local };
    assert_eq!(message("home_position"), Some(Message::HomePosition(home)));
    let home = HomePosition { local: None, ..home };
    assert_eq!(message("home_position_no_local"), Some(Message::HomePosition(home)));
    let point = GeoPoint { lon_deg_e7: -85_455_938, ..point };
    let origin = GlobalOrigin { point, altitude_amsl_mm: 488_000 };
    assert_eq!(message("gps_global_origin"), Some(Message::GlobalOrigin(origin)));
    assert_eq!(message("ekf_status_report"), Some(Message::EkfStatus(831)));
    assert_eq!(message("estimator_status"), Some(Message::EstimatorStatus(831)));
    assert_eq!(message("extended_sys_state"), Some(Message::LandedState(LandedState::InAir)));
}

#[test]
fn unknown_battery_values_are_absent() {
    let Some(Message::SysStatus(status)) = message("sys_status") else { panic!() };
    assert_eq!(status.battery_remaining_percent, Some(87));
    assert_eq!((status.sensors_enabled, status.sensors_healthy), (0x5320_D12F, 0x5761_FD2F));
    let low = BatteryStatus {
        id: 0,
        remaining_percent: Some(90),
        charge: ChargeState::Low,
        consumed_mah: Some(323),
        current_ca: Some(2811),
    };
    assert_eq!(message("battery_status"), Some(Message::BatteryStatus(low)));
    let unknown = BatteryStatus {
        id: 1,
        remaining_percent: None,
        charge: ChargeState::Unknown,
        consumed_mah: None,
        current_ca: None,
    };
    assert_eq!(message("battery_status_unknown"), Some(Message::BatteryStatus(unknown)));
}

#[test]
fn missing_rc_channels_are_absent() {
    let Some(Message::RcChannels(rc)) = message("rc_channels") else { panic!() };
    let pulses: Vec<Option<u16>> = (0..=19).map(|channel| rc.pulse_us(channel)).collect();
    assert_eq!(pulses[..8], [None, Some(1500), Some(1501), Some(1000), Some(1503), Some(1800), None, None]);
    assert_eq!(pulses[8..17], [Some(1507); 9]);
    assert_eq!(pulses[17..], [None, None, None]);
}

#[test]
fn commands_of_both_forms_and_unknown_ones_are_read() {
    let command = Command {
        sender: STATION,
        target: Address::new(42, 191),
        id: 31010,
        params: [0.75, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        confirmation: 0,
        form: CommandForm::Long,
    };
    assert_eq!(message("command_user_1"), Some(Message::Command(command)));
    let Some(Message::Command(resent)) = message("command_user_2_resent") else { panic!() };
    assert_eq!((resent.target, resent.id, resent.confirmation), (Address::new(42, 0), 31011, 2));
    let Some(Message::Command(unknown)) = message("command_unknown_to_the_dialect") else { panic!() };
    assert_eq!(unknown.id, 54321);
    let Some(Message::Command(int)) = message("command_int_user_3") else { panic!() };
    assert_eq!(int.params, [1.5, 2.5, 3.5, 4.5, -7.0, 8.0, 9.5]);
    assert_eq!((int.form, int.id), (CommandForm::Int, 31012));
    let ack = CommandAck { command: 21, result: CommandResult::Accepted, target: Address::new(42, 191) };
    assert_eq!(message("command_ack_from_autopilot"), Some(Message::CommandAck(ack)));
    let old = Message::decode(&frames(&golden("v1_command_ack"))[0]).unwrap();
    let ack = CommandAck { command: 21, result: CommandResult::Failed, target: Address::ALL };
    assert_eq!(old, Some(Message::CommandAck(ack)));
}

#[test]
fn messages_with_a_receiver_are_read() {
    let target = Address::new(42, 191);
    assert_eq!(message("param_request_list"), Some(Message::ParameterList { target }));
    let key = ParameterKey::Index(3);
    assert_eq!(message("param_request_read_index"), Some(Message::ParameterRead { target, key }));
    let key = ParameterKey::Name("GLN_BAT_UNITS".try_into().unwrap());
    assert_eq!(message("param_request_read_name"), Some(Message::ParameterRead { target, key }));
    let set =
        |name: &str, value| Message::ParameterSet { target, name: name.try_into().unwrap(), value, kind: 9 };
    assert_eq!(message("param_set"), Some(set("GLN_ALT", 75.5)));
    assert_eq!(message("param_set_16_characters"), Some(set("ABCDEFGHIJKLMNOP", 1.0)));
    let Some(Message::StatusText { severity, text }) = message("statustext") else { panic!() };
    assert_eq!((severity, &text[..]), (4, &b"Battery 1 is low 10.30V used 323 mAh"[..]));
    let request = Message::TimesyncRequest { target: Address::ALL, asked_ns: 987_654_321_012 };
    assert_eq!(message("timesync_request"), Some(request));
    assert_eq!(message("timesync_answer"), None);
    let Some(Message::Tunnel { payload_type, payload, .. }) = message("tunnel_radio_report") else {
        panic!()
    };
    assert_eq!((payload_type, payload.len(), payload[12]), (TUNNEL_RADIO_REPORT, 13, 1));
    assert_eq!(message("attitude_not_needed"), None);
}

#[test]
fn impossible_coordinates_are_refused() {
    let refused = |name: &str| Message::decode(&frames(&golden(name))[0]).unwrap_err();
    assert_eq!(refused("local_position_ned_nan"), MessageFault::NotFinite);
    assert_eq!(refused("local_position_ned_inf"), MessageFault::NotFinite);
    assert_eq!(refused("global_position_int_off"), MessageFault::NotOnTheGlobe);
}

/// Runs `act` and expects this packet among those sent; sequence number and checksum may differ.
fn sends(name: &str, act: impl FnOnce(&mut Bench)) {
    let mut bench = Bench::connected();
    act(&mut bench);
    let expected = &frames(&golden(name))[0];
    let sent = bench.sent();
    let same = |frame: &&Frame| {
        frame.sender == expected.sender
            && frame.message_id == expected.message_id
            && frame.payload() == expected.payload()
    };
    assert!(sent.iter().any(|frame| same(&frame)), "{name}: expected {expected:?} among {sent:?}");
}

#[test]
fn our_packets_are_those_of_pymavlink() {
    let position = Ned { north_m: 12.5, east_m: -34.25, down_m: -60.0 };
    let velocity = Velocity { north_mps: 1.5, east_mps: -2.5, down_mps: 0.25 };
    let at = gleaner_units::Instant::from_millis(2_000);
    sends("own_heartbeat", |bench| bench.run(1_000));
    sends("own_position_target", |bench| {
        bench.component.steer(at, &PositionTarget::at(position)).unwrap();
    });
    sends("own_position_velocity_target", |bench| {
        let target = PositionTarget { position, velocity: Some(velocity) };
        bench.component.steer(at, &target).unwrap();
    });
    let request = |command| {
        move |bench: &mut Bench| {
            let now = bench.now();
            bench.component.request(now, command).unwrap();
            bench.run(500);
            bench.hear("heartbeat_copter_guided");
            bench.run(1_000);
        }
    };
    sends("own_land", request(AutopilotCommand::Land));
    sends("own_return_resent", request(AutopilotCommand::ReturnToLaunch));
    sends("own_hold_copter", request(AutopilotCommand::Hold(Firmware::ArduPilot)));
    sends("own_hold_px4", request(AutopilotCommand::Hold(Firmware::Px4)));
    sends("own_change_speed", request(AutopilotCommand::ChangeSpeed(MetresPerSecond(12.5))));
    sends("own_ack_accepted", |bench| bench.hear("command_user_1"));
    sends("own_ack_denied", |bench| bench.hear("command_user_1_nan"));
    sends("own_ack_unsupported", |bench| bench.hear("command_unknown_to_the_dialect"));
    let poll = |name: &'static str| {
        move |bench: &mut Bench| {
            bench.hear(name);
            bench.run(150);
        }
    };
    sends("own_param_value_alt", poll("param_set"));
    sends("own_param_value_reserve", poll("param_request_list"));
    sends("own_named_value", |bench| bench.component.telemetry(at, "spare_bat", 37.5));
    sends("own_tunnel_decision", |bench| bench.component.tunnel(TUNNEL_DECISION, &[1, 0, 3, 0, 0]));
    sends("own_text", |bench| {
        bench.component.say(Severity::Info, format_args!("engaged"));
        bench.run(100);
    });
    for chunk in ["own_text_chunk_0", "own_text_chunk_1"] {
        sends(chunk, |bench| {
            let digits = "0123456789".repeat(5);
            bench.component.say(Severity::Warning, format_args!("{digits}the end"));
            bench.run(200);
        });
    }
    sends("own_autopilot_version", |bench| {
        bench.hear_packet(STATION, &crate::conversation::request_message(148))
    });
}

#[test]
fn a_whole_frame_is_that_of_pymavlink() {
    let mut outgoing = Outgoing::new();
    let expected = golden("own_heartbeat");
    let heartbeat = Packet::from_payload(0, 50, &expected[10..expected.len() - 2]).unwrap();
    outgoing.push(Priority::Heartbeat, heartbeat);
    let mut bytes = [0; 64];
    let count = outgoing.transmit(Address::new(42, 191), &mut bytes);
    assert_eq!(bytes[..count], expected);
}
