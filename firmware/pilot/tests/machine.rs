//! Every arrow of the diagram on [`gleaner_pilot::State`], in virtual time.

mod support;

use gleaner_link::{AutopilotCommand, Firmware, FlightMode, SystemState};
use gleaner_pilot::{Fault, Missing, Request, ReturnReason, State, Vehicle};
use gleaner_units::{Action, BatteryUnits, Cell, Duration, MetresPerSecond, Ned};
use support::{DOWN_M, Rig, START, TERMINAL, mission};

use Action::{East, Hover, North, South, West};

#[test]
fn nothing_happens_without_a_request() {
    let mut rig = Rig::new();
    assert_eq!(rig.state(), State::Boot);
    assert_eq!(rig.machine.system_state(), SystemState::Boot);
    rig.run(5.0);
    assert_eq!(rig.state(), State::Idle);
    assert!(rig.setpoints.is_empty() && rig.commands.is_empty() && rig.policy.asked.is_empty());
    assert_eq!(rig.machine.system_state(), SystemState::Standby);
}

#[test]
fn a_failed_self_test_refuses_every_request_for_good() {
    let mut rig = Rig::with(mission(), false);
    for request in [None, Some(Request::Engage), Some(Request::Shadow), Some(Request::Off)] {
        rig.request = request;
        rig.step();
        assert_eq!(rig.state(), State::Fault);
    }
    assert_eq!(rig.machine.fault(), Some(Fault::SelfTest));
    assert!(!rig.machine.may_engage());
    assert_eq!(rig.machine.system_state(), SystemState::Critical);
    rig.run(5.0);
    assert!(rig.setpoints.is_empty() && rig.commands.is_empty());
    assert_eq!(rig.said("self-test failed"), 4);
}

#[test]
fn each_missing_condition_holds_the_start_back_and_is_told_once() {
    type Spoil = fn(&mut Rig);
    let cases: [(Missing, Spoil); 13] = [
        (Missing::Autopilot, |rig| rig.vehicle.mode = None),
        (Missing::FailsafeClear, |rig| rig.vehicle.failsafe = true),
        (Missing::Origin, |rig| rig.vehicle.origin = None),
        (Missing::Position, |rig| rig.vehicle.position = None),
        (Missing::Position, |rig| rig.vehicle.position = Some(Ned { north_m: f32::NAN, ..Ned::default() })),
        (Missing::Estimator, |rig| rig.vehicle.ready = false),
        (Missing::Home, |rig| rig.vehicle.home_down_m = None),
        (Missing::Battery, |rig| rig.vehicle.battery_percent = None),
        (Missing::Armed, |rig| rig.vehicle.armed = false),
        (Missing::GuidedMode, |rig| rig.vehicle.mode = Some(FlightMode::Hold)),
        (Missing::Altitude, |rig| rig.set("GLN_ALT", 64.0)),
        (Missing::InsideFence, |rig| rig.place(Cell::new(3, 3), 0.0)),
        (Missing::EnoughBattery, |rig| rig.set("GLN_RESERVE", 22.5)),
    ];
    for (missing, spoil) in cases {
        let mut rig = Rig::new();
        spoil(&mut rig);
        rig.request = Some(Request::Engage);
        rig.run(10.0);
        assert_eq!((rig.state(), rig.machine.missing()), (State::Waiting, Some(missing)));
        let told = if missing == Missing::EnoughBattery { "way home needs 30.5" } else { missing.text() };
        assert_eq!(rig.said(told), 1, "{missing:?}: {:?}", rig.texts);
        assert!(rig.setpoints.is_empty() && rig.commands.is_empty() && rig.policy.asked.is_empty());
    }
}

#[test]
fn an_altitude_below_the_buildings_is_refused() {
    let mut mission = mission();
    mission.heights.set(Cell::new(4, 4), 60);
    let mut rig = Rig::with(mission, true);
    rig.request = Some(Request::Engage);
    rig.step();
    assert_eq!(rig.machine.missing(), Some(Missing::SafeAltitude));
}

