//! What was true at engage is watched in flight: origin, altitude, place, battery, radio.

use crate::rig::{CORNER, Rig, TERMINAL};
use gleaner_link::{AutopilotCommand, FlightMode};
use gleaner_pilot::{Fault, Request, ReturnReason, State};
use gleaner_units::{Action, BatteryUnits, Cell, Metres};

#[test]
fn an_origin_that_moves_is_a_fault() {
    for (moved_m, is_fault) in [(0.02, false), (5.0, true)] {
        let mut rig = Rig::engaged();
        rig.run(2.0);
        rig.vehicle.origin = Some(CORNER.offset_by(Metres(-100.0 + moved_m), Metres(50.0)));
        rig.run(0.1);
        assert_eq!(rig.machine.fault(), is_fault.then_some(Fault::OriginMoved));
        assert_eq!(rig.said("origin moved"), usize::from(is_fault));
    }
}

#[test]
fn after_an_origin_shift_the_return_is_requested() {
    let mut rig = Rig::engaged();
    rig.run(2.0);
    rig.obeys = false;
    rig.vehicle.origin = Some(CORNER.offset_by(Metres(-40.0), Metres(50.0)));
    // The autopilot's target has other coordinates too.
    rig.foreign_target = true;
    rig.step();
    assert_eq!(rig.machine.fault(), Some(Fault::OriginMoved));
    rig.foreign_target = false;
    rig.vehicle.position.as_mut().unwrap().north_m -= 60.0;
    rig.run(2.0);
    assert_eq!(rig.commanded(AutopilotCommand::ReturnToLaunch), 1, "the aircraft was not moved by another");
}

#[test]
fn an_altitude_that_is_lost_for_three_seconds_is_a_fault() {
    let mut rig = Rig::engaged();
    rig.run(2.0);
    rig.obeys = false;
    let sink = |rig: &mut Rig, metres: f32| rig.vehicle.position.as_mut().unwrap().down_m += metres;
    sink(&mut rig, 6.0);
    rig.run(2.5);
    sink(&mut rig, -6.0);
    rig.run(2.5);
    assert_eq!(rig.state(), State::Engaged, "a gust");
    sink(&mut rig, 55.0);
    rig.run(3.2);
    assert_eq!(rig.machine.fault(), Some(Fault::AltitudeLost));
}

#[test]
fn roofs_within_the_altitude_tolerance_refuse_a_start() {
    let mut mission = crate::rig::mission();
    mission.heights.set(Cell::new(4, 4), 58);
    let mut rig = Rig::with(mission, true);
    rig.request = Some(Request::Engage);
    rig.run(3.0);
    assert_eq!(rig.said("GLN_ALT is below the buildings"), 1);
}

#[test]
fn a_position_that_jumps_goes_home_and_gives_up_the_second_time() {
    let mut rig = Rig::engaged();
    rig.policy.then = Action::North;
    rig.run(3.0);
    rig.place(Cell::new(4, 2), 3.0);
    rig.step();
    assert_eq!(rig.machine.return_reason(), Some(ReturnReason::PositionJump));
    assert_eq!(rig.machine.target(), Some(Cell::new(4, 2)), "from the cell under the aircraft");
    rig.run(2.0);
    rig.place(Cell::new(1, 1), 0.0);
    rig.step();
    assert_eq!(rig.machine.fault(), Some(Fault::PositionLost));
}

#[test]
fn positions_that_were_lost_on_the_way_are_no_jump() {
    for (gap_ms, is_jump) in [(1_500, false), (100, true)] {
        let mut rig = Rig::engaged();
        rig.obeys = false;
        rig.vehicle.boot_ms = Some(60_000);
        rig.run(1.5);
        rig.vehicle.boot_ms = Some(60_000 + gap_ms);
        rig.vehicle.position.as_mut().unwrap().north_m += 15.0;
        rig.step();
        assert_eq!(rig.state() == State::Homing, is_jump, "{gap_ms} ms: {:?}", rig.texts);
    }
}

