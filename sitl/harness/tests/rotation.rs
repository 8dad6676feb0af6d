//! Missions on a grid that is rotated against north.

use gleaner_harness::{FlightResult, FlightScript, MissionPlan, MissionSetup, fly};
use gleaner_policy::{Attention, Inference, Policy, Tokens};
use gleaner_units::{Action, Degrees};
use gleaner_world::{ScenarioKind, World};
use std::sync::Arc;

/// Prefers the moves towards the terminal.
struct Homeward;

impl Policy for Homeward {
    type Error = ();

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, ()> {
        let [_, _, east_m, north_m] = tokens.uav;
        let mut logits = [0.0; Action::COUNT];
        logits[Action::East.index()] = east_m;
        logits[Action::West.index()] = -east_m;
        logits[Action::North.index()] = north_m;
        logits[Action::South.index()] = -north_m;
        logits[Action::Hover.index()] = f32::MIN;
        Ok(Inference { logits, attention: Attention::NONE })
    }
}

fn flown(rotation_deg: f32) -> FlightResult {
    let plan = MissionPlan::new(ScenarioKind::ReachDestination, 5);
    let plan = MissionPlan { rotation: Degrees(rotation_deg), ..plan };
    let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
    let flown = fly(setup, FlightScript::plain(0.0), Homeward, Ok(())).unwrap();
    assert_eq!(flown.figures().violations, [], "{rotation_deg}: {:?}", flown.texts);
    assert!(flown.figures().is_good(), "{rotation_deg}: {:?}", flown.texts);
    flown
}

fn decisions(flown: &FlightResult) -> Vec<(gleaner_units::Cell, Action)> {
    flown.simulation.journal().slots().iter().map(|slot| (slot.record.cell, slot.record.action)).collect()
}

/// From the first to the last decision over the ground: east and north, m.
fn path(flown: &FlightResult) -> [f32; 2] {
    let (setup, slots) = (flown.simulation.setup(), flown.simulation.journal().slots());
    let centre = |index: usize| setup.frame.centre(slots[index].record.cell, 0.0).horizontal();
    let path = centre(slots.len() - 1) - centre(0);
    [path.x, path.y]
}

#[test]
fn decisions_are_those_of_the_unrotated_grid() {
    let straight = flown(0.0);
    for rotation_deg in [37.0_f32, -90.0, 180.0] {
        let rotated = flown(rotation_deg);
        assert_eq!(decisions(&rotated), decisions(&straight), "{rotation_deg}");
        let (sin, cos) = rotation_deg.to_radians().sin_cos();
        let ([east, north], [x, y]) = (path(&rotated), path(&straight));
        let (expected_east, expected_north) = (x * cos + y * sin, y * cos - x * sin);
        assert!((east - expected_east).abs() < 0.05, "{rotation_deg}: {east} {expected_east}");
        assert!((north - expected_north).abs() < 0.05, "{rotation_deg}: {north} {expected_north}");
    }
}