#[test]
fn the_start_waits_for_the_last_condition_and_tells_each_change() {
    let mut rig = Rig::new();
    rig.vehicle.armed = false;
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.request = Some(Request::Engage);
    rig.run(3.0);
    rig.vehicle.armed = true;
    rig.run(3.0);
    assert_eq!(rig.machine.missing(), Some(Missing::GuidedMode));
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.step();
    assert_eq!(rig.state(), State::Engaged);
    assert_eq!((rig.said("not armed"), rig.said("mode is not"), rig.said("engaged at (1, 1)")), (1, 1, 1));
    assert_eq!(rig.machine.system_state(), SystemState::Active);
}

#[test]
fn a_mission_flies_cell_by_cell_and_lands_where_a_move_enters_the_terminal() {
    let mut rig = Rig::engaged();
    rig.policy.actions = [North, East, Hover, East, East, North, North, East, East].into();
    rig.run_to(State::Done);
    let route: Vec<Ned> = rig.setpoints.iter().fold(Vec::new(), |mut route, &(_, target)| {
        if route.last() != Some(&target) {
            route.push(target);
        }
        route
    });
    let cells = [(1, 1), (1, 2), (2, 2), (3, 2), (4, 2), (4, 3), (4, 4), (5, 4), (6, 4)];
    assert_eq!(route, cells.map(|(x, y)| rig.centre(Cell::new(x, y))));
    assert_eq!(route[0].down_m, DOWN_M, "above home, not above the origin");
    assert_eq!(rig.actions, [North, East, Hover, East, East, North, North, East, East]);
    assert_eq!(rig.machine.spent(), BatteryUnits(8.5));
    assert_eq!(rig.commanded(AutopilotCommand::Land), 1);
    assert_eq!(rig.commanded(AutopilotCommand::ChangeSpeed(MetresPerSecond(10.0))), 1);
    assert!(!rig.machine.landed());
    let silent_from = rig.setpoints.len();
    rig.run(5.0);
    rig.vehicle.armed = false;
    rig.step();
    assert!(rig.machine.landed());
    assert_eq!(rig.state(), State::Done);
    assert_eq!(rig.setpoints.len(), silent_from);
    assert_eq!((rig.said("terminal reached"), rig.said("landing")), (1, 1));
}

#[test]
fn the_ledger_is_what_the_policy_sees() {
    let mut rig = Rig::engaged();
    rig.policy.actions = [North, Hover, East].into();
    rig.run(12.0);
    let seen: Vec<[f32; 2]> = rig.policy.asked.iter().take(4).map(|tokens| [tokens.uav[1], tokens.uav[0]]).collect();
    // Budget 30 (90 % of 100 would be more); spare = battery - distance to (6, 4).
    assert_eq!(seen, [[30.0, 22.0], [29.0, 22.0], [28.5, 21.5], [27.5, 21.5]]);
    rig.vehicle.battery_percent = Some(20);
    let asked = rig.policy.asked.len();
    rig.run(3.0);
    assert_eq!(rig.policy.asked[asked].uav[1], 21.0, "capped by percent + 1");
}

#[test]
fn a_hover_lasts_one_slot_and_a_move_as_long_as_it_takes() {
    let mut rig = Rig::engaged();
    rig.set("GLN_SPEED", 5.0);
    let mut decided = Vec::new();
    while decided.len() < 4 {
        if rig.step().decided {
            decided.push(rig.now.as_millis());
        }
    }
    assert!(decided.windows(2).all(|pair| pair[1] - pair[0] == 4_000), "20 m at 5 m/s: {decided:?}");
}

#[test]
fn a_mission_that_starts_on_its_terminal_goes_out_and_back() {
    let mut rig = Rig::new();
    rig.place(TERMINAL, 1.0);
    rig.engage();
    rig.policy.actions = [Hover, Hover, West, East].into();
    rig.run_to(State::Done);
    assert_eq!(rig.actions, [Hover, Hover, West, East]);
    assert_eq!(rig.machine.spent(), BatteryUnits(3.0));
}

#[test]
fn whatever_the_policy_wants_the_guard_brings_it_home() {
    for then in Action::ALL {
        let mut rig = Rig::engaged();
        rig.policy.then = then;
        rig.run_to(State::Done);
        assert!(rig.machine.spent() <= BatteryUnits(28.0), "{then:?} leaves the reserve of 2");
        assert!(rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(TERMINAL)).0 < 2.0);
    }
}

