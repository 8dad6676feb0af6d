//! Missions of the baselines (GREEDY, the oracle and the proven bound), and the gain of a second thread.

use super::timing::{Contender, in_turns};
use super::world::count;
use anyhow::Result;
use gleaner_host_trainer::judge::evaluation::{fly_greedy, realizations};
use gleaner_host_trainer::planner::oracle::{Thoroughness, consult};
use gleaner_host_trainer::planner::{Rates, upper_bound_percent};
use gleaner_world::{ScenarioKind, World};
use std::fmt::Write;
use std::hint::black_box;
use std::sync::Arc;
use std::thread;

const ROUNDS: usize = 5;
const REALIZATIONS: u64 = 4;
/// As `gleaner-train oracle` searches by default.
const TOURS: u32 = 100_000;
/// Nodes of the bound's search tree.
const NODES: u32 = 200;
/// Calls of [`count`] of each thread.
const CALLS: u64 = 20;

/// Times per mission, and the gain of a second thread.
pub(super) fn missions(page: &mut String) -> Result<()> {
    let world = Arc::new(World::default_world());
    let drawn = realizations(&world, &ScenarioKind::ReachDestination.scenario(), REALIZATIONS)?;
    let rates = Rates::new(Arc::clone(&world));
    let (_, first) = drawn.first().ok_or_else(|| anyhow::anyhow!("no realization"))?;
    let greedy = || drop(black_box(fly_greedy(&world, &drawn)));
    let oracle = || drop(black_box(consult(&rates, first, Thoroughness { tours: TOURS })));
    let bound = || {
        let _ = black_box(upper_bound_percent(&rates, first, 0.0, NODES));
    };
    let mut contenders = [
        Contender::ours("GREEDY", 1, greedy),
        Contender::ours("oracle, eleven preferences", 1, oracle),
        Contender::ours("bound", 1, bound),
    ];
    let mut times = in_turns(&mut contenders, ROUNDS)?;
    if let Some(greedy) = times.first_mut() {
        greedy.divide(REALIZATIONS as f64);
    }
    writeln!(
        page,
        "## Planning\n\nOne mission of RD with six devices. The oracle searches {TOURS} tours twice for each preference, the \
         bound {NODES} nodes.\n\n| planner | time per mission |\n|---|---|"
    )?;
    for (contender, times) in contenders.iter().zip(&times) {
        writeln!(page, "| {} | {} |", contender.name, times.text())?;
    }
    let on_threads = |threads: usize| {
        move || {
            thread::scope(|scope| {
                (0..threads).for_each(|_| drop(scope.spawn(|| count(CALLS))));
            });
        }
    };
    let mut threads = [Contender::ours("one", 1, on_threads(1)), Contender::ours("two", 1, on_threads(2))];
    let times = in_turns(&mut threads, ROUNDS)?;
    if let [one, two] = times.as_slice() {
        let gain = 2.0 * one.median() / two.median();
        writeln!(
            page,
            "\nEnvironment steps with guard and tokens, on two threads instead of one: {gain:.2} times as many a second."
        )?;
    }
    Ok(())
}
