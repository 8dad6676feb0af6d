//! Going home early, and giving up.

use crate::rig::{Rig, TERMINAL};
use gleaner_link::{AutopilotCommand, FlightMode, SystemState};
use gleaner_pilot::{Fault, Request, ReturnReason, State};
use gleaner_units::{Action, Cell, Duration};

use Action::{East, North, South, West};

#[test]
fn each_reason_to_go_home_ends_in_a_landing_on_the_terminal() {
    type Trouble = fn(&mut Rig);
    let cases: [(ReturnReason, Trouble); 5] = [
        (ReturnReason::Request, |rig| rig.request = Some(Request::Return)),
        (ReturnReason::Battery, |rig| rig.vehicle.battery_percent = Some(18)),
        (ReturnReason::Failsafe, |rig| rig.vehicle.failsafe = true),
        (ReturnReason::Policy, |rig| rig.policy.fails = true),
        (ReturnReason::Policy, |rig| rig.policy.logit = f32::NAN),
    ];
    for (reason, trouble) in cases {
        let mut rig = Rig::engaged();
        rig.policy.then = North;
        rig.run(5.0);
        trouble(&mut rig);
        rig.run_to(State::Homing);
        assert_eq!(rig.machine.return_reason(), Some(reason));
        assert_eq!(rig.said(reason.text()), 1, "{:?}", rig.texts);
        let asked = rig.policy.asked.len();
        rig.run_to(State::Done);
        assert_eq!(rig.policy.asked.len(), asked, "the guard flies alone");
        assert!(rig.machine.decision().unwrap().inference.is_none());
        assert!(rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(TERMINAL)).0 < 2.0);
    }
}

#[test]
fn faults_in_flight_stop_the_targets_and_hand_back_once() {
    type Break = fn(&mut Rig);
    let cases: [(Fault, Break); 4] = [
        (Fault::PositionLost, |rig| rig.vehicle.position = None),
        (Fault::PositionLost, |rig| rig.vehicle.ready = false),
        (Fault::Late, |rig| {
            rig.step_after(Duration::from_millis(1_001));
        }),
        (Fault::NoProgress, |rig| {
            rig.policy.then = East;
            rig.obeys = false;
        }),
    ];
    for (fault, break_it) in cases {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        break_it(&mut rig);
        rig.run_to(State::Fault);
        assert_eq!(rig.machine.fault(), Some(fault));
        let silent_from = rig.setpoints.len();
        rig.run(10.0);
        assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1, "{fault:?}");
        assert_eq!(rig.setpoints.len(), silent_from);
        assert_eq!(rig.said(fault.text()), 1);
        assert_eq!(rig.machine.system_state(), SystemState::Critical);
        rig.request = Some(Request::Engage);
        rig.step();
        assert_eq!(rig.state(), State::Waiting, "a new request leaves a fault");
    }
}

#[test]
fn a_moment_without_an_estimate_is_no_fault() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.vehicle.ready = false;
    rig.run(1.9);
    rig.vehicle.ready = true;
    rig.run(5.0);
    assert_eq!(rig.state(), State::Engaged);
}

#[test]
fn a_silent_autopilot_is_a_fault_and_is_asked_to_return_when_it_is_back_in_our_mode() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.vehicle.mode = None;
    rig.run(10.0);
    assert_eq!(rig.machine.fault(), Some(Fault::AutopilotLost));
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 0, "the link is cut");
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.run(10.0);
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1);
}

#[test]
fn a_return_that_is_not_accepted_is_asked_for_until_it_is_or_someone_takes_over() {
    for accepted in [true, false] {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        rig.accepts = Some(false);
        rig.vehicle.position = None;
        rig.run(60.0);
        let asked = rig.commanded(AutopilotCommand::ReturnToLaunch);
        // At 0, 2 and 4 s, then every 10 s.
        assert!((8..=9).contains(&asked), "{asked}");
        assert_eq!(rig.said("autopilot does not return, take over"), 2);
        if accepted {
            rig.accepts = Some(true);
        } else {
            rig.vehicle.mode = Some(FlightMode::Hold);
        }
        rig.run(60.0);
        let more = rig.commanded(AutopilotCommand::ReturnToLaunch) - asked;
        assert_eq!(more, usize::from(accepted));
    }
}