#[test]
fn the_preference_changes_at_the_next_decision_and_not_before() {
    let mut rig = Rig::engaged();
    rig.set("GLN_SPEED", 2.0);
    rig.run(1.0);
    assert_eq!(rig.policy.asked.len(), 1);
    rig.set("GLN_W_DATA", 0.25);
    rig.run(5.0);
    assert_eq!(rig.policy.asked.len(), 1, "a slot of ten seconds is not cut short");
    rig.run(5.0);
    let seen: Vec<[f32; 2]> = rig.policy.asked.iter().map(|tokens| tokens.preference).collect();
    assert_eq!(seen, [[0.5, 0.5], [0.25, 0.75]]);
    assert_eq!(rig.said("preference w_data 0.25"), 1);
    assert_eq!(rig.machine.preference_changes(), 1);
}

#[test]
fn a_changed_speed_is_asked_for_again_on_ardupilot_only() {
    for (firmware, asked) in [(Firmware::ArduPilot, 1), (Firmware::Px4, 0)] {
        let mut rig = Rig::new();
        rig.vehicle.firmware = Some(firmware);
        rig.engage();
        rig.run(1.0);
        rig.set("GLN_SPEED", 6.0);
        rig.run(5.0);
        assert_eq!(rig.commanded(AutopilotCommand::ChangeSpeed(MetresPerSecond(6.0))), asked);
    }
}

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
fn each_reason_to_go_home_ends_in_a_landing_on_the_terminal() {
    type Trouble = fn(&mut Rig);
    let cases: [(ReturnReason, Trouble); 5] = [
        (ReturnReason::Request, |rig| rig.request = Some(Request::Return)),
        (ReturnReason::Battery, |rig| rig.vehicle.battery_percent = Some(3)),
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
fn a_return_on_the_terminal_lands_there() {
    let mut rig = Rig::new();
    rig.place(TERMINAL, 1.0);
    rig.engage();
    rig.run(3.0);
    rig.request = Some(Request::Return);
    rig.run_to(State::Done);
    assert!(rig.actions.iter().all(|&action| action == Hover));
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
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 0, "nobody would hear it");
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.run(10.0);
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1);
}

#[test]
fn a_pilot_who_took_over_after_a_fault_is_left_alone() {
    for meanwhile in [|rig: &mut Rig| rig.vehicle.mode = Some(FlightMode::Hold), |rig: &mut Rig| rig.vehicle.armed = false] {
        let mut rig = Rig::engaged();
        rig.run(1.0);
        rig.accepts = None;
        rig.vehicle.position = None;
        rig.step();
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
fn a_refused_return_is_asked_for_three_times() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.accepts = Some(false);
    rig.vehicle.position = None;
    rig.run(20.0);
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 3);
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
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1);
}

#[test]
fn another_way_home_is_tried_when_the_target_was_dropped() {
    let mut rig = Rig::engaged();
    rig.policy.then = West;
    rig.run(0.8);
    rig.obeys = false;
    rig.run_to(State::Homing);
    rig.obeys = true;
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
    rig.run(0.5);
    assert_eq!(rig.commanded(AutopilotCommand::Land), 3);
    assert_eq!(rig.machine.fault(), Some(Fault::LandingRefused));
    assert!(rig.commanded(AutopilotCommand::ReturnToLaunch) > 0);
}

#[test]
fn a_landing_that_only_the_mode_confirms_is_a_landing() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.place(TERMINAL, 0.0);
    rig.engage();
    rig.accepts = None;
    rig.request = Some(Request::Return);
    while rig.commanded(AutopilotCommand::Land) == 0 {
        rig.step();
    }
    let before = rig.setpoints.len();
    rig.run(1.0);
    assert_eq!(rig.state(), State::Homing);
    assert!(rig.setpoints.len() > before + 9, "OFFBOARD is kept alive until it lands");
    rig.vehicle.mode = Some(FlightMode::Land);
    rig.step();
    assert_eq!((rig.state(), rig.machine.landed()), (State::Done, false));
    rig.vehicle.on_ground = true;
    rig.step();
    assert!(rig.machine.landed());
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

