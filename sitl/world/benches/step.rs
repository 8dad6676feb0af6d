//! Time of one slot, one reset and one city.

use criterion::{Criterion, criterion_group, criterion_main};
use gleaner_units::Action;
use gleaner_world::{City, Episode, Realization, Scenario, Seed, World};
use std::hint::black_box;
use std::sync::Arc;

fn step(c: &mut Criterion) {
    let world = Arc::new(World::default_world());
    let scenario = Scenario::reach_destination();
    let realizations: Vec<Realization> = (0..64)
        .map(|number| {
            Realization::draw(world.city(), &scenario, Seed::training(number)).expect("the city has room")
        })
        .collect();
    let mut episode = Episode::new(world.clone(), &realizations[0], Seed::training(0)).expect("same city");
    let mut number = 0;
    let mut turn = 0;
    c.bench_function("step, 6 devices", |b| {
        b.iter(|| {
            turn += 1;
            if turn % 64 == 0 {
                number += 1;
                episode
                    .reset(&realizations[number as usize % 64], Seed::training(number))
                    .expect("same city");
            }
            let action = if turn % 2 == 0 { Action::Hover } else { Action::MOVES[turn / 2 % 4] };
            black_box(episode.step(action)).expect("the tour stays in the city and within the battery")
        });
    });
    c.bench_function("reset, 6 devices", |b| {
        b.iter(|| {
            number += 1;
            episode.reset(&realizations[number as usize % 64], Seed::training(number)).expect("same city");
        });
    });
    c.bench_function("draw a realization, 6 devices", |b| {
        b.iter(|| {
            number += 1;
            Realization::draw(world.city(), &scenario, Seed::training(number)).expect("the city has room")
        });
    });
}

fn city(c: &mut Criterion) {
    let heights = City::default_city().heights().clone();
    c.bench_function("city with its table of sight", |b| b.iter(|| City::new(black_box(heights.clone()))));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = step, city
}
criterion_main!(benches);
