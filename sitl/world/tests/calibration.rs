//! The data of the shortest missions, which calibrates noise and slot capacity against the paper.
//!
//! 100 evaluation realizations, K = 6, each flown ten times. The path is random: in each slot one of the moves that
//! approach the terminal is taken with equal probability, so no quadrant of the rectangle between start and terminal is
//! preferred.

use gleaner_units::Action;
use gleaner_world::{Episode, Realization, Scenario, Seed, Stream, World};
use rand::RngExt;
use std::sync::Arc;

const REALIZATIONS: u64 = 100;
const REPEATS: u32 = 10;

struct Outcome {
    fraction: f64,
    energy: f64,
}

/// Mean data fraction and energy over all realizations and repeats of a scenario flown by `choose`.
fn fly(scenario: &Scenario, choose: impl Fn(&Episode, &mut dyn FnMut(u32) -> u32) -> Action) -> Outcome {
    let world = Arc::new(World::default_world());
    let (mut fraction, mut energy, mut flights) = (0.0, 0.0, 0.0);
    for number in 0..REALIZATIONS {
        let seed = Seed::evaluation(number);
        let realization = Realization::draw(world.city(), scenario, seed).unwrap();
        for repeat in 0..REPEATS {
            let seed = seed.repeat(repeat);
            let mut rng = seed.rng(Stream::Choices);
            let mut episode = Episode::new(world.clone(), &realization, seed).unwrap();
            while !episode.is_done() {
                let action = choose(&episode, &mut |count| rng.random_range(0..count));
                episode.step(action).unwrap();
            }
            fraction += f64::from(episode.field().collected_fraction());
            energy += f64::from((realization.battery() - episode.battery()).0);
            flights += 1.0;
        }
    }
    Outcome { fraction: fraction / flights, energy: energy / flights }
}

#[test]
fn an_arbitrary_shortest_path_brings_a_quarter_of_the_data() {
    let outcome = fly(&Scenario::reach_destination(), |episode, draw| {
        let distance = episode.uav().manhattan(episode.terminal());
        let approaching: Vec<Action> = Action::MOVES
            .into_iter()
            .filter(|&action| episode.uav().after(action).manhattan(episode.terminal()) < distance)
            .collect();
        approaching[draw(approaching.len() as u32) as usize]
    });
    println!("RD, random shortest paths: data {:.4}, energy {:.2}", outcome.fraction, outcome.energy);
    assert_eq!(outcome.energy, 32.0);
    assert!((outcome.fraction - 0.25).abs() <= 0.02, "{}", outcome.fraction);
}

#[test]
fn out_and_back_brings_two_percent_of_the_data() {
    let outcome = fly(&Scenario::return_base(), |episode, draw| {
        let back =
            Action::MOVES.into_iter().find(|&action| episode.uav().after(action) == episode.terminal());
        back.unwrap_or_else(|| Action::MOVES[draw(4) as usize])
    });
    println!("RB, out and back: data {:.4}, energy {:.2}", outcome.fraction, outcome.energy);
    assert_eq!(outcome.energy, 2.0);
    assert!((outcome.fraction - 0.018).abs() <= 0.005, "{}", outcome.fraction);
}