#[test]
fn px4_gets_a_stream_before_offboard_and_ten_a_second_in_flight() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.run(1.0);
    assert!(rig.setpoints.is_empty(), "not before a request");
    rig.request = Some(Request::Engage);
    rig.run(2.0);
    assert_eq!(rig.state(), State::Waiting);
    assert_eq!(rig.setpoints.last().unwrap().1, rig.vehicle.position.unwrap(), "where it is");
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.policy.then = North;
    rig.run(10.0);
    assert_eq!(rig.state(), State::Engaged);
    assert!(rig.setpoints.windows(2).all(|pair| pair[1].0 - pair[0].0 <= 100));
    assert!(rig.commands.is_empty(), "PX4 has no use for the speed command");
}

#[test]
fn ardupilot_gets_targets_on_change_and_once_a_second() {
    let mut rig = Rig::engaged();
    rig.set("GLN_SPEED", 1.0);
    rig.run(15.0);
    assert!(rig.setpoints.windows(2).all(|pair| {
        let gap_ms = pair[1].0 - pair[0].0;
        gap_ms == 1_000 || (gap_ms < 1_000 && pair[0].1 != pair[1].1)
    }));
    assert!(rig.setpoints.len() <= 17);
}

#[test]
fn shadow_decides_and_commands_nothing() {
    let mut rig = Rig::new();
    rig.vehicle.firmware = Some(Firmware::Px4);
    rig.request = Some(Request::Shadow);
    rig.run(0.1);
    assert_eq!(rig.state(), State::Shadow);
    rig.run(3.0);
    let in_place = rig.actions.len();
    assert_eq!(in_place, 2, "one at once, one after a slot of 2 s");
    rig.place(Cell::new(2, 1), 12.0);
    rig.step();
    assert_eq!(rig.actions.len(), in_place, "not at the centre");
    rig.place(Cell::new(2, 1), 1.0);
    rig.step();
    assert_eq!(rig.actions.len(), in_place + 1);
    let decision = rig.machine.decision().unwrap();
    assert_eq!((decision.state, decision.cell), (State::Shadow, Cell::new(2, 1)));
    assert_eq!(decision.battery, BatteryUnits(30.0), "the measured charge within the budget");
    rig.policy.fails = true;
    rig.run(10.0);
    assert_eq!(rig.said("policy failed"), 1, "told once");
    assert!(rig.setpoints.is_empty() && rig.commands.is_empty());
}

#[test]
fn telemetry_comes_once_a_second() {
    let mut rig = Rig::engaged();
    rig.devices[0].remaining = 2_000.0;
    let mut told = Vec::new();
    for _ in 0..100 {
        told.extend(rig.step().telemetry);
    }
    assert_eq!(told.len(), 5);
    assert_eq!(told[4].collected, 0.5);
    assert_eq!(told[4].spare, Some(BatteryUnits(28.5 - 8.0)), "three hovers paid");
}

#[test]
fn a_decision_record_fits_a_tunnel_and_comes_back() {
    use gleaner_pilot::{DecisionRecord, RECORD_BYTES_MAX};
    let mut rig = Rig::engaged();
    rig.run(1.0);
    let mut record = rig.machine.decision().unwrap().record();
    record.sequence = u32::MAX;
    record.time_ms = u32::MAX;
    record.cell = Cell::new(i16::MIN, i16::MAX);
    record.attended = Some(u16::MAX);
    let mut buffer = [0; RECORD_BYTES_MAX];
    let bytes = record.encode(&mut buffer).expect("the longest record fits");
    assert_eq!(DecisionRecord::decode(bytes), Some(record));
    assert_eq!(DecisionRecord::decode(&bytes[..bytes.len() - 1]), None);
}

#[test]
fn an_aircraft_that_was_never_heard_is_not_flown() {
    let mut rig = Rig::new();
    rig.vehicle = Vehicle::default();
    rig.request = Some(Request::Engage);
    rig.run(5.0);
    assert_eq!(rig.machine.missing(), Some(Missing::Autopilot));
    assert_eq!(START, Cell::new(1, 1));
}