#[test]
fn an_unknown_battery_goes_home_and_a_jump_is_reported() {
    let mut rig = Rig::engaged();
    rig.run(1.0);
    rig.vehicle.battery_percent = Some(70);
    rig.run(1.0);
    assert_eq!((rig.state(), rig.said("percentage jumped")), (State::Engaged, 1));
    rig.vehicle.battery_percent = None;
    rig.run(1.0);
    assert_eq!(rig.machine.return_reason(), Some(ReturnReason::BatteryUnknown));
    rig.run_to(State::Done);
}

#[test]
fn a_second_engagement_does_not_reopen_the_budget() {
    let mut rig = Rig::engaged();
    rig.run(9.0);
    let spent = rig.machine.spent();
    assert!(spent.0 >= 2.0);
    rig.vehicle.mode = Some(FlightMode::Hold);
    rig.run(1.0);
    rig.vehicle.mode = Some(FlightMode::Guided);
    rig.engage();
    let asked = rig.policy.asked.len();
    rig.run(1.0);
    assert_eq!(rig.policy.asked[asked].uav[1], 30.0 - spent.0);
    // Another arming is another mission.
    rig.vehicle.armed = false;
    rig.run(1.0);
    rig.vehicle.armed = true;
    rig.run(1.0);
    rig.engage();
    let asked = rig.policy.asked.len();
    rig.run(1.0);
    assert_eq!(rig.policy.asked[asked].uav[1], 30.0);
}

#[test]
fn a_restart_of_the_program_does_not_reopen_the_budget() {
    for (armed, left) in [(true, 18.0), (false, 30.0)] {
        let mut rig = Rig::new();
        rig.machine.resume_budget(BatteryUnits(12.0));
        rig.vehicle.armed = armed;
        rig.run(1.0);
        rig.vehicle.armed = true;
        rig.run(1.0);
        rig.engage();
        rig.run(2.0);
        assert_eq!(rig.policy.asked[0].uav[1], left, "armed at the start: {armed}");
    }
}

/// Flies a mission in which a unit really takes `price` percent; the percent left when the landing is requested.
fn fly_at(price: f32, then: Action) -> (Rig, f32) {
    let mut mission = crate::rig::mission();
    mission.budget = BatteryUnits(80.0);
    let mut rig = Rig::with(mission, true);
    let mut left = 90.9_f32;
    rig.vehicle.battery_percent = Some(90);
    rig.engage();
    rig.policy.then = then;
    // Targets come with every second poll.
    let mut last_m = 0.0;
    while rig.commanded(AutopilotCommand::Land) == 0 && left > 0.0 {
        let before = rig.vehicle.position.unwrap();
        rig.step();
        let moved_m = rig.vehicle.position.unwrap().horizontal_distance(&before).0;
        // 20 polls a second; a slot of hovering takes two seconds.
        let moves = moved_m + std::mem::replace(&mut last_m, moved_m) > 0.0;
        left -= price * if moves { moved_m / 20.0 } else { 0.5 / 40.0 };
        rig.vehicle.battery_percent = Some(left.max(0.0) as u8);
    }
    (rig, left)
}

#[test]
fn the_price_of_a_unit_is_learned_and_the_landing_stays_covered() {
    let landing = 60.0 / 1.05 * 0.225;
    for price in [0.7, 1.0, 1.3, 1.7, 2.0, 2.5] {
        for then in [Action::Hover, Action::North, Action::West] {
            let (rig, left) = fly_at(price, then);
            // 2 units of reserve cover the whole percent that the charge is rounded by.
            assert!(left >= landing * price.max(1.0), "{left} left at {price} %, {then:?}, {:?}", rig.texts);
            assert_eq!(rig.machine.target(), Some(TERMINAL));
        }
    }
}

