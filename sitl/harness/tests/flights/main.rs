//! Whole missions through real MAVLink bytes, flown by simple policies.

mod handing_back;

use gleaner_harness::{
    AircraftFault, AutopilotKind, ComputerFault, Ending, FlightResult, FlightScript, Incident, IncidentKind,
    LineFault, MissionPlan, MissionSetup, RadioFault, Switch, VehicleMode, fly, trajectory,
};
use gleaner_pilot::{Budget, Deliberator, LoggedDecision, LookAheadReplay, LookingAhead, Replayed, State};
use gleaner_policy::{Attention, Inference, Policy, Tokens};
use gleaner_units::{Action, BatteryUnits, Duration};
use gleaner_world::{Episode, ScenarioKind, World};
use std::sync::Arc;

/// Straight to the terminal; from the terminal itself, out and back.
struct Homeward;

/// Hovers as long as data is worth more than energy and the guard lets it, then goes home.
struct Waiter;

fn logits(best: Action, second: Action) -> Inference {
    let mut logits = [0.0; Action::COUNT];
    logits[second.index()] = 1.0;
    logits[best.index()] = 2.0;
    Inference { logits, attention: Attention::NONE }
}

fn homeward(tokens: &Tokens) -> Action {
    let [_, _, east_m, north_m] = tokens.uav;
    match () {
        () if east_m > 0.0 => Action::East,
        () if east_m < 0.0 => Action::West,
        () if north_m > 0.0 => Action::North,
        () if north_m < 0.0 => Action::South,
        () => Action::East,
    }
}

impl Policy for Homeward {
    type Error = ();
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        Ok(logits(homeward(tokens), Action::North))
    }
}

impl Policy for Waiter {
    type Error = ();
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        let home = homeward(tokens);
        Ok(if tokens.preference[0] > 0.5 { logits(Action::Hover, home) } else { logits(home, Action::North) })
    }
}

fn world() -> Arc<World> {
    Arc::new(World::default_world())
}

fn flown<P: Deliberator>(plan: MissionPlan, script: FlightScript, policy: P) -> FlightResult {
    fly(MissionSetup::new(world(), plan).unwrap(), script, policy, Ok(())).unwrap()
}

fn rd(seed: u64) -> MissionPlan {
    MissionPlan::new(ScenarioKind::ReachDestination, seed)
}

fn texts(flown: &FlightResult) -> Vec<&str> {
    flown.texts.iter().map(|(_, text)| text.as_str()).collect()
}

#[test]
fn the_shortest_missions_cost_32_and_2_units() {
    for (kind, units) in [(ScenarioKind::ReachDestination, 32.0), (ScenarioKind::ReturnBase, 2.0)] {
        let flown = flown(MissionPlan::new(kind, 1), FlightScript::plain(0.0), Homeward);
        let figures = flown.figures();
        assert_eq!(figures.violations, [], "{:?}", texts(&flown));
        assert_eq!(flown.ending, Ending::OnTheGround, "waited for {}", flown.waiting_for);
        assert!(figures.landed && figures.is_good());
        assert_eq!((figures.energy, figures.decisions), (BatteryUnits(units), units as u32));
        assert_eq!(flown.state, Some(State::Done));
    }
}

#[test]
fn a_flight_collects_what_its_episode_collects() {
    for (seed, wander_m) in [(5, 0.0), (6, 0.3)] {
        let switches = vec![Switch { after: Duration::from_secs(60), w_data: 0.1 }];
        let plan = MissionPlan { wander_m, ..rd(seed) };
        let flown = flown(plan, FlightScript { switches, ..FlightScript::plain(1.0) }, Waiter);
        let figures = flown.figures();
        assert_eq!(figures.violations, []);
        assert!(figures.landed);
        let setup = flown.simulation.setup();
        let mut episode = Episode::new(world(), &setup.realization, setup.seed()).unwrap();
        let mut paid = BatteryUnits(0.0);
        for slot in flown.simulation.journal().slots() {
            assert_eq!((slot.record.cell, slot.record.battery), (episode.uav(), episode.battery()));
            let step = episode.step(slot.record.action).unwrap();
            assert_eq!(slot.serving.map(|serving| serving.device), step.served);
            paid = paid + step.energy;
        }
        assert!(episode.is_done());
        assert_eq!(flown.simulation.field(), episode.field());
        assert_eq!(figures.energy, paid);
        assert!(figures.collected > 0.0);
        // Hovering until the preference changes.
        assert_eq!(figures.switches, 1);
        let hovers = |weight: f32| {
            let of = |slot: &&gleaner_harness::Slot| slot.record.w_data == weight;
            let slots = flown.simulation.journal().slots().iter();
            slots.filter(of).filter(|slot| slot.record.action == Action::Hover).count()
        };
        assert!((29..=31).contains(&hovers(1.0)), "60 s of hovering for 2 s each: {}", hovers(1.0));
        assert_eq!(hovers(0.1), 0);
    }
}

