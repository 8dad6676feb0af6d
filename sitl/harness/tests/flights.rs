//! Whole missions through real MAVLink bytes, flown by simple policies.

use gleaner_harness::{
    Breach, CopterMode, Ending, Flown, Incident, IncidentKind, MissionPlan, Referee, Staged, Switch, Truth,
    WireFault, Wishes, fly, trajectory,
};
use gleaner_pilot::State;
use gleaner_policy::{Attention, Inference, Policy, Tokens};
use gleaner_units::{Action, BatteryUnits, Duration, Instant};
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

fn flown<P: Policy>(plan: MissionPlan, wishes: Wishes, policy: P) -> Flown {
    fly(Staged::new(world(), plan).unwrap(), wishes, policy, Ok(())).unwrap()
}

fn rd(seed: u64) -> MissionPlan {
    MissionPlan::new(ScenarioKind::ReachDestination, seed)
}

fn texts(flown: &Flown) -> Vec<&str> {
    flown.texts.iter().map(|(_, text)| text.as_str()).collect()
}

#[test]
fn the_shortest_missions_cost_32_and_2_units() {
    for (kind, units) in [(ScenarioKind::ReachDestination, 32.0), (ScenarioKind::ReturnBase, 2.0)] {
        let flown = flown(MissionPlan::new(kind, 1), Wishes::plain(0.0), Homeward);
        let figures = flown.figures();
        assert_eq!(figures.violations, [], "{:?}", texts(&flown));
        assert_eq!(flown.ending, Ending::OnTheGround, "waited for {}", flown.waiting_for);
        assert!(figures.landed && figures.is_good());
        assert_eq!((figures.energy, figures.decisions), (BatteryUnits(units), units as u32));
        assert_eq!(flown.state, Some(State::Done));
    }
}

#[test]
fn a_flight_collects_what_an_episode_with_the_same_actions_collects() {
    for (seed, wander_m) in [(5, 0.0), (6, 0.3)] {
        let switches = vec![Switch { after: Duration::from_secs(60), w_data: 0.1 }];
        let plan = MissionPlan { wander_m, ..rd(seed) };
        let flown = flown(plan, Wishes { switches, ..Wishes::plain(1.0) }, Waiter);
        let figures = flown.figures();
        assert_eq!(figures.violations, []);
        assert!(figures.landed);
        let staged = flown.simulation.staged();
        let mut episode = Episode::new(world(), &staged.realization, staged.seed()).unwrap();
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
        // Hovering until the preference changes: the pilot has heard of it.
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
fn the_guard_brings_a_greedy_hoverer_home_on_its_last_unit() {
    let flown = flown(rd(2), Wishes::plain(1.0), Waiter);
    let figures = flown.figures();
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, texts(&flown));
    assert_eq!(figures.energy, BatteryUnits(80.0), "all of the budget, and not more");
    assert_eq!(figures.decisions, 2 * 48 + 32);
}

#[test]
fn switches_go_out_by_command_and_by_parameter() {
    let at = |seconds: u64, w_data: f32| Switch { after: Duration::from_secs(seconds), w_data };
    let switches = vec![at(10, 0.2), at(20, 0.9), at(30, 0.3)];
    let flown = flown(rd(3), Wishes { switches, ..Wishes::plain(0.0) }, Homeward);
    assert!(flown.figures().is_good());
    assert_eq!(flown.figures().switches, 3);
    let mut weights: Vec<f32> = flown.simulation.journal().slots().iter().map(|s| s.record.w_data).collect();
    weights.dedup();
    assert_eq!(weights, [0.0, 0.2, 0.9, 0.3]);
}

#[test]
fn taken_over_the_pilot_is_passive_and_stays_so() {
    let after = Duration::from_secs(40);
    for mode in [CopterMode::Loiter, CopterMode::Brake, CopterMode::Stabilize] {
        let incidents = vec![
            Incident { after, kind: IncidentKind::PilotSelects(mode) },
            // Giving GUIDED back is no request to engage.
            Incident {
                after: after + Duration::from_secs(20),
                kind: IncidentKind::PilotSelects(CopterMode::Guided),
            },
            Incident { after: after + Duration::from_secs(40), kind: IncidentKind::PilotSelects(mode) },
        ];
        let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(0.0) }, Homeward);
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
fn a_target_beyond_the_fence_is_noticed_by_the_lack_of_progress() {
    let incidents = vec![Incident { after: Duration::from_secs(1), kind: IncidentKind::Fence(150.0) }];
    let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(0.0) }, Homeward);
    let figures = flown.figures();
    assert_eq!(figures.violations, [], "{:?}", texts(&flown));
    assert!(!figures.landed);
    let said = |part: &str| texts(&flown).iter().any(|text| text.contains(part));
    assert!(said("no progress"), "{:?}", texts(&flown));
    assert_eq!((flown.ending, flown.state), (Ending::OnTheGround, Some(State::Fault)));
    assert_eq!(flown.simulation.truth().mode, CopterMode::Rtl, "handed back to the autopilot");
}

