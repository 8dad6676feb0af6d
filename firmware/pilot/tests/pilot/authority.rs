//! Nothing that moves the aircraft leaves without newer evidence that the aircraft is ours.

use crate::rig::Rig;
use gleaner_link::{AutopilotCommand, Firmware, FlightMode};
use gleaner_pilot::{Fault, OnStop, Request, State, TakeOver};
use gleaner_units::{Duration, Instant, Ned};

const RETURN: AutopilotCommand = AutopilotCommand::ReturnToLaunch;

/// In flight, with the downlink cut and the position lost.
fn downlink_cut() -> Rig {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.beats = false;
    rig.vehicle.position = None;
    rig.run(2.5);
    assert_eq!(rig.machine.fault(), Some(Fault::PositionLost));
    rig
}

#[test]
fn a_return_needs_a_heartbeat_after_the_fault() {
    let mut rig = downlink_cut();
    rig.run(2.0);
    assert_eq!(rig.commanded(RETURN), 0, "GUIDED of three seconds ago is no evidence");
    rig.beats = true;
    rig.run(0.1);
    assert_eq!(rig.commanded(RETURN), 1);
}

#[test]
fn a_return_that_waited_for_a_position_needs_a_new_heartbeat() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    let position = rig.vehicle.position.take();
    rig.vehicle.mode = None;
    rig.run(10.0);
    // One heartbeat, and no position: whether the aircraft was moved meanwhile is unknown.
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.step();
    rig.beats = false;
    rig.run(1.6);
    rig.vehicle.position = position;
    rig.run(3.0);
    assert_eq!(rig.commanded(RETURN), 0, "the heartbeat is older than EVIDENCE_AGE");
    rig.beats = true;
    rig.run(0.1);
    assert_eq!(rig.commanded(RETURN), 1);
}

#[test]
fn a_pilot_who_took_over_behind_a_cut_downlink_is_left_alone() {
    let mut rig = downlink_cut();
    rig.run(2.0);
    rig.beats = true;
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.run(1.0);
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.run(30.0);
    assert_eq!(rig.commanded(RETURN), 0);
}

#[test]
fn each_attempt_to_return_needs_a_newer_heartbeat() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.accepts = Some(false);
    rig.vehicle.position = None;
    rig.run(1.1);
    assert_eq!(rig.commanded(RETURN), 1);
    rig.beats = false;
    rig.run(30.0);
    assert_eq!(rig.commanded(RETURN), 1, "silence since the last attempt");
}

#[test]
fn heartbeats_that_waited_through_a_stall_are_no_evidence() {
    for takes_over in [true, false] {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        // The first turn after the stall reads old GUIDED heartbeats, the next ones the rest of the queue.
        rig.step_after(Duration::from_millis(3_500));
        assert_eq!(rig.machine.fault(), Some(Fault::Late));
        for _ in 0..6 {
            rig.vehicle.heartbeat_at = None;
            rig.step();
        }
        assert_eq!(rig.commanded(RETURN), 0, "the queue is still being read");
        if takes_over {
            rig.vehicle.mode = Some(FlightMode::Hold);
        }
        rig.run(3.0);
        assert_eq!(rig.commanded(RETURN), usize::from(!takes_over));
    }
}

#[test]
fn a_clock_that_goes_back_is_a_stall() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.now = Instant::from_millis(3_000);
    rig.step();
    assert_eq!(rig.machine.fault(), Some(Fault::Late));
}

#[test]
fn after_a_stall_a_waiting_request_engages_only_on_fresh_heartbeats() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.request = Some(Request::Engage);
    rig.run(2.0);
    let streamed = rig.setpoints.len();
    assert!(streamed > 0);
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.step_after(Duration::from_secs(3));
    rig.run(0.4);
    assert_eq!((rig.state(), rig.setpoints.len()), (State::Waiting, streamed), "no stream on old heartbeats");
    rig.run(2.0);
    assert_eq!(rig.state(), State::Engaged);
}

#[test]
fn a_request_engages_only_on_a_heartbeat_after_it() {
    let mut rig = Rig::new();
    rig.run(1.0);
    rig.beats = false;
    rig.request = Some(Request::Engage);
    rig.run(4.0);
    assert_eq!(rig.state(), State::Waiting);
    assert_eq!(rig.said("no heartbeat since the request"), 1);
    rig.beats = true;
    rig.run(0.1);
    assert_eq!(rig.state(), State::Engaged);
}

#[test]
fn no_new_target_is_decided_without_heartbeats() {
    let mut rig = Rig::engaged();
    rig.run(0.5);
    rig.beats = false;
    let decided = rig.actions.len();
    rig.run(4.8);
    assert!(rig.actions.len() <= decided + 1, "one slot may end within the age of a heartbeat");
}

#[test]
fn a_target_that_is_not_ours_is_a_take_over() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.foreign_target = true;
    let out = rig.step();
    assert_eq!((rig.state(), rig.machine.take_over()), (State::Passive, Some(TakeOver::Target)));
    assert!(out.withdraw && out.setpoint.is_none() && out.command.is_none());
    rig.run(10.0);
    assert_eq!(rig.state(), State::Passive);
}

/// Moves the aircraft north at 8 m/s, whatever its target.
fn carry(rig: &mut Rig, secs: usize) {
    rig.obeys = false;
    for _ in 0..secs * 20 {
        if let Some(position) = &mut rig.vehicle.position {
            position.north_m += 0.4;
        }
        rig.step();
    }
}

