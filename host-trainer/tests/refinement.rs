//! Refinement learns from its own flights, and a kill costs it nothing but the time since the last checkpoint.

use clap::Parser;
use gleaner_host_trainer::env::variety::Variety;
use gleaner_host_trainer::keep::snapshot::LAST;
use gleaner_host_trainer::keep::snapshot::Learned;
use gleaner_host_trainer::learn::learning::Learning;
use gleaner_host_trainer::learn::ppo::Refinement;
use gleaner_host_trainer::learn::settings::Settings;
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::systems::System;
use gleaner_units::Action;
use gleaner_world::World;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    settings: Settings,
}

fn settings(more: &[&str]) -> Settings {
    let usual =
        ["refine", "--updates", "4", "--share-rd", "0.5", "--share-rb", "0.5", "--share-varied", "0.3"];
    Command::parse_from(usual.iter().chain(more)).settings
}

fn untrained() -> Learned {
    Learned {
        system: System::Gleaner,
        method: "train".into(),
        settings: settings(&[]),
        actor: Shape::actor().initialise(&mut ChaCha8Rng::seed_from_u64(3)),
        update: 0,
        steps: 0,
        score: 0.0,
    }
}

#[test]
fn resuming_gives_the_same_bits_as_never_having_stopped() {
    let (from, folder) = (untrained(), tempfile::tempdir().unwrap());
    let open = || Refinement::open(settings(&[]), folder.path(), &from, &[], 1.0).unwrap();
    let mut through = open();
    let findings: Vec<_> = (0..4).map(|_| through.advance().unwrap()).collect();
    assert!(through.is_done());

    let mut stopped = open();
    stopped.advance().unwrap();
    stopped.advance().unwrap();
    stopped.save(folder.path()).unwrap();
    stopped.advance().unwrap(); // lost in the kill
    drop(stopped);
    let mut resumed = open();
    assert_eq!(resumed.update(), 2);
    let after: Vec<_> = (0..2).map(|_| resumed.advance().unwrap()).collect();
    assert_eq!(after, findings[2..], "losses to the last bit");
}

#[test]
fn it_begins_in_the_middle_of_several_and_leaves_where_it_stands() {
    let (first, folder) = (untrained(), tempfile::tempdir().unwrap());
    let with = |by: f32| {
        let actor = first.actor.iter().map(|weight| weight + by).collect();
        Learned { actor, ..first.clone() }
    };
    let mut run =
        Refinement::open(settings(&[]), folder.path(), &first, &[with(0.25), with(0.5)], 1.0).unwrap();
    run.save(folder.path()).unwrap();
    let last = Learned::load(&folder.path().join(LAST)).unwrap().unwrap();
    for (weight, one) in last.actor.iter().zip(&first.actor) {
        assert!((weight - (one + 0.25)).abs() < 1e-6, "{weight}, {one}");
    }
    assert!(last.method.contains("--from FIRST --from OTHER --from OTHER"), "{}", last.method);
}

#[test]
fn the_critic_learns_what_a_mission_brings() {
    let from = untrained();
    let folder = tempfile::tempdir().unwrap();
    let mut run = Refinement::open(settings(&[]), folder.path(), &from, &[], 1.0).unwrap();
    let first = run.advance().unwrap().critic;
    run.advance().unwrap();
    run.advance().unwrap();
    let last = run.advance().unwrap().critic;
    assert!(last < 0.85 * first, "squared error {first} at first, {last} after 4 updates");
}

#[test]
fn other_cities_are_drawn_as_often_as_asked_and_always_the_same() {
    let world = Arc::new(World::default_world());
    let variety = Variety::new(&world, &settings(&["--share-cities", "0.25"]));
    let elsewhere = |mission| !Arc::ptr_eq(variety.setting(mission).world, &world);
    let count = (0..2_000).filter(|&mission| elsewhere(mission)).count();
    assert!((420..580).contains(&count), "{count} of 2000");
    for mission in (0..200).filter(|&mission| elsewhere(mission)) {
        let setting = variety.setting(mission);
        assert!(setting.reports_missing > 0.0);
        assert!(Arc::ptr_eq(setting.world, variety.setting(mission).world));
        // Default start and terminal are moved to open ground.
        settings(&[]).mission(setting.world, mission).unwrap();
    }
    let usual = Variety::new(&world, &settings(&[]));
    assert!((0..200).all(|mission| Arc::ptr_eq(usual.setting(mission).world, &world)));
}

#[test]
fn a_missing_report_leaves_the_device_unheard_and_its_data_as_last_told() {
    use gleaner_host_trainer::env::flight::Flight;
    use gleaner_policy::Preference;
    use gleaner_world::{Realization, ScenarioKind, Seed};
    let world = Arc::new(World::default_world());
    let scenario = ScenarioKind::ReachDestination.scenario();
    let seed = Seed::training(11);
    let realization = Realization::draw(world.city(), &scenario, seed).unwrap();
    let mut flight =
        Flight::new(&world, &realization, seed, Preference::DATA).unwrap().with_reports_missing(0.5, seed);
    let (mut missing, mut slots) = (0, 0);
    let mut told: Vec<f32> = realization.devices().iter().map(|device| device.data_units).collect();
    while !flight.is_over() {
        let tokens = flight.tokens();
        assert_eq!(tokens, flight.tokens(), "asking twice hears the same");
        for (index, (token, device)) in tokens.devices.iter().zip(flight.episode().devices()).enumerate() {
            slots += 1;
            if token[3] == device.snr.0 {
                told[index] = device.remaining_units;
            } else {
                missing += 1;
                assert_eq!(token[4], 0.0, "not heard, so not reachable");
            }
            assert_eq!(token[2], told[index]);
        }
        let action = flight.guard().homeward(flight.episode().uav()).filter(|_| slots > 300);
        flight.step(action.unwrap_or(Action::Hover));
    }
    assert!((0.4..0.6).contains(&(f64::from(missing) / f64::from(slots))), "{missing} of {slots}");
}