#[test]
fn an_autopilot_that_reboots_in_flight_is_left_alone() {
    let incidents = vec![Incident { after: Duration::from_secs(20), kind: IncidentKind::AutopilotReboots }];
    let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert_eq!(figures.violations, [], "{:?}", texts(&flown));
    assert_eq!(flown.ending, Ending::OnTheGround);
    assert!(!figures.landed && (8..=12).contains(&figures.decisions), "{figures:?}");
}

#[test]
fn after_a_fault_the_aircraft_is_handed_back_however_long_the_line_is_bad() {
    // Now and then a heartbeat comes through and shows that it is still ours; requests and answers are lost.
    let noise = IncidentKind::Wire(WireFault::LineNoise(8), Duration::from_secs(60));
    let incidents = vec![Incident { after: Duration::from_secs(20), kind: noise }];
    let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert_eq!(figures.violations, [], "{:?}", texts(&flown));
    assert_eq!((flown.ending, flown.state), (Ending::OnTheGround, Some(State::Fault)), "{:?}", texts(&flown));
    assert_eq!(flown.simulation.truth().mode, CopterMode::Rtl, "handed back to the autopilot");
    // What the pilot said; on the noisy line the operator need not have heard it.
    let said = |frame: &[u8]| frame.windows(14).any(|part| part == b"gleaner: fault");
    let lost = flown.simulation.journal().frames().find(|(_, frame)| said(frame));
    let (lost_at, _) = lost.expect("a fault");
    let bad_until = flown.engaged_at.unwrap() + Duration::from_secs(80);
    assert!(bad_until - lost_at > Duration::from_secs(20), "long enough for every attempt to be lost");
}

#[test]
fn an_estimator_that_fails_for_a_moment_is_waited_for_and_the_autopilots_landing_is_its_own() {
    for (millis, is_good) in [(800, true), (5_000, false)] {
        let kind = IncidentKind::EstimatorFails(Duration::from_millis(millis));
        let incidents = vec![Incident { after: Duration::from_secs(20), kind }];
        let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(1.0) }, Waiter);
        let figures = flown.figures();
        assert_eq!(figures.violations, [], "{:?}", texts(&flown));
        assert_eq!((flown.ending, figures.landed), (Ending::OnTheGround, is_good), "{:?}", texts(&flown));
        let state = if is_good { State::Done } else { State::Passive };
        assert_eq!(flown.state, Some(state), "{:?}", texts(&flown));
    }
}

#[test]
fn a_pilot_who_flew_while_the_line_was_cut_keeps_the_aircraft() {
    let at = |seconds, kind| Incident { after: Duration::from_secs(seconds), kind };
    let incidents = vec![
        at(20, IncidentKind::Wire(WireFault::LineCut, Duration::from_secs(25))),
        at(22, IncidentKind::PilotSelects(CopterMode::Rtl)),
        at(36, IncidentKind::PilotSelects(CopterMode::Guided)),
        at(80, IncidentKind::PilotSelects(CopterMode::Loiter)),
    ];
    let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(0.0) }, Homeward);
    assert_eq!(flown.figures().violations, [], "{:?}", texts(&flown));
    assert_eq!((flown.ending, flown.state), (Ending::TakenOver, Some(State::Fault)), "{:?}", texts(&flown));
    assert!(texts(&flown).iter().any(|text| text.contains("moved by another")), "{:?}", texts(&flown));
}

