//! The teacher collects more than GREEDY, and distillation learns from it and resumes.

use clap::Parser;
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::env::site::Site;
use gleaner_host_trainer::judge::evaluation::{Network, evaluate_greedy, realizations};
use gleaner_host_trainer::keep::snapshot::Snapshot;
use gleaner_host_trainer::learn::distil::{Distillation, Teaching};
use gleaner_host_trainer::learn::trainer::{TrainError, Trainer};
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::observe::tokens;
use gleaner_host_trainer::planner::teacher::Teacher;
use gleaner_host_trainer::settings::Settings;
use gleaner_lookahead::Budget;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::{ScenarioKind, World};
use rand::SeedableRng;
use std::path::Path;
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
fn teacher_beats_greedy_and_wastes_no_energy() {
    let world = Arc::new(World::default_world());
    for (kind, least) in [(ScenarioKind::ReachDestination, 32.0), (ScenarioKind::ReturnBase, 2.0)] {
        let greedy = evaluate_greedy(&world, &realizations(&world, &kind.scenario(), 20).unwrap());
        let (percent, energy) = fly(&world, kind, Preference::DATA, 20);
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

fn open(
    settings: &Settings,
    folder: &Path,
    from: Option<&Snapshot>,
    teaching: Teaching,
) -> Result<Distillation, TrainError> {
    Distillation::open(settings.clone(), Site::default_site(), folder, from, teaching)
}

#[test]
fn distillation_learns_and_resumes() {
    let words =
        ["distil", "--updates", "300", "--batch", "8", "--replay", "3000", "--learning-rate", "0.001"];
    let settings = Command::parse_from(words).settings;
    for teaching in [Teaching::Planner, Teaching::LookAhead(Budget { tours: 20 })] {
        let folder = tempfile::tempdir().unwrap();
        let mut run = open(&settings, folder.path(), None, teaching.clone()).unwrap();
        let first = run.advance().unwrap().cross_entropy;
        assert!(first < (Action::COUNT as f32).ln() * 1.2, "an untrained policy is near uniform: {first}");
        while run.update() < 200 {
            run.advance().unwrap();
        }
        run.save(folder.path()).unwrap();
        drop(run);
        let mut run = open(&settings, folder.path(), None, teaching.clone()).unwrap();
        assert_eq!(run.update(), 200);
        let mut last = 0.0;
        while !run.is_done() {
            last += run.advance().unwrap().cross_entropy / 100.0;
        }
        assert!(last < 0.75 * first, "{teaching:?}: cross entropy {first} before, {last} after 300 updates");
    }
}

/// The student starts as its own mentor. The views of an untrained network disagree, those of the student less.
#[test]
fn views_of_a_self_distilled_policy_agree() {
    let words =
        ["distil", "--updates", "300", "--batch", "8", "--replay", "3000", "--learning-rate", "0.001"];
    let settings = Command::parse_from(words).settings;
    let mentor = Snapshot {
        system: "gleaner".into(),
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
    let samples: Vec<_> = flights.map(|flight| tokens::sample(&flight)).collect();
    let disagreement = |actor: &[f32]| {
        let mut network = Network::new(Shape::actor(), actor);
        let means = network.averaged_logits(&samples);
        let plain = network.logits(samples.iter().copied());
        let squares = plain.as_flattened().iter().zip(means.as_flattened()).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f32>()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut best = None;
    let teaching = Teaching::Mentors(vec![mentor.clone()]);
    let mut run = open(&settings, folder.path(), Some(&mentor), teaching).unwrap();
    while !run.is_done() {
        assert!(run.advance().unwrap().cross_entropy.is_finite());
    }
    run.validate(&mut best).unwrap();
    let student = best.unwrap();
    assert!(student.method.ends_with("distil --from FIRST --mentor FIRST"), "{}", student.method);
    let (before, after) = (disagreement(&mentor.actor), disagreement(&student.actor));
    assert!(after < 0.5 * before, "{before} before, {after} after");
}