#[test]
fn the_guard_brings_a_greedy_hoverer_home() {
    let flown = flown(rd(2), FlightScript::plain(1.0), Waiter);
    let figures = flown.figures();
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, texts(&flown));
    assert_eq!(figures.energy, BatteryUnits(80.0), "all of the budget, and not more");
    assert_eq!(figures.decisions, 2 * 48 + 32);
}

#[test]
fn switches_go_out_by_command_and_by_parameter() {
    let at = |seconds: u64, w_data: f32| Switch { after: Duration::from_secs(seconds), w_data };
    let switches = vec![at(10, 0.2), at(20, 0.9), at(30, 0.3)];
    let flown = flown(rd(3), FlightScript { switches, ..FlightScript::plain(0.0) }, Homeward);
    assert!(flown.figures().is_good());
    assert_eq!(flown.figures().switches, 3);
    let mut weights: Vec<f32> = flown.simulation.journal().slots().iter().map(|s| s.record.w_data).collect();
    weights.dedup();
    assert_eq!(weights, [0.0, 0.2, 0.9, 0.3]);
}

#[test]
fn after_a_take_over_the_pilot_stays_passive() {
    let after = Duration::from_secs(20);
    for mode in [VehicleMode::Hold, VehicleMode::Brake, VehicleMode::Stabilize] {
        let incidents = vec![
            Incident { after, kind: IncidentKind::pilot_selects(mode) },
            // Giving GUIDED back is no request to engage.
            Incident {
                after: after + Duration::from_secs(20),
                kind: IncidentKind::pilot_selects(VehicleMode::Guided),
            },
            Incident { after: after + Duration::from_secs(40), kind: IncidentKind::pilot_selects(mode) },
        ];
        let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(0.0) }, Homeward);
        let figures = flown.figures();
        assert_eq!(
            (flown.ending, flown.state),
            (Ending::TakenOver, Some(State::Passive)),
            "{:?}",
            texts(&flown)
        );
        assert_eq!(figures.violations, []);
        assert!(!figures.landed && figures.decisions < 12, "{}", figures.decisions);
    }
}

#[test]
fn a_target_outside_the_fence_ends_in_a_return() {
    let incidents = vec![Incident {
        after: Duration::from_secs(1),
        kind: IncidentKind::Aircraft(AircraftFault::Fence(150.0)),
    }];
    let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(0.0) }, Homeward);
    let figures = flown.figures();
    assert_eq!(figures.violations, [], "{:?}", texts(&flown));
    assert!(!figures.landed);
    let said = |part: &str| texts(&flown).iter().any(|text| text.contains(part));
    assert!(said("no progress"), "{:?}", texts(&flown));
    assert_eq!((flown.ending, flown.state), (Ending::OnTheGround, Some(State::Fault)));
    assert_eq!(flown.simulation.truth().mode, VehicleMode::Return, "handed back to the autopilot");
}

#[test]
fn an_autopilot_that_reboots_in_flight_is_left_alone() {
    let incidents = vec![Incident {
        after: Duration::from_secs(20),
        kind: IncidentKind::Aircraft(AircraftFault::Reboot),
    }];
    let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert_eq!(figures.violations, [], "{:?}", texts(&flown));
    assert_eq!(flown.ending, Ending::OnTheGround);
    assert!(!figures.landed && (8..=12).contains(&figures.decisions), "{figures:?}");
}

#[test]
fn after_a_fault_on_a_noisy_line_the_autopilot_returns() {
    // Now and then a heartbeat comes through and shows that it is still ours; requests and answers are lost.
    let noise = IncidentKind::Line(LineFault::Noise(8), Duration::from_secs(60));
    let incidents = vec![Incident { after: Duration::from_secs(20), kind: noise }];
    let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert_eq!(figures.violations, [], "{:?}", texts(&flown));
    assert_eq!((flown.ending, flown.state), (Ending::OnTheGround, Some(State::Fault)), "{:?}", texts(&flown));
    assert_eq!(flown.simulation.truth().mode, VehicleMode::Return, "handed back to the autopilot");
    // The pilot's own text; on the noisy line the operator may not receive it.
    let said = |frame: &[u8]| frame.windows(14).any(|part| part == b"gleaner: fault");
    let lost = flown.simulation.journal().frames().find(|(_, frame)| said(frame));
    let (lost_at, _) = lost.expect("a fault");
    let bad_until = flown.engaged_at.unwrap() + Duration::from_secs(80);
    assert!(bad_until - lost_at > Duration::from_secs(20), "long enough for every attempt to be lost");
}