#[test]
fn the_referee_sees_a_pilot_that_takes_the_aircraft_back() {
    let flown = flown(rd(4), Wishes::plain(0.0), Homeward);
    let staged = flown.simulation.staged();
    let record = &flown.simulation.journal().slots()[0].record;
    let guided = Truth {
        mode: CopterMode::Guided,
        mode_is_companions: false,
        armed: true,
        on_ground: false,
        ..flown.simulation.truth()
    };
    let loiter = Truth { mode: CopterMode::Loiter, ..guided };
    let returns = Truth { mode: CopterMode::Rtl, mode_is_companions: true, ..guided };
    let now = Instant::from_millis(60_000);
    let judge = |acts: &dyn Fn(&mut Referee)| {
        let guard = staged.mission.guard(staged.plan.reserve).unwrap();
        let mut referee = Referee::new(staged, guard);
        referee.hear_decision(now, record, &guided);
        acts(&mut referee);
        referee.violations().iter().any(|violation| violation.breach == Breach::TookItBack)
    };
    let watch =
        |referee: &mut Referee, truths: &[Truth]| truths.iter().for_each(|truth| referee.watch(now, truth));
    assert!(!judge(&|referee| watch(referee, &[guided, returns])), "after a fault it may");
    assert!(judge(&|referee| watch(referee, &[guided, loiter, returns])));
    assert!(judge(&|referee| {
        watch(referee, &[loiter, guided]);
        referee.hear_decision(now, record, &guided);
    }));
    assert!(!judge(&|referee| {
        watch(referee, &[loiter, guided]);
        referee.hear_engage_request();
        referee.hear_decision(now, record, &guided);
    }));
}

#[test]
fn a_radio_that_falls_silent_costs_data_and_nothing_else() {
    let silent = IncidentKind::Wire(WireFault::RadioSilent, Duration::from_secs(60));
    let incidents = vec![Incident { after: Duration::from_secs(20), kind: silent }];
    let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(1.0) }, Waiter);
    assert!(flown.figures().is_good(), "{:?}", texts(&flown));
}

#[test]
fn a_battery_failsafe_sends_it_home() {
    let incidents = vec![Incident { after: Duration::from_secs(10), kind: IncidentKind::Voltage(10.2) }];
    let flown = flown(rd(4), Wishes { incidents, ..Wishes::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, texts(&flown));
    let hovers =
        flown.simulation.journal().slots().iter().filter(|s| s.record.action == Action::Hover).count();
    assert!((10..=12).contains(&hovers), "10 s, and the timer of 10 s: {hovers}");
    assert_eq!(figures.energy.0, 32.0 + 0.5 * hovers as f32);
}

#[test]
fn a_weak_battery_brings_it_home_early() {
    let kind = IncidentKind::LosesBattery(BatteryUnits(40.0));
    let incidents = vec![Incident { after: Duration::from_secs(10), kind }];
    // No decision pays for the landing: where the measured charge is the limit, the reserve must.
    let plan = MissionPlan { reserve: BatteryUnits(12.0), ..rd(4) };
    let flown = flown(plan, Wishes { incidents, ..Wishes::plain(1.0) }, Waiter);
    let figures = flown.figures();
    assert!(figures.is_good(), "{:?} {:?}", figures.violations, texts(&flown));
    assert!((35.0..65.0).contains(&figures.energy.0), "{:?}", figures.energy);
}

#[test]
fn flying_takes_no_more_from_the_pack_than_the_decisions_pay() {
    let flown = flown(rd(4), Wishes::plain(1.0), Waiter);
    let pack = flown.simulation.staged().copter.pack;
    let taken = pack.capacity - flown.simulation.truth().battery;
    // Taking off and landing: 100 s at most.
    assert!(taken.0 <= flown.figures().energy.0 + 100.0 * pack.hover_per_s, "{taken:?}");
}

#[test]
fn the_picture_shows_devices_hovers_and_switches() {
    let switches = vec![Switch { after: Duration::from_secs(60), w_data: 0.1 }];
    let flown = flown(rd(5), Wishes { switches, ..Wishes::plain(1.0) }, Waiter);
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
        let flown = flown(plan, Wishes { switches, ..Wishes::plain(0.9) }, Waiter);
        let (mut tlog, mut decisions) = (Vec::new(), Vec::new());
        flown.simulation.journal().write_tlog(&mut tlog).unwrap();
        flown
            .simulation
            .journal()
            .write_decisions(&flown.simulation.staged().mission, &mut decisions)
            .unwrap();
        (tlog, decisions)
    };
    let (first, second) = (files(), files());
    assert!(first.0.len() > 100_000 && !first.1.is_empty());
    assert!(first == second);
}
