//! The oracle: its plans can be flown, and they are better than GREEDY.

use gleaner_host_trainer::judge::evaluation::{evaluate_greedy, realizations, test_preferences};
use gleaner_host_trainer::planner::oracle::{OracleSetting, Thoroughness, consult};
use gleaner_host_trainer::planner::{Effort, Problem, Rates, Tour, initial_state};
use gleaner_units::{Action, BatteryUnits};
use gleaner_world::{Realization, ScenarioKind, Seed, World};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::process::{Command, Output};
use std::sync::Arc;

const QUICK: Thoroughness = Thoroughness { tours: 4_000 };

#[test]
fn oracle_beats_greedy_and_flies_the_shortest_way() {
    let world = Arc::new(World::default_world());
    let rates = Rates::new(Arc::clone(&world));
    for (kind, least) in [(ScenarioKind::ReachDestination, 32.0), (ScenarioKind::ReturnBase, 2.0)] {
        let drawn = realizations(&world, &kind.scenario(), 10).unwrap();
        let rewards: Vec<_> =
            drawn.iter().map(|(_, realization)| consult(&rates, realization, QUICK)).collect();
        let data = rewards.iter().map(|rewards| rewards.last().unwrap()[0]).sum::<f32>() / 10.0;
        let greedy = evaluate_greedy(&world, &drawn).coverage();
        assert!(data > greedy + 10.0, "{kind}: {data} % against {greedy} %");
        for rewards in rewards {
            assert_eq!(rewards.len(), test_preferences().len());
            assert_eq!(rewards[0][1], -least, "{kind}");
            assert!(rewards.iter().all(|reward| reward[0] <= 100.0 + 1e-3 && reward[1] >= -80.0));
        }
    }
}

#[test]
fn every_tour_of_the_search_can_be_flown() {
    let world = Arc::new(World::default_world());
    let rates = Rates::new(Arc::clone(&world));
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for number in 0..40 {
        let kind = ScenarioKind::ALL[number as usize % 2];
        let battery = BatteryUnits(40.0 + 2.0 * number as f32);
        let scenario = kind.scenario().with_devices(1 + number as usize % 12).with_battery(battery);
        let realization = Realization::draw(world.city(), &scenario, Seed::training(number)).unwrap();
        let (known, state) = (rates.study(&realization), initial_state(&realization));
        let problem = Problem { model: &known, state: &state, w_data: 0.9 };
        // A high temperature to the end gives an arbitrary tour.
        let hot = Effort { tours: 300, temperatures: [1e6, 1e6] };
        for tour in [problem.anneal(Tour::default(), hot, &mut rng).1, Tour::default()] {
            let mut end = state;
            end.finish(&known, &tour);
            assert!(end.over, "the terminal is reached");
            assert!(end.hovers_left >= 0, "and the battery lasts");
            let left: f32 = end.remaining.iter().sum();
            let held: f32 = state.remaining.iter().sum();
            assert!((end.collected + left - held).abs() < 1.0, "data is neither made nor lost");
        }
    }
}

#[test]
fn planned_data_is_the_mean_of_flown_data() {
    // The mean over many draws of the shadowing, slot by slot.
    let world = Arc::new(World::default_world());
    let rates = Rates::new(Arc::clone(&world));
    let scenario = ScenarioKind::ReachDestination.scenario().with_devices(1);
    let realization = Realization::draw(world.city(), &scenario, Seed::training(7)).unwrap();
    let known = rates.study(&realization);
    let mut planned = initial_state(&realization);
    planned.remaining[0] = f32::INFINITY;
    let above = realization.devices()[0].cell;
    planned.cell = above;
    planned.slot(&known, Action::Hover);
    let channel = world.channel();
    let mean = world.mean_snr(above, above).unwrap();
    let expected = channel.expected_data_per_slot(true, mean);
    assert!((planned.collected - expected).abs() < 0.01 * expected, "{} {expected}", planned.collected);
}

fn command(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gleaner-train")).arg("oracle").args(arguments).output().unwrap()
}

/// The one-line error of a refused command.
fn refused(output: Output) -> String {
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    message
}

#[test]
fn bounds_can_be_added_to_a_file_of_plans() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("oracle.jsonl");
    let file = path.to_str().unwrap();
    let quick = ["--out", file, "--realizations", "2", "--tours", "50"];
    let settings = || -> Vec<OracleSetting> {
        let text = fs::read_to_string(&path).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    assert!(command(&quick).status.success());
    let planned = settings();
    assert_eq!(planned.len(), 10);
    assert!(planned.iter().all(|setting| setting.upper_bound_percent.is_empty()));

    let output = command(&[&quick[..], &["--bound", "3"]].concat());
    assert!(output.status.success());
    let message = String::from_utf8(output.stdout).unwrap();
    assert_eq!(message.matches("upper bound").count(), 10, "{message}");
    let bounded = settings();
    for (before, after) in planned.iter().zip(&bounded) {
        assert_eq!(
            (&before.missions, after.upper_bound_percent.len(), after.bound_parts),
            (&after.missions, 2, 3)
        );
        for (mission, bound) in after.upper_bound_percent.iter().enumerate() {
            let most = after.missions.0.iter().map(|missions| missions[mission][0]).fold(0.0, f32::max);
            assert!((most - 1e-3..=100.0).contains(bound), "{bound} % is proven and {most} % planned");
        }
    }
    // A smaller effort computes nothing again.
    assert!(command(&[&quick[..], &["--bound", "2"]].concat()).status.success());
    assert_eq!(settings(), bounded);
}

#[test]
fn damaged_file_is_refused_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("oracle.jsonl");
    fs::write(&path, "{\"scenario\":\"rd\"").unwrap();
    let message = refused(command(&["--out", path.to_str().unwrap(), "--realizations", "1", "--tours", "1"]));
    assert!(message.contains("line 1 is not a line of"), "{message}");
    assert_eq!(fs::read_to_string(&path).unwrap(), "{\"scenario\":\"rd\"");
}

#[test]
fn too_many_devices_are_refused() {
    let asked = ["evaluate", "--devices", "13", "--realizations", "1", "--oracle", "1"];
    let message = refused(Command::new(env!("CARGO_BIN_EXE_gleaner-train")).args(asked).output().unwrap());
    assert!(message.contains("at most 12"), "{message}");
}
