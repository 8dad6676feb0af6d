//! Look-ahead: a flight, its replay, the switch in flight, and the cases in which the network decides alone.

use crate::bench::Bench;
use crate::rig::{Rig, Scripted, mission};
use gleaner_link::FlightMode;
use gleaner_lookahead::ChannelModel;
use gleaner_pilot::{
    Budget, ChannelAware, Decision, LookAheadRecord, LookingAhead, Mission, Request, Source, State,
};
use gleaner_policy::ChannelOffset;
use gleaner_units::{Action, Cell, Db};

const BUDGET: Budget = Budget { tours: 80 };

/// The usual mission with a building.
fn built() -> Mission {
    let mut mission = mission();
    mission.heights.set(Cell::new(3, 3), 40);
    mission
}

/// An engaged rig with look-ahead. Its network only hovers.
fn engaged(mission: Mission) -> Rig {
    let mut rig = Rig::with(mission, true);
    rig.set("GLN_LOOKAHEAD", 1.0);
    rig.set("GLN_W_DATA", 0.9);
    let network = Scripted { actions: Default::default(), ..rig.policy.clone() };
    rig.ahead = Some(LookingAhead::new(network, BUDGET));
    rig.engage();
    rig
}

/// What the devices report from `cell` when the gain is off by this much; the nearest one sends `units`.
fn report(rig: &mut Rig, cell: Cell, offset_db: f32, units: f32) {
    let squared = |device: Cell| {
        let (dx, dy) = (f32::from(device.x - cell.x), f32::from(device.y - cell.y));
        400.0 * (dx * dx + dy * dy) + 3600.0
    };
    for device in &mut rig.devices.0 {
        let mean_db = ChannelModel::NOMINAL.mean_snr_db(true, 0.5 * squared(device.cell).log10());
        device.snr = Some(Db(mean_db + offset_db));
    }
    let with_data = rig.devices.0.iter_mut().filter(|device| device.remaining > 0.0);
    if let Some(device) = with_data.min_by(|a, b| squared(a.cell).total_cmp(&squared(b.cell))) {
        device.remaining = (device.remaining - units).max(0.0);
    }
}

/// Polls until the next decision; its action and record.
fn decide(rig: &mut Rig, offset_db: f32) -> Option<(Action, LookAheadRecord)> {
    decide_sending(rig, offset_db, 500.0)
}

fn decide_sending(rig: &mut Rig, offset_db: f32, units: f32) -> Option<(Action, LookAheadRecord)> {
    for _ in 0..20 * 60 {
        if rig.state() != State::Engaged {
            return None;
        }
        if rig.step().decided {
            let decision = rig.machine.decision()?.clone();
            report(rig, decision.cell.after(decision.action), offset_db, units);
            return Some((decision.action, decision.lookahead?));
        }
    }
    None
}

#[test]
fn lookahead_collects_where_the_network_only_hovers() {
    let mut rig = engaged(built());
    let mut records = Vec::new();
    while let Some((_, record)) = decide(&mut rig, 0.0) {
        records.push(record);
    }
    rig.run_to(State::Done);
    let left: f32 = rig.devices.0.iter().map(|device| device.remaining).sum();
    assert!(left < 1_000.0, "{left} of 8,000 units are left");
    assert!(records.iter().all(|record| record.tours == BUDGET.tours && record.expected.is_some()));
    assert!(records.iter().enumerate().all(|(slot, record)| usize::from(record.slot) == slot));
    assert!(records.iter().any(|record| record.source == Source::KeptPlan), "{records:?}");
}

#[test]
fn lookahead_switches_in_flight_at_the_next_decision() {
    let mut rig = engaged(built());
    let mut budgets = Vec::new();
    for switch in [1.0, 0.0, 1.0] {
        rig.set("GLN_LOOKAHEAD", switch);
        for _ in 0..3 {
            let (action, record) = decide(&mut rig, 0.0).unwrap();
            budgets.push((record.budget, record.tours));
            if switch == 0.0 {
                assert_eq!((action, record.source, record.expected), (Action::Hover, Source::Network, None));
            }
        }
    }
    let (on, off) = ((BUDGET.tours, BUDGET.tours), (0, 0));
    assert_eq!(budgets, [on, on, on, off, off, off, on, on, on]);
}

#[test]
fn without_a_map_the_network_decides_and_the_operator_knows() {
    let mut rig = engaged(mission());
    for _ in 0..4 {
        let (action, record) = decide(&mut rig, 0.0).unwrap();
        assert_eq!((action, record.source, record.tours), (Action::Hover, Source::Network, 0));
    }
    assert_eq!(rig.said("no look-ahead, network decides"), 1);
}

#[test]
fn reports_that_no_channel_explains_leave_it_to_the_network() {
    let mut rig = engaged(built());
    let mut last = None;
    for slot in 0..40 {
        let offset_db = if slot % 2 == 0 { 60.0 } else { -60.0 };
        last = decide_sending(&mut rig, offset_db, 50.0).or(last);
    }
    let (_, record) = last.unwrap();
    assert_eq!(
        (record.source, record.tours, record.budget),
        (Source::Network, 0, BUDGET.tours),
        "{record:?}"
    );
    assert_eq!(rig.said("no look-ahead, network decides"), 1);
}

