//! The human pilot and the operator come first.

use crate::rig::{Rig, TERMINAL};
use gleaner_link::{AutopilotCommand, FlightMode};
use gleaner_pilot::{Request, State};

#[test]
fn another_mode_means_silence_until_a_new_request() {
    for mode in [FlightMode::Hold, FlightMode::Return, FlightMode::Land, FlightMode::Other(0)] {
        for prepare in [|rig: &mut Rig| rig.run(0.0), |rig: &mut Rig| rig.request = Some(Request::Return)] {
            let mut rig = Rig::engaged();
            prepare(&mut rig);
            rig.run(1.0);
            assert!(matches!(rig.state(), State::Engaged | State::Homing));
            rig.vehicle.mode = Some(mode);
            let out = rig.step();
            assert_eq!(rig.state(), State::Passive, "{mode:?}");
            assert!(out.withdraw && out.setpoint.is_none() && out.command.is_none());
            let silent_from = (rig.setpoints.len(), rig.commands.len());
            rig.run(2.0);
            rig.vehicle.mode = Some(FlightMode::Guided);
            rig.run(60.0);
            assert_eq!(rig.state(), State::Passive, "GUIDED alone engages nothing");
            assert_eq!((rig.setpoints.len(), rig.commands.len()), silent_from);
            rig.engage();
        }
    }
}

#[test]
fn a_take_over_between_two_polls_is_seen() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.other_mode_seen = true;
    let out = rig.step();
    assert_eq!(rig.state(), State::Passive);
    assert!(out.withdraw && out.setpoint.is_none());
}

#[test]
fn a_take_over_while_waiting_ends_the_request() {
    let wait = |mode| {
        let mut rig = Rig::new();
        rig.vehicle.mode = Some(mode);
        rig.set("GLN_ALT", 80.0);
        rig.request = Some(Request::Engage);
        rig.run(2.0);
        assert_eq!(rig.state(), State::Waiting);
        rig
    };
    let mut left = wait(FlightMode::Guided);
    left.vehicle.mode = Some(FlightMode::Hold);
    left.step();
    assert_eq!(left.state(), State::Passive, "GUIDED was left");
    let mut failsafe = wait(FlightMode::Hold);
    failsafe.vehicle.mode = Some(FlightMode::Return);
    failsafe.step();
    assert_eq!(failsafe.state(), State::Passive, "the autopilot returns");
    let mut arrives = wait(FlightMode::TakeOff);
    arrives.vehicle.mode = Some(FlightMode::Hold);
    arrives.run(1.0);
    arrives.vehicle.mode = Some(FlightMode::Guided);
    arrives.set("GLN_ALT", 60.0);
    arrives.step();
    assert_eq!(arrives.state(), State::Engaged, "the pilot hands it over");
}

#[test]
fn passive_is_left_by_each_request() {
    for (request, state) in
        [(Request::Engage, State::Waiting), (Request::Shadow, State::Shadow), (Request::Off, State::Idle)]
    {
        let mut rig = Rig::engaged();
        rig.vehicle.mode = Some(FlightMode::Hold);
        rig.step();
        rig.request = Some(request);
        rig.step();
        assert_eq!(rig.state(), state);
    }
    let mut rig = Rig::engaged();
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.step();
    rig.request = Some(Request::Return);
    rig.step();
    assert_eq!(rig.state(), State::Passive, "a return is no request to engage");
    assert_eq!(rig.said("return refused"), 1);
}

#[test]
fn disarming_ends_the_request() {
    let mut waiting = Rig::new();
    waiting.set("GLN_ALT", 80.0);
    waiting.request = Some(Request::Engage);
    waiting.step();
    waiting.vehicle.armed = false;
    waiting.step();
    assert_eq!(waiting.state(), State::Idle);
    let mut engaged = Rig::engaged();
    engaged.vehicle.armed = false;
    engaged.run(1.0);
    assert_eq!(engaged.state(), State::Idle);
    engaged.vehicle.armed = true;
    engaged.run(5.0);
    assert_eq!(engaged.state(), State::Idle, "the next arming is another flight");
}

#[test]
fn off_in_flight_stops_at_once_and_warns() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.request = Some(Request::Off);
    let out = rig.step();
    assert_eq!(rig.state(), State::Idle);
    assert!(out.withdraw && out.setpoint.is_none());
    assert_eq!(rig.said("take over now"), 1);
}

#[test]
fn a_pilot_who_took_over_after_a_fault_is_left_alone() {
    for meanwhile in
        [|rig: &mut Rig| rig.vehicle.mode = Some(FlightMode::Hold), |rig: &mut Rig| rig.vehicle.armed = false]
    {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        rig.accepts = None;
        rig.vehicle.position = None;
        rig.run(1.1);
        assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1);
        meanwhile(&mut rig);
        assert!(rig.step().withdraw, "the link must not repeat it");
        rig.vehicle.armed = true;
        rig.vehicle.mode = Some(FlightMode::Guided);
        rig.ended.push((AutopilotCommand::ReturnToLaunch, false));
        rig.run(10.0);
        assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1);
    }
}

#[test]
fn a_pilot_may_take_over_from_our_landing() {
    let mut rig = Rig::new();
    rig.place(TERMINAL, 0.0);
    rig.engage();
    rig.request = Some(Request::Return);
    rig.run_to(State::Done);
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.step();
    assert_eq!(rig.state(), State::Passive);
}
