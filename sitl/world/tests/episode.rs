//! The order inside a slot, and the determinism of a seed.

use gleaner_units::{Action, BatteryUnits, Cell};
use gleaner_world::{
    Channel, City, Episode, Fading, Mirror, Placement, Realization, Scenario, ScenarioError, Seed, StepError,
    Stream, World,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::RngExt;
use std::sync::{Arc, LazyLock};

static WORLD: LazyLock<Arc<World>> = LazyLock::new(|| Arc::new(World::default_world()));

fn world() -> Arc<World> {
    WORLD.clone()
}

fn drawn(world: &Arc<World>, scenario: &Scenario, number: u64) -> Episode {
    let realization = Realization::draw(world.city(), scenario, Seed::evaluation(number)).unwrap();
    Episode::new(world.clone(), &realization, Seed::evaluation(number)).unwrap()
}

/// One device right below the start of RB, with this much data.
fn single(world: &Arc<World>, data_units: f32) -> Episode {
    let scenario = Scenario::return_base();
    let device = Placement { cell: scenario.start, data_units };
    let realization = Realization::new(world.city(), &scenario, vec![device]).unwrap();
    Episode::new(world.clone(), &realization, Seed::training(5)).unwrap()
}

#[test]
fn a_seed_is_one_flight_on_every_platform() {
    // Recorded values. If they change, published figures and golden flights change too.
    let world = world();
    assert_eq!(format!("{:016x}", world.city().fingerprint()), FINGERPRINT);
    assert_eq!(format!("{:016x}", City::generate(1).fingerprint()), FINGERPRINT_1);
    let mut episode = drawn(&world, &Scenario::reach_destination(), 0);
    let layout: Vec<(i16, i16, f32)> =
        episode.devices().iter().map(|device| (device.cell.x, device.cell.y, device.initial_units)).collect();
    assert_eq!(layout, LAYOUT);
    let first_db: Vec<f32> = episode.devices().iter().map(|device| device.snr.0).collect();
    assert_eq!(first_db, FIRST_SNR_DB);
    let [n, w, s, e] = Action::MOVES;
    let tour = [e, w, w, w, w, Action::Hover, n, n, n, w, s, w];
    let trace: Vec<(Option<usize>, f32)> = tour
        .into_iter()
        .map(|action| episode.step(action).map(|step| (step.served, step.collected_units)).unwrap())
        .collect();
    assert_eq!(trace, TRACE);
}

const FINGERPRINT: &str = "68e6c7056c3d1771";
const FINGERPRINT_1: &str = "a7ef3f7c47cc19fa";
const LAYOUT: [(i16, i16, f32); 6] = [
    (18, 5, 7278.5605),
    (0, 10, 5386.324),
    (2, 18, 6053.484),
    (24, 29, 6888.1455),
    (29, 0, 6888.1343),
    (17, 20, 6327.9624),
];
const FIRST_SNR_DB: [f32; 6] = [9.12221, 7.1224356, 3.0477552, -23.104445, 2.626259, -16.107622];
const TRACE: [(Option<usize>, f32); 12] = [
    (Some(0), 319.69183),
    (Some(0), 428.81018),
    (Some(0), 365.8294),
    (Some(1), 319.40353),
    (Some(0), 314.05237),
    (Some(1), 398.63),
    (Some(1), 427.85223),
    (Some(1), 389.06094),
    (Some(1), 373.19733),
    (Some(1), 380.26898),
    (Some(1), 489.11108),
    (Some(1), 372.24356),
];

#[test]
fn data_is_sent_before_the_move_and_only_a_move_ends() {
    let world = world();
    let mut episode = single(&world, 5000.0);
    let heard = episode.devices()[0].snr;
    assert!(episode.devices()[0].reachable);
    let hover = episode.step(Action::Hover).unwrap();
    assert!(!hover.done, "hovering on the terminal ends nothing");
    assert_eq!(
        hover.collected_units,
        world.channel().data_per_slot(heard),
        "the SNR that was observed carries"
    );
    assert_eq!(hover.energy, BatteryUnits(0.5));
    assert_ne!(episode.devices()[0].snr, heard, "the next slot is heard anew");
    let heard = episode.devices()[0].snr;
    let away = episode.step(Action::North).unwrap();
    assert_eq!(away.collected_units, world.channel().data_per_slot(heard));
    assert_eq!(episode.uav(), Cell::new(20, 16));
    let back = episode.step(Action::South).unwrap();
    assert!(back.done && episode.is_done());
    assert_eq!(episode.battery(), BatteryUnits(77.5));
    assert_eq!(episode.step(Action::Hover), Err(StepError::Over));
}

#[test]
fn a_slot_is_limited_by_remaining_data() {
    let mut episode = single(&world(), 1000.0);
    let first = episode.step(Action::Hover).unwrap();
    assert!(first.collected_units > 500.0);
    let second = episode.step(Action::Hover).unwrap();
    assert!((first.collected_units + second.collected_units - 1000.0).abs() < 1e-3);
    assert_eq!(episode.devices()[0].remaining_units, 0.0);
    let third = episode.step(Action::Hover).unwrap();
    assert_eq!((third.served, third.collected_units), (None, 0.0));
    assert_eq!(episode.reward(&first)[0] + episode.reward(&second)[0], 100.0);
    assert_eq!(episode.field().collected_fraction(), 1.0);
}

#[test]
fn impossible_actions_change_nothing() {
    let world = world();
    let scenario = Scenario { start: Cell::new(0, 29), ..Scenario::reach_destination() };
    let mut episode = drawn(&world, &scenario.with_battery(BatteryUnits(41.0)), 1);
    let before = episode.devices().to_vec();
    for action in [Action::North, Action::West] {
        assert_eq!(episode.step(action), Err(StepError::OffGrid { from: Cell::new(0, 29), action }));
    }
    assert_eq!(episode.devices(), before);
    assert_eq!(episode.battery(), BatteryUnits(41.0));
    for _ in 0..81 {
        episode.step(Action::Hover).unwrap();
    }
    assert_eq!(episode.battery(), BatteryUnits(0.5));
    assert_eq!(episode.step(Action::East), Err(StepError::BatteryEmpty { at: Cell::new(0, 29) }));
    episode.step(Action::Hover).unwrap();
    assert_eq!(episode.battery(), BatteryUnits(0.0));
    assert_eq!(episode.step(Action::Hover), Err(StepError::BatteryEmpty { at: Cell::new(0, 29) }));
}

#[test]
fn a_realization_of_another_city_is_refused() {
    let generated = City::generate(1);
    let world = world();
    let elsewhere = *generated.open_cells().iter().find(|&&cell| !world.city().is_open(cell)).unwrap();
    let zone = generated.open_cells()[0];
    let scenario = Scenario { start: zone, terminal: zone, ..Scenario::return_base() };
    let device = Placement { cell: elsewhere, data_units: 1.0 };
    let foreign = Realization::new(&generated, &scenario, vec![device]).unwrap();
    let refusal = ScenarioError::DeviceNotOpen(elsewhere);
    assert_eq!(Episode::new(world.clone(), &foreign, Seed::training(0)).err(), Some(refusal));
    let mut episode = drawn(&world, &Scenario::return_base(), 0);
    assert_eq!(episode.reset(&foreign, Seed::training(0)), Err(refusal));
    assert_eq!(episode.step(Action::Hover), Err(StepError::Over));
}

#[test]
fn a_mission_in_the_mirrored_city_is_the_mirrored_mission() {
    let world = world();
    let realization =
        Realization::draw(world.city(), &Scenario::reach_destination(), Seed::training(9)).unwrap();
    for mirror in Mirror::ALL {
        let image = Arc::new(World::new(world.city().mirrored(mirror), *world.channel()));
        let mut here = Episode::new(world.clone(), &realization, Seed::training(9)).unwrap();
        let mirrored = realization.mirrored(world.city(), mirror);
        let mut there = Episode::new(image, &mirrored, Seed::training(9)).unwrap();
        let mut rng = Seed::training(9).rng(Stream::Choices);
        for _ in 0..60 {
            let action = Action::ALL[rng.random_range(0..5_u32) as usize];
            assert_eq!(here.step(action).ok(), there.step(mirror.action(action)).ok());
        }
    }
}

#[test]
fn fading_changes_the_draws_and_not_the_rules() {
    let faded = Arc::new(World::new(
        City::default_city(),
        Channel { fading: Fading::Rayleigh, ..Channel::default() },
    ));
    let (mut plain, mut faded) = (single(&world(), 8000.0), single(&faded, 8000.0));
    let mut differ = false;
    for _ in 0..20 {
        differ |= plain.devices()[0].snr != faded.devices()[0].snr;
        assert_eq!(faded.devices()[0].reachable, faded.devices()[0].snr >= Channel::default().threshold);
        plain.step(Action::Hover).unwrap();
        faded.step(Action::Hover).unwrap();
    }
    assert!(differ);
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// For random actions: battery, data and scheduling are consistent, and a reset repeats the flight.
    #[test]
    fn the_books_balance(number in 0_u64..1000, devices in 1_usize..=12, actions in prop::collection::vec(0_usize..5, 1..120)) {
        let world = world();
        let scenario = Scenario::return_base().with_devices(devices);
        let realization = Realization::draw(world.city(), &scenario, Seed::training(number)).unwrap();
        let mut episode = Episode::new(world.clone(), &realization, Seed::training(number)).unwrap();
        let mut first_flight = Vec::new();
        let (mut energy, mut collected) = (0.0_f64, 0.0_f64);
        for &action in &actions {
            let before = episode.devices().to_vec();
            let Ok(step) = episode.step(Action::from_index(action).unwrap()) else { continue };
            let best = before.iter().enumerate()
                .filter(|(_, device)| device.snr >= world.channel().threshold && device.remaining_units > 0.0)
                .max_by(|a, b| a.1.snr.0.total_cmp(&b.1.snr.0).then(b.0.cmp(&a.0)));
            prop_assert_eq!(step.served, best.map(|(index, _)| index));
            for (index, (was, is)) in before.iter().zip(episode.devices()).enumerate() {
                let sent = if step.served == Some(index) { step.collected_units } else { 0.0 };
                prop_assert_eq!(was.remaining_units - sent, is.remaining_units);
                prop_assert!(is.remaining_units >= 0.0);
            }
            energy += f64::from(step.energy.0);
            collected += f64::from(step.collected_units);
            first_flight.push(step);
        }
        prop_assert_eq!(f64::from(episode.battery().0), 80.0 - energy);
        prop_assert!((collected - f64::from(episode.field().collected_units())).abs() < 0.1);
        prop_assert_eq!(episode.slots() as usize, first_flight.len());
        episode.reset(&realization, Seed::training(number)).unwrap();
        let again: Vec<_> = actions.iter().filter_map(|&action| episode.step(Action::from_index(action).unwrap()).ok()).collect();
        prop_assert_eq!(again, first_flight);
    }
}