#[test]
fn who_moved_the_aircraft_while_it_was_unheard_keeps_it() {
    for moved_m in [0.0, 100.0] {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        rig.obeys = false;
        rig.vehicle.mode = None;
        rig.run(20.0);
        let position = rig.vehicle.position.as_mut().unwrap();
        position.north_m += moved_m;
        rig.vehicle.mode = Some(FlightMode::Guided);
        rig.run(20.0);
        let is_ours = moved_m == 0.0;
        assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), usize::from(is_ours), "{moved_m}");
        assert_eq!(rig.said("moved by another"), usize::from(!is_ours));
    }
}

#[test]
fn off_before_the_aircraft_is_given_back_says_that_nobody_has_it() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.accepts = Some(false);
    rig.vehicle.position = None;
    rig.run(5.0);
    rig.request = Some(Request::Off);
    rig.step();
    assert_eq!((rig.state(), rig.said("off in flight, take over now")), (State::Idle, 1));
}

#[test]
fn a_target_that_the_autopilot_drops_turns_the_flight_home_after_20_s_and_back_after_40() {
    let mut rig = Rig::engaged();
    rig.policy.then = East;
    rig.run(1.0);
    // Its own fence: from here nothing east of this point is obeyed.
    rig.obeys = false;
    let stuck_ms = rig.now.as_millis();
    rig.run_to(State::Homing);
    assert_eq!(rig.machine.return_reason(), Some(ReturnReason::NoProgress));
    let after_ms = rig.now.as_millis() - stuck_ms;
    assert!((19_000..=21_000).contains(&after_ms), "{after_ms}");
    rig.run_to(State::Fault);
    let after_ms = rig.now.as_millis() - stuck_ms;
    assert!((39_000..=41_000).contains(&after_ms), "{after_ms}");
    rig.run(1.1);
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1);
}

#[test]
fn a_dropped_target_is_given_up_and_the_way_home_is_flown() {
    let mut rig = Rig::engaged();
    rig.policy.then = West;
    rig.dropped = Some(Cell::new(0, 1));
    rig.run_to(State::Homing);
    assert_eq!(rig.machine.return_reason(), Some(ReturnReason::NoProgress));
    assert_eq!(rig.machine.target(), Some(Cell::new(1, 1)), "back to the cell under the aircraft");
    rig.run_to(State::Done);
}

#[test]
fn an_unanswered_landing_is_asked_again_and_then_handed_back() {
    let mut rig = Rig::new();
    rig.place(TERMINAL, 0.0);
    rig.engage();
    rig.policy.actions = [South, North].into();
    while rig.commanded(AutopilotCommand::Land) == 0 {
        rig.accepts = Some(false);
        rig.step();
    }
    rig.run(4.0);
    assert_eq!(rig.commanded(AutopilotCommand::Land), 3);
    assert_eq!(rig.machine.fault(), Some(Fault::LandingRefused));
    assert!(rig.commanded(AutopilotCommand::ReturnToLaunch) > 0);
}

/// The landing is requested and not answered; the aircraft leaves the cell and does not come back.
fn pushed_off_its_landing() -> Rig {
    let mut rig = Rig::new();
    rig.place(TERMINAL, 0.0);
    rig.engage();
    rig.policy.actions = [South, North].into();
    rig.accepts = None;
    while rig.commanded(AutopilotCommand::Land) == 0 {
        rig.step();
    }
    rig.obeys = false;
    rig.place(TERMINAL, -11.0);
    rig
}

/// ArduPilot stops elsewhere when the line is cut, and would land there when the line is back.
#[test]
fn a_landing_is_requested_over_its_cell_only() {
    let mut rig = pushed_off_its_landing();
    assert!(rig.step().withdraw, "what the link repeats is withdrawn");
    rig.run(10.0);
    assert_eq!((rig.commanded(AutopilotCommand::Land), rig.state()), (1, State::Homing));
    rig.obeys = true;
    rig.accepts = Some(true);
    rig.run(5.0);
    assert_eq!((rig.commanded(AutopilotCommand::Land), rig.state()), (2, State::Done));
}

#[test]
fn an_aircraft_that_does_not_come_back_to_land_is_handed_back() {
    let mut rig = pushed_off_its_landing();
    rig.run(45.0);
    assert_eq!(rig.machine.fault(), Some(Fault::LandingRefused));
}