#[test]
fn an_aircraft_away_from_its_leg_was_moved_by_another() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    carry(&mut rig, 4);
    assert_eq!(rig.state(), State::Engaged, "a gust");
    carry(&mut rig, 3);
    assert_eq!((rig.state(), rig.machine.take_over()), (State::Passive, Some(TakeOver::Place)));
    assert_eq!(rig.said("moved by another"), 1);
}

#[test]
fn an_aircraft_flown_away_in_guided_after_a_fault_is_not_called_back() {
    for by_target in [true, false] {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        rig.accepts = Some(false);
        rig.step_after(Duration::from_millis(1_500));
        rig.run(3.0);
        let before = rig.commanded(RETURN);
        assert!(before > 0);
        if by_target {
            rig.foreign_target = true;
        } else {
            carry(&mut rig, 8);
        }
        let settled = rig.commanded(RETURN);
        rig.run(60.0);
        assert_eq!(rig.commanded(RETURN), settled.max(before), "{by_target}");
        assert_eq!(rig.said("moved by another"), 1);
    }
}

#[test]
fn a_request_expires() {
    let mut rig = Rig::new();
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.request = Some(Request::Engage);
    rig.run(59.0);
    assert_eq!(rig.state(), State::Waiting);
    rig.run(2.0);
    assert_eq!((rig.state(), rig.said("request expired")), (State::Idle, 1));
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.run(30.0);
    assert_eq!(rig.state(), State::Idle);
}

#[test]
fn a_failsafe_ends_a_request_and_its_stream() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.request = Some(Request::Engage);
    rig.run(2.0);
    rig.vehicle.failsafe = true;
    let streamed = rig.setpoints.len();
    rig.step();
    assert_eq!((rig.state(), rig.said("request ended")), (State::Idle, 1));
    rig.request = Some(Request::Engage);
    rig.run(5.0);
    assert_eq!((rig.state(), rig.said("refused, autopilot failsafe")), (State::Idle, 1));
    assert_eq!(rig.setpoints.len(), streamed, "resumed targets would clear the failsafe");
}

#[test]
fn no_target_goes_to_px4_while_a_failsafe_is_set() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.engage();
    rig.run(3.0);
    rig.vehicle.failsafe = true;
    let streamed = rig.setpoints.len();
    rig.run(3.0);
    assert_eq!((rig.machine.fault(), rig.setpoints.len()), (Some(Fault::Failsafe), streamed));
    assert_eq!(rig.commanded(RETURN), 1);
}

#[test]
fn a_start_over_an_armed_vehicle_is_reported_and_engages_nothing() {
    let mut rig = Rig::new();
    rig.run(10.0);
    assert_eq!((rig.state(), rig.said("started over an armed vehicle")), (State::Idle, 1));
    let mut grounded = Rig::new();
    grounded.vehicle.armed = false;
    grounded.run(2.0);
    grounded.vehicle.armed = true;
    grounded.run(2.0);
    assert_eq!(grounded.said("started over"), 0);
}

#[test]
fn a_program_that_ends_in_flight_hands_the_aircraft_back() {
    let mut rig = Rig::engaged();
    rig.run(1.5);
    rig.request = Some(Request::HandBack);
    rig.step();
    assert_eq!(rig.machine.fault(), Some(Fault::Stopped));
    assert!(rig.machine.is_handing_back());
    rig.run(1.2);
    assert_eq!(rig.commanded(RETURN), 1);
    assert!(!rig.machine.is_handing_back());
    let mut idle = Rig::new();
    idle.request = Some(Request::HandBack);
    idle.run(2.0);
    assert_eq!((idle.state(), idle.commands.len()), (State::Idle, 0));
}

#[test]
fn a_program_that_ends_may_request_to_hold_instead() {
    for firmware in [Firmware::ArduPilot, Firmware::Px4] {
        let mut rig = Rig::engaged();
        rig.vehicle.firmware = Some(firmware);
        rig.rules.on_stop = OnStop::Hold;
        rig.run(1.5);
        rig.request = Some(Request::HandBack);
        rig.run(1.2);
        assert_eq!((rig.commanded(RETURN), rig.commanded(AutopilotCommand::Hold(firmware))), (0, 1));
        assert!(!rig.machine.is_handing_back(), "{firmware:?}");
    }
    let mut other_fault = Rig::engaged();
    other_fault.rules.on_stop = OnStop::Hold;
    other_fault.vehicle.position = None;
    other_fault.run(4.0);
    assert_eq!(other_fault.commanded(RETURN), 1, "every other fault returns");
}

#[test]
fn texts_come_in_the_order_of_events() {
    let mut rig = Rig::new();
    rig.vehicle.armed = false;
    rig.run(1.0);
    rig.request = Some(Request::Engage);
    rig.run(1.0);
    let at = |text: &str| rig.texts.iter().position(|line| line.contains(text));
    assert!(at("engage requested") < at("waiting: not armed") && at("engage requested").is_some());
}

#[test]
fn nothing_under_way_survives_the_end_of_a_flight() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    // A command and the reason to withdraw it in one poll.
    rig.set("GLN_SPEED", 4.0);
    rig.run(0.2);
    rig.request = Some(Request::Off);
    rig.vehicle.heartbeat_at = None;
    let out = rig.step();
    assert!(out.withdraw && out.command.is_none());
    rig.vehicle.position = Some(Ned::default());
    rig.run(5.0);
    assert!(!rig.commands.iter().any(|(at_ms, _)| *at_ms >= rig.now.as_millis() - 5_000));
}
