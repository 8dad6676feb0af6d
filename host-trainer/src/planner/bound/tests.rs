use super::*;
use crate::judge::evaluation::realizations;
use crate::planner::{Effort, Problem, Tour, initial_state};
use gleaner_world::{ScenarioKind, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

const SIDE: usize = 3;
/// Nodes of the bounds. On the small missions below they lower the mean gap from 13.5 % of the data (one node) to 5.4 %.
const NODES: u32 = 200;
/// Limit of the mean gap between bound and optimum, as a share of the data: the measured 5.4 % and a margin. Branching that
/// has stopped working gives 13.5 %.
const GAP_MAX: f64 = 0.07;

/// Nine cells, two devices, each received over about half of the cells, and a battery for at most ten slots.
fn small(rng: &mut ChaCha8Rng) -> Mission {
    let mut rates = || {
        let rate = |_| if rng.random_bool(0.5) { rng.random_range(50.0_f64..700.0).round() } else { 0.0 };
        (0..SIDE * SIDE).map(rate).collect()
    };
    let rates = vec![rates(), rates()];
    let neighbours = |cell: usize| {
        let (x, y) = (cell % SIDE, cell / SIDE);
        let is_neighbour = |other: &usize| (other % SIDE).abs_diff(x) + (other / SIDE).abs_diff(y) == 1;
        (0..SIDE * SIDE).filter(is_neighbour).collect()
    };
    Mission {
        rates,
        data: vec![rng.random_range(300.0..2_000.0), rng.random_range(300.0..2_000.0)],
        battery: f64::from(rng.random_range(8..=10)) / 2.0,
        start: rng.random_range(0..SIDE * SIDE),
        terminal: rng.random_range(0..SIDE * SIDE),
        neighbours: (0..SIDE * SIDE).map(neighbours).collect(),
    }
}

/// The optimum by exhaustive search; `None` if the terminal is out of reach.
fn optimum(mission: &Mission, cell: usize, half_units: i32, data: &[f64]) -> Option<f64> {
    let mut best: Option<f64> = None;
    for device in 0..data.len() {
        let sent = mission.rates[device][cell].min(data[device]);
        let mut left = data.to_vec();
        left[device] -= sent;
        let mut consider = |then: Option<f64>| {
            best = then.map_or(best, |then| Some(best.map_or(sent + then, |best| best.max(sent + then))));
        };
        if half_units >= 1 {
            consider(optimum(mission, cell, half_units - 1, &left));
        }
        for &next in mission.neighbours[cell].iter().filter(|_| half_units >= 2) {
            let then = if next == mission.terminal {
                Some(0.0)
            } else {
                optimum(mission, next, half_units - 2, &left)
            };
            consider(then);
        }
    }
    best
}

#[test]
fn bound_is_above_the_optimum_and_close_to_it() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut gaps, mut cases) = ([0.0; 2], 0);
    for _ in 0..60 {
        let mission = small(&mut rng);
        let Some(best) = optimum(&mission, mission.start, (2.0 * mission.battery) as i32, &mission.data)
        else {
            assert_eq!(mission.bound(0.0, NODES), 0.0, "the terminal is out of reach");
            continue;
        };
        let [few, many] = [1, NODES].map(|nodes| mission.bound(0.0, nodes));
        assert!(many >= best - 1e-6, "bound {many} is below the optimum {best}");
        assert!(many <= few, "more nodes raised the bound from {few} to {many}");
        let all: f64 = mission.data.iter().sum();
        gaps = [gaps[0] + (few - best) / all, gaps[1] + (many - best) / all];
        cases += 1;
    }
    assert!(cases > 40, "only {cases} missions can reach their terminal");
    let [at_root, gap] = gaps.map(|gap| gap / f64::from(cases));
    println!("mean gap {gap:.4} of the data with {NODES} nodes, {at_root:.4} with one");
    assert!(gap < GAP_MAX, "mean gap between bound and optimum: {gap:.4} of the data");
}

#[test]
fn bound_is_above_the_oracle_and_below_all_data() {
    let world = Arc::new(World::default_world());
    let rates = Rates::new(Arc::clone(&world));
    let drawn = realizations(&world, &ScenarioKind::ReachDestination.scenario(), 5).unwrap();
    let bounds: Vec<f32> = drawn
        .iter()
        .map(|(_, realization)| {
            let (known, state) = (rates.study(realization), initial_state(realization));
            let problem = Problem { model: &known, state: &state, w_data: 1.0 };
            let effort = Effort { tours: 2_000, temperatures: [5.0, 0.03] };
            let (reached, _) = problem.anneal(Tour::default(), effort, &mut ChaCha8Rng::seed_from_u64(0));
            let bound = upper_bound_percent(&rates, realization, reached, NODES);
            assert!(bound >= reached - 1e-3, "bound {bound} % is below the plan's {reached} %");
            bound
        })
        .collect();
    // In realizations 1 and 4 the devices are far from each other and from the direct path.
    assert!(bounds[1] < 97.0 && bounds[4] < 97.0, "{bounds:?}");
}