#[test]
fn the_channel_offset_is_in_record_and_telemetry() {
    let mut rig = engaged(built());
    let mut last = None;
    while let Some(decided) = decide(&mut rig, -5.0) {
        last = Some(decided);
    }
    let (_, record) = last.unwrap();
    let [_, offset_db] = record.channel.gain_db;
    assert!((-7.0..-3.0).contains(&offset_db), "{record:?}");
    assert!(rig.telemetry.unwrap().snr_off.is_some_and(|snr_off| (-7.0..-2.0).contains(&snr_off)));
    let mut alone = Rig::engaged();
    alone.run(5.0);
    assert_eq!(alone.telemetry.unwrap().snr_off, None);
}

/// The decision after ten slots of hovering on a channel that is off by this much.
fn hovered(mut rig: Rig, offset_db: f32) -> Decision {
    for _ in 0..10 {
        while !rig.step().decided {}
        let cell = rig.machine.decision().unwrap().cell;
        report(&mut rig, cell, offset_db, 100.0);
    }
    rig.machine.decision().unwrap().clone()
}

#[test]
fn network_alone_sees_the_yields_of_a_weaker_channel() {
    let with_lookahead_off = || {
        let mut rig = engaged(built());
        rig.set("GLN_LOOKAHEAD", 0.0);
        rig
    };
    let on_a_board = || {
        let mut rig = Rig::with(built(), true);
        let network = Scripted { actions: Default::default(), ..rig.policy.clone() };
        rig.aware = Some(ChannelAware::new(network));
        rig.engage();
        rig
    };
    for rig in [&with_lookahead_off as &dyn Fn() -> Rig, &on_a_board] {
        let (nominal, stronger, weaker) = (hovered(rig(), 0.0), hovered(rig(), 6.0), hovered(rig(), -6.0));
        assert_eq!((nominal.channel, stronger.channel), (ChannelOffset::NONE, ChannelOffset::NONE));
        assert_eq!(stronger.tokens.local_map, nominal.tokens.local_map);
        assert!((-8.0..-4.0).contains(&weaker.channel.gain_db), "{:?}", weaker.channel);
        assert_eq!(weaker.record().channel, weaker.channel);
        let sum = |decision: &Decision| decision.tokens.local_map.iter().sum::<f32>();
        assert!(sum(&weaker) < 0.95 * sum(&nominal), "{} of {}", sum(&weaker), sum(&nominal));
    }
    let mut board = on_a_board();
    board.run(30.0);
    assert!(board.telemetry.unwrap().snr_off.is_some());
    // The next mission has heard nothing yet.
    board.vehicle.mode = Some(FlightMode::Hold);
    board.run(1.0);
    board.request = Some(Request::Engage);
    board.step();
    let telemetry = (0..40).find_map(|_| board.step().telemetry).unwrap();
    assert_eq!((board.state(), telemetry.snr_off), (State::Waiting, None));
}

#[test]
fn a_program_with_one_model_keeps_the_choice_at_0() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    let set = mavlink::dialects::ardupilotmega::PARAM_SET_DATA {
        param_value: 1.0,
        target_system: bench.onboard.link().address().system,
        target_component: 191,
        param_id: "GLN_MODEL".into(),
        param_type: mavlink::dialects::ardupilotmega::MavParamType::MAV_PARAM_TYPE_REAL32,
    };
    bench.hear(crate::bench::STATION, &set);
    bench.run(8);
    assert_eq!(bench.onboard.parameters().model(), 0);
    let texts = bench.texts();
    assert!(texts.iter().any(|text| text == "gleaner: no other model is installed"), "{texts:?}");
}

#[test]
fn a_program_without_lookahead_keeps_the_parameter_at_0() {
    let mut bench = Bench::new(Ok(()));
    bench.run(8);
    let set = mavlink::dialects::ardupilotmega::PARAM_SET_DATA {
        param_value: 1.0,
        target_system: bench.onboard.link().address().system,
        target_component: 191,
        param_id: "GLN_LOOKAHEAD".into(),
        ..mavlink::dialects::ardupilotmega::PARAM_SET_DATA::DEFAULT
    };
    bench.hear(crate::bench::STATION, &set);
    bench.run(8);
    assert!(!bench.onboard.parameters().looks_ahead());
    assert!(
        bench.texts().iter().any(|text| text == "gleaner: this program has no look-ahead"),
        "{:?}",
        bench.texts()
    );
}

#[cfg(feature = "std")]
#[test]
fn a_replay_makes_every_decision_again_bit_by_bit() {
    use gleaner_pilot::{LoggedDecision, LoggedLookAhead, LookAheadReplay, Replayed};
    let mut rig = engaged(built());
    let mut log = Vec::new();
    for slot in 0.. {
        rig.set("GLN_LOOKAHEAD", if (5..8).contains(&slot) { 0.0 } else { 1.0 });
        // What the look-ahead is given stands in the devices before the decision.
        let devices = rig.devices.0.clone();
        if decide(&mut rig, -3.0).is_none() {
            break;
        }
        let decision = rig.machine.decision().unwrap();
        let settings = (rig.parameters.altitude(), rig.parameters.reserve());
        let entry = LoggedLookAhead::new(decision.lookahead.unwrap(), &rig.mission, settings, devices);
        log.push((LoggedDecision::new(7, decision, None), entry));
    }
    assert!(log.len() > 15, "{}", log.len());
    let mut replay = LookAheadReplay::default();
    for (logged, entry) in &log {
        let again = replay.decide(logged, entry, &logged.logits.unwrap());
        assert_eq!(again, Replayed::Choice(logged.action, entry.record), "slot {}", entry.record.slot);
    }
    // Without the first line there is no mission to fly in.
    let (logged, entry) = &log[1];
    let logits = logged.logits.unwrap();
    assert_eq!(LookAheadReplay::default().decide(logged, entry, &logits), Replayed::Incomplete);
}
