use super::*;
use crate::env::flight::Flight;
use crate::judge::evaluation::{evaluate, realizations};
use crate::keep::checkpoint;
use crate::learn::algorithm::Inference;
use crate::observe::Encoding;
use crate::settings::Settings;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::{Realization, Scenario, Seed, World};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

fn snapshot(system: System) -> Snapshot {
    Snapshot {
        system: system.name().to_owned(),
        method: "train".into(),
        settings: Settings::default(),
        actor: vec![0.01; system.parameter_count()],
        update: 7,
        steps: 28,
        score: 1.5,
    }
}

#[test]
fn names_parse_and_parameter_counts_are_as_documented() {
    for system in System::ALL {
        assert_eq!(system.name().parse(), Ok(system));
    }
    assert_eq!("greedy".parse::<System>(), Err(UnknownSystem));
    let counts = System::ALL.map(System::parameter_count);
    assert_eq!(counts, [89_989, 107_845, 127_045, 187_850, 186_565, 84_229]);
}

#[test]
fn snapshots_load_and_fly() {
    let world = Arc::new(World::default_world());
    let drawn = realizations(&world, &Scenario::reach_destination().with_devices(12), 1).unwrap();
    for system in System::ALL {
        let folder = tempfile::tempdir().unwrap();
        snapshot(system).save(folder.path()).unwrap();
        let loaded = load_of(system, folder.path()).unwrap().unwrap();
        assert_eq!(loaded.actor, snapshot(system).actor);
        let table = evaluate(&world, &drawn, &mut *system.policy(&loaded)).unwrap();
        assert!(table.rows.iter().all(|row| row.energy >= 32.0 && row.energy <= 80.0), "{system}");
    }
}

#[test]
fn systems_with_attention_show_it() {
    let world = Arc::new(World::default_world());
    let seed = Seed::evaluation(0);
    let realization = Realization::draw(world.city(), &Scenario::reach_destination(), seed).unwrap();
    let flight = Flight::new(&world, &realization, seed, Preference::DATA).unwrap();
    for system in System::ALL {
        let snapshot = snapshot(system);
        let attention = system.policy(&snapshot).attention(&flight).unwrap();
        assert_eq!(attention.is_some(), system.has_attention(), "{system}");
        let Some(attention) = attention else { continue };
        // Aircraft, preference, map and six devices; six more may be present.
        let sums: Vec<f32> = attention.0.iter().map(|row| row.iter().sum()).collect();
        assert!(sums[..9].iter().all(|sum| (sum - 1.0).abs() < 1e-5), "{system}: {sums:?}");
        assert!(sums[9..].iter().all(|&sum| sum == 0.0), "{system}: {sums:?}");
    }
}

#[test]
fn snapshot_without_a_system_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    checkpoint::save(&folder.path().join(SNAPSHOT), &snapshot(System::Gleaner)).unwrap();
    assert!(load(folder.path()).is_err());
    Snapshot { system: "dqn".into(), ..snapshot(System::Gleaner) }.save(folder.path()).unwrap();
    let error = load(folder.path()).unwrap_err();
    assert!(matches!(error, SnapshotError::UnknownSystem { .. }), "{error}");
}

#[test]
fn snapshot_of_another_network_or_system_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    snapshot(System::MosacCgl).save(folder.path()).unwrap();
    let error = load_of(System::MosacAtt, folder.path()).unwrap_err();
    assert!(matches!(error, SnapshotError::OtherSystem { found: System::MosacCgl, .. }), "{error}");
    let mut older = snapshot(System::MosacFtv);
    older.actor.pop();
    older.save(folder.path()).unwrap();
    let error = load(folder.path()).unwrap_err();
    assert!(matches!(error, SnapshotError::OtherNetwork { found: 84_228, .. }), "{error}");
    assert!(!error.to_string().contains('\n'), "one line");
}

/// The distance to the terminal is 31 moves, and the outputs depend on the preference.
fn check_encoding<A: Algorithm>() {
    let world = Arc::new(World::default_world());
    let realization =
        Realization::draw(world.city(), &Scenario::reach_destination(), Seed::evaluation(1)).unwrap();
    let mut flight = Flight::new(&world, &realization, Seed::evaluation(1), Preference::DATA).unwrap();
    flight.step(Action::East);
    let encoding = A::Encoding::of(world.city());
    let state = encoding.observe(&flight);
    assert_eq!(A::Encoding::distance_to_terminal(&state), 31.0, "{}", A::NAME);
    let parameters = A::network().initialise(&mut ChaCha8Rng::seed_from_u64(1));
    let mut inference = Inference::<A::Encoding>::new(A::network());
    let states = [(&state, Preference::DATA), (&state, Preference::ENERGY), (&state, Preference::DATA)];
    let outputs = inference.outputs(&encoding, &parameters, states).to_vec();
    let [data, energy, again] = [0, 1, 2].map(|row| &outputs[row * 5..row * 5 + 5]);
    assert_eq!(data, again, "{}", A::NAME);
    assert_ne!(data, energy, "{}", A::NAME);
}

#[test]
fn every_encoding_has_the_distance_and_the_preference() {
    check_encoding::<Gleaner>();
    check_encoding::<MosacAtt>();
    check_encoding::<MosacAttLayers>();
    check_encoding::<MosacCgl>();
    check_encoding::<MosacFtv>();
}
