//! Refinement: it learns, resumes without a difference, and starts from the mean of several runs.

use clap::Parser;
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::env::mismatch::{MapError, Mismatch};
use gleaner_host_trainer::env::site::Site;
use gleaner_host_trainer::env::variety::Variety;
use gleaner_host_trainer::keep::snapshot::{LAST, Snapshot};
use gleaner_host_trainer::learn::ppo::Refinement;
use gleaner_host_trainer::learn::trainer::Trainer;
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::settings::Settings;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::{Realization, ScenarioKind, Seed, World};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;
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

fn untrained() -> Snapshot {
    Snapshot {
        system: "gleaner".into(),
        method: "train".into(),
        settings: settings(&[]),
        actor: Shape::actor().initialise(&mut ChaCha8Rng::seed_from_u64(3)),
        update: 0,
        steps: 0,
        score: 0.0,
    }
}

fn open(folder: &Path, first: &Snapshot, others: &[Snapshot]) -> Refinement {
    Refinement::open(settings(&[]), Site::default_site(), folder, first, others, 1.0).unwrap()
}

#[test]
fn resumed_refinement_equals_an_uninterrupted_one() {
    let (from, folder) = (untrained(), tempfile::tempdir().unwrap());
    let mut through = open(folder.path(), &from, &[]);
    let losses: Vec<_> = (0..4).map(|_| through.advance().unwrap()).collect();
    assert!(through.is_done());

    let mut stopped = open(folder.path(), &from, &[]);
    stopped.advance().unwrap();
    stopped.advance().unwrap();
    stopped.save(folder.path()).unwrap();
    stopped.advance().unwrap(); // lost in the kill
    drop(stopped);
    let mut resumed = open(folder.path(), &from, &[]);
    assert_eq!(resumed.update(), 2);
    let after: Vec<_> = (0..2).map(|_| resumed.advance().unwrap()).collect();
    assert_eq!(after, losses[2..], "losses to the last bit");
    // The critic learns the returns of an untrained policy within four updates.
    let (first, last) = (losses[0].critic, losses[3].critic);
    assert!(last < 0.85 * first, "squared error {first} at first, {last} after 4 updates");
}

#[test]
fn start_is_the_mean_of_several_runs() {
    let (first, folder) = (untrained(), tempfile::tempdir().unwrap());
    let shifted = |by: f32| {
        let actor = first.actor.iter().map(|weight| weight + by).collect();
        Snapshot { actor, ..first.clone() }
    };
    open(folder.path(), &first, &[shifted(0.25), shifted(0.5)]).save(folder.path()).unwrap();
    let last = Snapshot::load(&folder.path().join(LAST)).unwrap().unwrap();
    for (weight, one) in last.actor.iter().zip(&first.actor) {
        assert!((weight - (one + 0.25)).abs() < 1e-6, "{weight}, {one}");
    }
    assert!(last.method.contains("--from FIRST --from OTHER --from OTHER"), "{}", last.method);
}

#[test]
fn generated_cities_and_differing_worlds_come_in_their_share_and_repeat() {
    let site = Site::default_site();
    let variety = Variety::new(&site, 0.25, 0.4);
    let (mut generated, mut differing) = (0, 0);
    for mission in 0..2_000 {
        let (index, setting) = variety.setting(mission);
        assert_eq!(index, variety.setting(mission).0);
        // The default start and terminal move to open ground.
        settings(&[]).missions().mission(&setting.site, mission).unwrap();
        if setting.mismatch.missing_reports > 0.0 {
            generated += 1;
        } else if setting.mismatch != Mismatch::default() {
            differing += 1;
            assert_eq!(setting.map.is_some(), setting.mismatch.map != MapError::None);
            let [noise, nominal] = [&setting.site, &site].map(|site| site.world().channel().noise);
            assert!((noise.0 - nominal.0 - setting.mismatch.noise_db).abs() < 1e-4);
        }
    }
    assert!((420..580).contains(&generated) && (540..660).contains(&differing), "{generated} {differing}");
    let own = Variety::new(&site, 0.0, 0.0);
    assert!((0..200).all(|mission| own.setting(mission).0 == 0));
    assert_eq!(own.settings().count(), 1);
}

#[test]
fn lost_report_leaves_the_last_known_data() {
    let world = Arc::new(World::default_world());
    let scenario = ScenarioKind::ReachDestination.scenario();
    let seed = Seed::training(11);
    let realization = Realization::draw(world.city(), &scenario, seed).unwrap();
    let mut flight =
        Flight::new(&world, &realization, seed, Preference::DATA).unwrap().with_reports_missing(0.5, seed);
    let (mut lost, mut slots) = (0, 0);
    let mut known: Vec<f32> = realization.devices().iter().map(|device| device.data_units).collect();
    while !flight.is_over() {
        let tokens = flight.tokens();
        assert_eq!(tokens, flight.tokens(), "observing twice gives the same");
        for (index, (token, device)) in tokens.devices.iter().zip(flight.episode().devices()).enumerate() {
            slots += 1;
            if token[3] == device.snr.0 {
                known[index] = device.remaining_units;
            } else {
                lost += 1;
                assert_eq!(token[4], 0.0, "a device without a report is not reachable");
            }
            assert_eq!(token[2], known[index]);
        }
        let action = flight.guard().homeward(flight.episode().uav()).filter(|_| slots > 300);
        flight.step(action.unwrap_or(Action::Hover));
    }
    assert!((0.4..0.6).contains(&(f64::from(lost) / f64::from(slots))), "{lost} of {slots}");
}
