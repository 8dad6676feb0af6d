//! The teacher is a teacher worth having, and a pupil of it survives a kill.

use clap::Parser;
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::judge::evaluation::{Network, evaluate_greedy, realizations};
use gleaner_host_trainer::keep::snapshot::Learned;
use gleaner_host_trainer::learn::distil::Distillation;
use gleaner_host_trainer::learn::learning::Learning;
use gleaner_host_trainer::learn::settings::Settings;
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::planner::teacher::Teacher;
use gleaner_host_trainer::systems::System;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::{ScenarioKind, World};
use rand::SeedableRng;
use std::sync::Arc;

/// Mean percent of the data and mean energy over realizations.
fn fly(world: &Arc<World>, kind: ScenarioKind, preference: Preference, count: u64) -> (f32, f32) {
    let teacher = Teacher::new(Arc::clone(world));
    let mut sum = (0.0, 0.0);
    for (seed, realization) in realizations(world, &kind.scenario(), count).unwrap() {
        let mut course = teacher.study(&realization);
        let mut flight = Flight::new(world, &realization, seed, preference).unwrap();
        while !flight.is_over() {
            // Panics on an action outside the guard's mask.
            flight.step(course.advise(&flight));
        }
        sum = (sum.0 + flight.total()[0], sum.1 - flight.total()[1]);
    }
    (sum.0 / count as f32, sum.1 / count as f32)
}

#[test]
fn the_teacher_collects_more_than_greedy_and_wastes_nothing_for_energy() {
    let world = Arc::new(World::default_world());
    for (kind, least) in [(ScenarioKind::ReachDestination, 32.0), (ScenarioKind::ReturnBase, 2.0)] {
        let greedy = evaluate_greedy(&world, &realizations(&world, &kind.scenario(), 20).unwrap());
        let (percent, energy) = fly(&world, kind, Preference::DATA, 20);
        println!("{kind}: teacher {percent:.1} % for {energy:.1} units, GREEDY {:.1} %", greedy.coverage());
        assert!(percent > greedy.coverage() + 5.0, "{kind}: {percent} against {}", greedy.coverage());
        assert!(energy <= 80.0);
        assert_eq!(fly(&world, kind, Preference::ENERGY, 5).1, least, "{kind}");
    }
}

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    settings: Settings,
}

#[test]
fn a_distillation_learns_and_goes_on_after_a_kill() {
    let words =
        ["distil", "--updates", "300", "--batch", "8", "--replay", "3000", "--learning-rate", "0.001"];
    let settings = Command::parse_from(words).settings;
    let folder = tempfile::tempdir().unwrap();
    let mut run = Distillation::open(settings.clone(), folder.path(), None, Vec::new()).unwrap();
    let first = run.advance().unwrap().cross_entropy;
    assert!(first < (Action::COUNT as f32).ln() * 1.2, "an untrained policy is near uniform: {first}");
    while run.update() < 200 {
        run.advance().unwrap();
    }
    run.save(folder.path()).unwrap();
    drop(run);
    let mut run = Distillation::open(settings, folder.path(), None, Vec::new()).unwrap();
    assert_eq!(run.update(), 200);
    let mut last = 0.0;
    while !run.is_done() {
        last += run.advance().unwrap().cross_entropy / 100.0;
    }
    assert!(last < 0.75 * first, "cross entropy {first} before, {last} after 300 updates");
}

/// A pupil that begins as its own mentor: the views of an untrained network disagree, those of the pupil less.
#[test]
fn a_pupil_of_its_own_views_is_of_one_mind() {
    let words =
        ["distil", "--updates", "300", "--batch", "8", "--replay", "3000", "--learning-rate", "0.001"];
    let settings = Command::parse_from(words).settings;
    let mentor = Learned {
        system: System::Gleaner,
        method: "train".into(),
        settings: settings.clone(),
        actor: Shape::actor().initialise(&mut rand_chacha::ChaCha8Rng::seed_from_u64(3)),
        update: 1,
        steps: 1,
        score: 0.0,
    };
    let world = Arc::new(World::default_world());
    let flights = realizations(&world, &ScenarioKind::ReachDestination.scenario(), 30).unwrap();
    let flights = flights
        .iter()
        .map(|(seed, realization)| Flight::new(&world, realization, *seed, Preference::DATA).unwrap());
    let samples: Vec<_> = flights.map(|flight| flight.sample()).collect();
    let discord = |actor: &[f32]| {
        let mut network = Network::new(Shape::actor(), actor);
        let means = network.averaged_logits(&samples);
        let plain = network.logits(samples.iter().copied());
        let squares = plain.as_flattened().iter().zip(means.as_flattened()).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f32>()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut best = None;
    let mentors = vec![mentor.clone()];
    let mut run = Distillation::open(settings, folder.path(), Some(&mentor), mentors).unwrap();
    while !run.is_done() {
        assert!(run.advance().unwrap().cross_entropy.is_finite());
    }
    run.validate(&mut best).unwrap();
    let pupil = best.unwrap();
    assert!(pupil.method.ends_with("distil --from FIRST --mentor FIRST"), "{}", pupil.method);
    let (before, after) = (discord(&mentor.actor), discord(&pupil.actor));
    assert!(after < 0.5 * before, "{before} before, {after} after");
}
