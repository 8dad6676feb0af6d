//! How the aircraft follows the decided way: speed on straight cells, overshoot of stops, hovering.

use gleaner_harness::{AutopilotKind, FlightResult, FlightScript, MissionPlan, MissionSetup, fly};
use gleaner_policy::{Attention, Inference, Policy, Tokens};
use gleaner_units::{Action, Cell, Instant, MetresPerSecond};
use gleaner_world::{ScenarioKind, World};
use std::sync::Arc;

/// How a flight went along its decisions.
struct Flown {
    /// Mean speed over three straight cells and more, m/s.
    straight_mps: Vec<f32>,
    /// Largest distance beyond the centre of the last cell of a straight run, m.
    overshoot_m: f32,
    /// Distances from the centre in the second half of each slot of hovering, m.
    hover_off_m: Vec<f32>,
}

fn seconds(at: Instant) -> f32 {
    at.as_millis() as f32 * 1e-3
}

/// The cells in which the decisions end, and the times at which the track is nearest to them.
fn flown_cells(result: &FlightResult) -> Flown {
    let simulation = &result.simulation;
    let cell_m = simulation.setup().frame.grid().cell().0;
    let track: Vec<(f32, (f32, f32))> = simulation
        .journal()
        .track()
        .iter()
        .map(|point| (seconds(point.at), simulation.on_grid(&point.position)))
        .collect();
    let slots: Vec<_> = simulation.journal().slots().iter().filter(|slot| slot.flown).collect();
    let mut flown = Flown { straight_mps: Vec::new(), overshoot_m: 0.0, hover_off_m: Vec::new() };
    let centre = |cell: Cell| ((f32::from(cell.x) + 0.5) * cell_m, (f32::from(cell.y) + 0.5) * cell_m);
    let off = |(east, north): (f32, f32), to: (f32, f32)| (east - to.0).hypot(north - to.1);
    // Straight runs: the time between passing the second and the last but one centre.
    let mut first = 0;
    while first < slots.len() {
        let action = slots[first].record.action;
        let run = slots[first..].iter().take_while(|slot| slot.record.action == action).count();
        let cells: Vec<_> =
            slots[first..first + run].iter().map(|slot| slot.record.cell.after(action)).collect();
        let from_s = seconds(slots[first].at);
        let passed: Vec<f32> = cells
            .iter()
            .scan(from_s, |after, &cell| {
                let nearest = track
                    .iter()
                    .filter(|(at, _)| *at >= *after && *at <= *after + 40.0)
                    .min_by(|a, b| off(a.1, centre(cell)).total_cmp(&off(b.1, centre(cell))))?;
                *after = nearest.0;
                Some(nearest.0)
            })
            .collect();
        if action != Action::Hover && run >= 5 {
            let (low, high) = (passed[1], passed[run - 2]);
            flown.straight_mps.push((run - 3) as f32 * cell_m / (high - low));
        }
        // A stop: from the decision for its cell to the end of the first slot of hovering.
        if action != Action::Hover
            && let [stop, after, ..] = &slots[first + run..]
            && stop.record.action == Action::Hover
        {
            let (dx, dy) = action.offset();
            let end = centre(stop.record.cell);
            for (_, (east, north)) in track.iter().filter(|(at, _)| *at >= from_s && *at <= seconds(after.at))
            {
                let beyond = (east - end.0) * f32::from(dx) + (north - end.1) * f32::from(dy);
                flown.overshoot_m = flown.overshoot_m.max(beyond);
            }
        }
        if action == Action::Hover {
            for pair in slots[first..first + run].windows(2).skip(1) {
                let (from, to) = (seconds(pair[0].at), seconds(pair[1].at));
                let here = centre(pair[0].record.cell);
                let inside = track.iter().filter(|(at, _)| *at >= 0.5 * (from + to) && *at < to);
                flown.hover_off_m.extend(inside.map(|(_, place)| off(*place, here)));
            }
        }
        first += run;
    }
    flown
}

/// The direct way to the terminal with a stop of three slots after every five cells, or without.
struct Stages {
    stops: bool,
    asked: u32,
}

impl Policy for Stages {
    type Error = ();
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        self.asked += 1;
        let [_, _, east_m, north_m] = tokens.uav;
        let home = match () {
            () if east_m > 0.0 => Action::East,
            () if east_m < 0.0 => Action::West,
            () if north_m > 0.0 => Action::North,
            () => Action::South,
        };
        let wanted = if self.stops && self.asked % 9 > 5 { Action::Hover } else { home };
        let mut logits = [0.0; Action::COUNT];
        logits[home.index()] = 1.0;
        logits[wanted.index()] = 2.0;
        Ok(Inference { logits, attention: Attention::NONE })
    }
}

fn flown(plan: MissionPlan, stops: bool) -> Flown {
    let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
    let result = fly(setup, FlightScript::plain(0.5), Stages { stops, asked: 0 }, Ok(())).unwrap();
    assert!(result.figures().is_good(), "{:?} {:?}", result.figures().violations, result.texts);
    flown_cells(&result)
}

#[test]
fn straight_cells_are_flown_at_the_set_speed_and_stops_do_not_overshoot() {
    for kind in AutopilotKind::ALL {
        for speed_mps in [3.0, 6.0, 8.0, 10.0] {
            let speed = MetresPerSecond(speed_mps);
            let plan =
                MissionPlan { autopilot: kind, speed, ..MissionPlan::new(ScenarioKind::ReachDestination, 4) };
            let means = flown(plan, false).straight_mps;
            assert!(!means.is_empty());
            for mean in means {
                println!("{kind}, GLN_SPEED {speed_mps}: straight {mean:.2} m/s");
                assert!(
                    mean >= 0.9 * speed_mps && mean <= 1.02 * speed_mps,
                    "{kind}: {mean} of {speed_mps} m/s"
                );
            }
            if speed_mps < 5.0 {
                // A slot of hovering costs more than two moves there, so the flight goes home instead.
                continue;
            }
            let Flown { overshoot_m, hover_off_m, .. } = flown(plan, true);
            let worst_m = hover_off_m.iter().fold(0.0_f32, |worst, off| worst.max(*off));
            println!("{kind}, GLN_SPEED {speed_mps}: overshoot {overshoot_m:.2} m, hover {worst_m:.2} m off");
            assert!(overshoot_m <= 2.0, "{kind}: overshoot {overshoot_m} m");
            assert!(!hover_off_m.is_empty() && worst_m <= 0.5, "{kind}: hovers {worst_m} m off");
        }
    }
}