#[test]
fn a_short_estimator_failure_is_waited_for() {
    for (millis, is_good) in [(800, true), (5_000, false)] {
        let kind = IncidentKind::Aircraft(AircraftFault::EstimatorUntrusted(Duration::from_millis(millis)));
        let incidents = vec![Incident { after: Duration::from_secs(20), kind }];
        let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
        let figures = flown.figures();
        assert_eq!(figures.violations, [], "{:?}", texts(&flown));
        assert_eq!((flown.ending, figures.landed), (Ending::OnTheGround, is_good), "{:?}", texts(&flown));
        let state = if is_good { State::Done } else { State::Passive };
        assert_eq!(flown.state, Some(state), "{:?}", texts(&flown));
    }
}

#[test]
fn a_take_over_during_a_line_cut_is_respected() {
    let at = |seconds, kind| Incident { after: Duration::from_secs(seconds), kind };
    let incidents = vec![
        at(20, IncidentKind::Line(LineFault::Cut(None), Duration::from_secs(25))),
        at(22, IncidentKind::pilot_selects(VehicleMode::Return)),
        at(36, IncidentKind::pilot_selects(VehicleMode::Guided)),
        at(80, IncidentKind::pilot_selects(VehicleMode::Hold)),
    ];
    let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(0.0) }, Homeward);
    assert_eq!(flown.figures().violations, [], "{:?}", texts(&flown));
    assert_eq!((flown.ending, flown.state), (Ending::TakenOver, Some(State::Fault)), "{:?}", texts(&flown));
    assert!(texts(&flown).iter().any(|text| text.contains("moved by another")), "{:?}", texts(&flown));
}

#[test]
fn a_silent_radio_costs_only_data() {
    let silent = IncidentKind::Radio(RadioFault::Silent, Duration::from_secs(60));
    let incidents = vec![Incident { after: Duration::from_secs(20), kind: silent }];
    let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
    assert!(flown.figures().is_good(), "{:?}", texts(&flown));
}

#[test]
fn a_battery_failsafe_sends_it_home() {
    let incidents = vec![Incident {
        after: Duration::from_secs(10),
        kind: IncidentKind::Aircraft(AircraftFault::Voltage(10.2)),
    }];
    let flown = flown(rd(4), FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, texts(&flown));
    let hovers =
        flown.simulation.journal().slots().iter().filter(|s| s.record.action == Action::Hover).count();
    assert!((10..=12).contains(&hovers), "10 s, and the timer of 10 s: {hovers}");
    assert_eq!(figures.energy.0, 32.0 + 0.5 * hovers as f32);
}

#[test]
fn a_weak_battery_brings_it_home_early() {
    let kind = IncidentKind::Aircraft(AircraftFault::ChargeLost(BatteryUnits(40.0)));
    let incidents = vec![Incident { after: Duration::from_secs(10), kind }];
    // No decision pays for the landing: where the measured charge is the limit, the reserve must.
    let plan = MissionPlan { reserve: BatteryUnits(12.0), ..rd(4) };
    let flown = flown(plan, FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, texts(&flown));
    assert!((35.0..65.0).contains(&figures.energy.0), "{:?}", figures.energy);
}

#[test]
fn the_pack_loses_no_more_than_the_decisions_pay() {
    let flown = flown(rd(4), FlightScript::plain(1.0), Waiter);
    let pack = flown.simulation.setup().aircraft.pack;
    let taken = pack.capacity - flown.simulation.truth().battery;
    // Taking off and landing: 100 s at most.
    assert!(taken.0 <= flown.figures().energy.0 + 100.0 * pack.hover_per_s, "{taken:?}");
}

#[test]
fn the_picture_shows_devices_hovers_and_switches() {
    let switches = vec![Switch { after: Duration::from_secs(60), w_data: 0.1 }];
    let flown = flown(rd(5), FlightScript { switches, ..FlightScript::plain(1.0) }, Waiter);
    let picture = trajectory(&flown.simulation, &flown.figures(), "waiter");
    assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
    for part in ["RD, seed 5, 6 devices", "policy waiter", "hovered for ", "w 1.00 \u{2192} 0.10", "#time"] {
        assert!(picture.contains(part), "{part}");
    }
    let figures = flown.figures();
    let (percent, units) = (100.0 * figures.collected, figures.energy.0);
    assert!(
        picture.contains(&format!("{percent:.1} % of the data for {units} battery units")),
        "{figures:?}"
    );
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let files = || {
        let switches = vec![Switch { after: Duration::from_secs(30), w_data: 0.2 }];
        let plan = MissionPlan { wander_m: 0.2, ..rd(9) };
        let flown = flown(plan, FlightScript { switches, ..FlightScript::plain(0.9) }, Waiter);
        let (mut tlog, mut decisions) = (Vec::new(), Vec::new());
        flown.simulation.journal().write_tlog(&mut tlog).unwrap();
        flown.simulation.journal().write_decisions(flown.simulation.setup(), &mut decisions).unwrap();
        (tlog, decisions)
    };
    let (first, second) = (files(), files());
    assert!(first.0.len() > 100_000 && !first.1.is_empty());
    assert!(first == second);
}

