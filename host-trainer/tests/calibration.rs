//! GREEDY against the calibration of the world: means over 100 realizations at w = (1, 0), within 5 points.

use gleaner_host_trainer::judge::evaluation::{evaluate_greedy, realizations};
use gleaner_units::BatteryUnits;
use gleaner_world::{ScenarioKind, World};
use std::sync::Arc;

/// Scenario, K, B, percent of the data in the calibration of the world's constants.
const CALIBRATION: [(ScenarioKind, usize, f32, f32); 10] = [
    (ScenarioKind::ReachDestination, 3, 80.0, 93.2),
    (ScenarioKind::ReturnBase, 3, 80.0, 87.9),
    (ScenarioKind::ReachDestination, 5, 80.0, 78.2),
    (ScenarioKind::ReturnBase, 5, 80.0, 75.4),
    (ScenarioKind::ReachDestination, 6, 80.0, 70.9),
    (ScenarioKind::ReturnBase, 6, 80.0, 68.2),
    (ScenarioKind::ReachDestination, 9, 80.0, 60.8),
    (ScenarioKind::ReturnBase, 9, 80.0, 55.3),
    (ScenarioKind::ReachDestination, 10, 100.0, 68.2),
    (ScenarioKind::ReturnBase, 10, 100.0, 65.2),
];

#[test]
fn greedy_matches_the_calibration() {
    let world = Arc::new(World::default_world());
    for (kind, devices, battery, expected) in CALIBRATION {
        let scenario = kind.scenario().with_devices(devices).with_battery(BatteryUnits(battery));
        let drawn = realizations(&world, &scenario, 100).unwrap();
        let table = evaluate_greedy(&world, &drawn);
        println!("{kind} K={devices} B={battery}: {:.1} % (calibration {expected:.1} %)", table.coverage());
        assert!(
            (table.coverage() - expected).abs() <= 5.0,
            "{kind} K={devices} B={battery}: {:.1} %, calibration {expected:.1} %",
            table.coverage()
        );
        assert_eq!(table.least_energy(), if kind == ScenarioKind::ReachDestination { 32.0 } else { 2.0 });
    }
}
