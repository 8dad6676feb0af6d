//! The regular flight: decisions, legs, the ledger, landing, telemetry.

use crate::rig::{DOWN_M, Rig, START, TERMINAL, mission};
use gleaner_link::{AutopilotCommand, Firmware, FlightMode};
use gleaner_pilot::{Request, State};
use gleaner_units::{Action, BatteryUnits, Cell, CellSet, Grid, HeightMap, Metres, MetresPerSecond};

use Action::{East, Hover, North, West};

#[test]
fn a_mission_flies_cell_by_cell_and_lands_where_a_move_enters_the_terminal() {
    let mut rig = Rig::engaged();
    rig.policy.actions = [North, East, Hover, East, East, North, North, East, East].into();
    rig.run_to(State::Done);
    let route: Vec<Cell> = rig.setpoints.iter().fold(Vec::new(), |mut route, (_, target)| {
        let cell = rig.frame().cell(target).unwrap();
        if route.last() != Some(&cell) {
            route.push(cell);
        }
        assert_eq!(target.down_m, DOWN_M, "above home, not above the origin");
        route
    });
    let cells = [(1, 1), (1, 2), (2, 2), (3, 2), (4, 2), (4, 3), (4, 4), (5, 4), (6, 4)];
    assert_eq!(route, cells.map(|(x, y)| Cell::new(x, y)));
    assert_eq!(rig.setpoints[0].1, rig.centre(Cell::new(1, 1)));
    assert_eq!(rig.actions, [North, East, Hover, East, East, North, North, East, East]);
    assert_eq!(rig.machine.spent(), BatteryUnits(8.5));
    assert_eq!(rig.commanded(AutopilotCommand::Land), 1);
    assert_eq!(rig.commanded(AutopilotCommand::ChangeSpeed(MetresPerSecond(12.0))), 1);
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
    rig.run(18.0);
    let seen: Vec<[f32; 2]> =
        rig.policy.asked.iter().take(4).map(|tokens| [tokens.uav[1], tokens.uav[0]]).collect();
    // Budget 30 (90 % of 100 would be more); spare = battery - distance to (6, 4).
    assert_eq!(seen, [[30.0, 22.0], [29.0, 22.0], [28.5, 21.5], [27.5, 21.5]]);
    rig.vehicle.battery_percent = Some(36);
    let asked = rig.policy.asked.len();
    rig.run(3.0);
    // 60 m at 1.05 m/s, 0.9 of 0.25 units a second.
    let landing = 60.0 / 1.05 * 0.225;
    let capped = rig.policy.asked[asked].uav[1];
    assert!((capped - (37.0 - landing)).abs() < 1e-3, "capped by percent + 1 less the landing: {capped}");
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
        assert_eq!(rig.commanded(AutopilotCommand::ChangeSpeed(MetresPerSecond(8.0))), asked);
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
fn targets_stream_steadily_once_the_first_cell_is_reached() {
    for firmware in [Firmware::ArduPilot, Firmware::Px4] {
        let mut rig = Rig::new();
        rig.vehicle.firmware = Some(firmware);
        rig.policy.actions = [East, North, Hover, Hover, East].into();
        rig.engage();
        rig.run(20.0);
        let first = rig.velocities.iter().position(|(_, velocity)| velocity.is_some()).unwrap();
        assert!(rig.setpoints[first].1.horizontal_distance(&rig.centre(START)).0 < 1.0);
        assert!(rig.velocities[first..].iter().all(|(_, velocity)| velocity.is_some()));
        assert!(rig.setpoints[first..].windows(2).all(|pair| pair[1].0 - pair[0].0 <= 100));
    }
}

/// The decision for a cell is made while it can still be followed without braking, and for the state in which the
/// aircraft will be there.
#[test]
fn decisions_come_before_arrival_and_straight_on_is_not_braked() {
    let mut rig = Rig::engaged();
    rig.policy.actions = [East, East, East, East, North].into();
    let mut seen = Vec::new();
    while rig.actions.len() < 5 {
        if rig.step().decided {
            let decision = rig.machine.decision().unwrap();
            let away = rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(decision.cell)).0;
            seen.push((rig.now.as_millis(), decision.cell, decision.battery, away));
        }
    }
    for (index, &(_, cell, battery, away)) in seen.iter().enumerate() {
        assert_eq!((cell, battery), (Cell::new(1 + index as i16, 1), BatteryUnits(30.0 - index as f32)));
        assert!(away <= 21.5, "at most one cell ahead: {away}");
    }
    assert!(seen[2..].iter().all(|&(.., away)| away > 10.0), "{seen:?}");
    let seconds = (seen[4].0 - seen[2].0) as f32 / 2e3;
    assert!(seconds <= 2.0 / 0.9, "{seconds} s for a straight cell of 20 m at 10 m/s");
}