/// Cheap cells first, then wind while it hovers far out: the way home is flown in the wind.
#[test]
fn a_price_that_rises_in_flight_still_covers_the_landing() {
    let landing = 60.0 / 1.05 * 0.225;
    for risen in [1.5, 2.0, 2.5] {
        let mut mission = crate::rig::mission();
        mission.budget = BatteryUnits(80.0);
        let mut rig = Rig::with(mission, true);
        rig.engage();
        rig.policy.then = Action::North;
        let (mut left, mut last_m) = (90.9_f32, 0.0);
        while rig.commanded(AutopilotCommand::Land) == 0 && left > 0.0 {
            let before = rig.vehicle.position.unwrap();
            rig.step();
            let moved_m = rig.vehicle.position.unwrap().horizontal_distance(&before).0;
            let moves = moved_m + std::mem::replace(&mut last_m, moved_m) > 0.0;
            let price = if left > 55.0 { 1.0 } else { risen };
            left -= price * if moves { moved_m / 20.0 } else { 0.5 / 40.0 };
            rig.vehicle.battery_percent = Some(left.max(0.0) as u8);
        }
        // To one unit: the price is learned to a tenth, and the charge in whole percent.
        assert!(left + risen >= landing * risen, "{left} left at {risen}, {:?}", rig.texts);
    }
}

#[test]
fn telemetry_shows_the_learned_price_and_the_charge_at_touchdown() {
    let (rig, left) = fly_at(1.5, Action::North);
    let told = rig.telemetry.unwrap();
    assert!((told.unit_pct - 1.5).abs() < 0.2, "{}", told.unit_pct);
    // With the margin of a price of 1.5.
    let landing = 60.0 / 1.05 * 0.225 * 1.5 * 1.13;
    assert!((told.land_pct.unwrap() - (left - landing)).abs() < 4.0, "{told:?} {left}");
    assert!(rig.said("touchdown at") == 1, "{:?}", rig.texts);
}

#[test]
fn a_battery_that_is_short_of_home_is_reported_and_lands_on_open_ground() {
    let mut rig = Rig::engaged();
    rig.policy.then = Action::West;
    rig.run(1.0);
    rig.request = Some(Request::Return);
    rig.run(1.0);
    rig.vehicle.battery_percent = Some(17);
    rig.run(4.0);
    assert_eq!((rig.state(), rig.said("battery short of home")), (State::Homing, 1));
    assert_eq!(rig.commanded(AutopilotCommand::Land), 0, "it goes on");
    rig.vehicle.battery_percent = Some(13);
    rig.run(6.0);
    assert_eq!((rig.commanded(AutopilotCommand::Land), rig.said("battery empty, landing")), (1, 1));
}

#[test]
fn a_silent_radio_is_reported_and_then_goes_home() {
    let mut rig = Rig::engaged();
    rig.run(5.0);
    rig.radio_reports = false;
    rig.run(10.5);
    assert_eq!((rig.state(), rig.said("radio silent, 0 bytes 0 reports")), (State::Engaged, 1));
    rig.radio_reports = true;
    rig.run(1.0);
    rig.radio_reports = false;
    rig.run(30.0);
    assert_eq!((rig.state(), rig.said("bytes 0 reports")), (State::Engaged, 2), "once each time");
}

#[test]
fn a_flight_without_reports_ends_after_the_set_time() {
    let mut mission = crate::rig::mission();
    mission.budget = BatteryUnits(70.0);
    let mut rig = Rig::with(mission, true);
    rig.radio_reports = false;
    // The radio is there, and hears no device.
    rig.radio.bytes = 1;
    rig.engage();
    rig.run(61.0);
    assert_eq!(rig.machine.return_reason(), Some(ReturnReason::RadioSilent));
}

#[test]
fn an_altitude_changed_in_flight_acts_at_the_next_engage() {
    let mut rig = Rig::new();
    rig.set("GLN_ALT", 61.0);
    rig.run(1.0);
    assert_eq!(rig.said("GLN_ALT acts"), 0);
    rig.engage();
    rig.set("GLN_ALT", 62.0);
    rig.run(3.0);
    assert_eq!(rig.said("GLN_ALT acts at the next engage"), 1);
}

#[test]
fn a_vehicle_clock_that_runs_fast_is_reported_once() {
    for (factor, reported) in [(1, 0), (4, 1)] {
        let mut rig = Rig::new();
        for step in 0..600_u32 {
            rig.vehicle.boot_ms = Some(step * 50 * factor);
            rig.step();
        }
        assert_eq!(rig.said("vehicle clock at"), reported);
    }
}