#[test]
fn a_mission_on_px4_follows_the_same_rules() {
    let plan = MissionPlan { autopilot: AutopilotKind::Px4, ..rd(4) };
    let result = flown(plan, FlightScript::plain(0.0), Homeward);
    let figures = result.figures();
    assert!(figures.is_good(), "{:?} {:?} {}", figures.violations, texts(&result), result.waiting_for);
    assert_eq!(figures.energy.0, 32.0);
}

#[test]
fn a_take_over_on_px4_is_respected() {
    let after = Duration::from_secs(20);
    let incidents = vec![Incident { after, kind: IncidentKind::pilot_selects(VehicleMode::Hold) }];
    let plan = MissionPlan { autopilot: AutopilotKind::Px4, ..rd(4) };
    let result = flown(plan, FlightScript { incidents, ..FlightScript::plain(0.0) }, Homeward);
    assert_eq!(result.figures().violations, [], "{:?}", texts(&result));
    assert_eq!((result.ending, result.state), (Ending::TakenOver, Some(State::Passive)));
}

/// A waiter with look-ahead, from boot to landing; and every decision again from the log.
#[test]
fn a_flight_with_lookahead_lands_and_its_log_replays() {
    let plan = MissionPlan { devices: Some(3), battery: Some(BatteryUnits(60.0)), ..rd(6) };
    let script = || FlightScript {
        switches: vec![Switch { after: Duration::from_secs(60), w_data: 0.4 }],
        ..FlightScript::plain(0.9)
    };
    let alone = flown(plan, script(), Waiter).figures();
    let result = flown(plan, script(), LookingAhead::new(Waiter, Budget { tours: 60 }));
    let figures = result.figures();
    assert!(figures.is_good(), "{:?} {:?} {}", figures.violations, texts(&result), result.waiting_for);
    assert!(figures.collected > alone.collected + 0.1, "{} and {}", figures.collected, alone.collected);
    let mut log = Vec::new();
    result.simulation.journal().write_decisions(result.simulation.setup(), &mut log).unwrap();
    let (mut replay, mut count) = (LookAheadReplay::default(), 0);
    for line in log.split(|&byte| byte == b'\n').filter(|line| !line.is_empty()) {
        let logged: LoggedDecision = serde_json::from_slice(line).unwrap();
        let (Some(logits), Some(entry)) = (logged.logits, &logged.lookahead) else { continue };
        let again = replay.decide(&logged, entry, &logits);
        assert_eq!(again, Replayed::Choice(logged.action, entry.record), "decision {}", logged.sequence);
        count += 1;
    }
    assert!(count > 20, "{count}");
}

/// The program does not run for 3.5 s, as after SIGSTOP, and the human pilot selects HOLD (LOITER) late in that time: its
/// heartbeat waits behind seconds of older messages.
#[test]
fn a_take_over_during_a_stall_is_respected_on_both_autopilots() {
    let at = |millis, kind| Incident { after: Duration::from_millis(millis), kind };
    let stall = IncidentKind::Computer(ComputerFault::Stall(Duration::from_millis(3_500)));
    for autopilot in [AutopilotKind::ArduPilot, AutopilotKind::Px4] {
        let taken = at(23_000, IncidentKind::pilot_selects(VehicleMode::Hold));
        for (incidents, mode) in [
            (vec![at(20_000, stall), taken], VehicleMode::Hold),
            (vec![at(20_000, stall)], VehicleMode::Return),
        ] {
            let plan = MissionPlan { autopilot, ..rd(4) };
            let result = flown(plan, FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
            assert_eq!(result.figures().violations, [], "{autopilot} {:?}", texts(&result));
            assert_eq!(result.simulation.truth().mode, mode, "{autopilot} {:?}", texts(&result));
        }
    }
}

#[test]
fn an_origin_that_moves_ends_in_a_return_on_both_autopilots() {
    for autopilot in [AutopilotKind::ArduPilot, AutopilotKind::Px4] {
        let kind = IncidentKind::Aircraft(AircraftFault::OriginShift([-38.0, 0.0]));
        let incidents = vec![Incident { after: Duration::from_secs(20), kind }];
        let plan = MissionPlan { autopilot, ..rd(4) };
        let result = flown(plan, FlightScript { incidents, ..FlightScript::plain(1.0) }, Waiter);
        assert_eq!(result.figures().violations, [], "{autopilot} {:?}", texts(&result));
        assert_eq!(result.simulation.truth().mode, VehicleMode::Return, "{autopilot} {:?}", texts(&result));
        assert!(result.figures().decisions < 15, "{autopilot} {:?}", texts(&result));
    }
}