/// What is still to be flown is not yet taken from the measured charge.
#[test]
fn a_decision_ahead_counts_the_measured_charge_on_arrival() {
    let mut rig = Rig::engaged();
    rig.vehicle.battery_percent = Some(36);
    rig.policy.then = North;
    while rig.actions.len() < 3 {
        rig.step();
    }
    let landing = 60.0 / 1.05 * 0.225;
    let decision = rig.machine.decision().unwrap();
    let away = rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(decision.cell)).0;
    let expected = 37.0 - landing - away / 20.0;
    assert!((decision.battery.0 - expected).abs() < 0.1, "{} for {expected}", decision.battery.0);
}

#[test]
fn telemetry_comes_once_a_second() {
    let mut rig = Rig::engaged();
    rig.devices.0[0].remaining = 2_000.0;
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
    use gleaner_pilot::{
        ChannelEstimate, DecisionRecord, Expected, LookAheadRecord, RECORD_BYTES_MAX, Source,
    };
    let mut rig = Rig::engaged();
    rig.run(1.0);
    let mut record = rig.machine.decision().unwrap().record();
    record.sequence = u32::MAX;
    record.time_ms = u32::MAX;
    record.cell = Cell::new(i16::MIN, i16::MAX);
    record.attended = Some(u16::MAX);
    record.lookahead = Some(LookAheadRecord {
        source: Source::SingleMove,
        expected: Some(Expected { data_units: 5e4, energy: 80.0 }),
        budget: u32::MAX,
        tours: u32::MAX,
        seed: u32::MAX,
        slot: u16::MAX,
        channel: ChannelEstimate::default(),
    });
    let mut buffer = [0; RECORD_BYTES_MAX];
    let bytes = record.encode(&mut buffer).expect("the longest record fits");
    assert_eq!(DecisionRecord::decode(bytes), Some(record));
    assert_eq!(DecisionRecord::decode(&bytes[..bytes.len() - 1]), None);
}

#[test]
fn small_cells_are_not_cut_short_by_a_large_arrival_radius() {
    let mut small = mission();
    let grid = Grid::new(8, 6, Metres(6.0)).unwrap();
    small.heights = HeightMap::flat(grid);
    small.fence = CellSet::full(grid);
    let mut rig = Rig::with(small, true);
    rig.set("GLN_ARRIVE_R", 10.0);
    rig.engage();
    rig.policy.then = East;
    let (mut decided, mut nearest) = (Vec::new(), [f32::INFINITY; 4]);
    while decided.len() < 4 {
        if rig.step().decided {
            let here = rig.machine.decision().unwrap().cell;
            let away = rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(here)).0;
            assert!(away < 7.0, "at most one cell ahead: {away}");
            decided.push(here);
        }
        for (nearest, &cell) in nearest.iter_mut().zip(&decided) {
            *nearest = nearest.min(rig.vehicle.position.unwrap().horizontal_distance(&rig.centre(cell)).0);
        }
    }
    assert!(nearest[..3].iter().all(|&nearest| nearest < 0.5), "over each centre: {nearest:?}");
}
