//! Documented statistics of the world, measured; and line of sight against another method.

use gleaner_units::{Cell, HeightMap, Metres};
use gleaner_world::{City, Mirror, Scenario, Seed, Stream, World};
use rand::RngExt;

/// Every link of the world: device cell, aircraft cell.
fn links(city: &City) -> impl Iterator<Item = (Cell, Cell)> {
    city.open_cells().iter().flat_map(|&device| city.grid().cells().map(move |uav| (device, uav)))
}

#[test]
fn the_default_city_is_41_percent_built() {
    let city = City::default_city();
    let built = 1.0 - city.open_cells().len() as f64 / city.grid().len() as f64;
    println!("built: {:.3}", built);
    assert_eq!(city.open_cells().len(), 706);
    assert!((built - 0.41).abs() < 0.005, "{built}");
}

#[test]
fn the_links_of_the_default_city_are_the_documented_ones() {
    let world = World::default_world();
    let (mut clear, mut strong, mut strong_and_clear) = (0, 0, 0);
    let mut snr_db: Vec<f32> = Vec::new();
    for (device, uav) in links(world.city()) {
        let snr = world.mean_snr(device, uav).unwrap();
        let sees = world.city().line_of_sight(device, uav);
        clear += usize::from(sees);
        if snr >= world.channel().threshold {
            strong += 1;
            strong_and_clear += usize::from(sees);
        }
        snr_db.push(snr.0);
    }
    snr_db.sort_unstable_by(f32::total_cmp);
    let count = snr_db.len();
    let share = |part: usize, whole: usize| part as f64 / whole as f64;
    let percentile = |percent: usize| snr_db[(count - 1) * percent / 100];
    let percentiles = [5, 50, 75, 95, 100].map(percentile);
    println!(
        "line of sight {:.4}, at least 5 dB {:.4}, of those in sight {:.4}, SNR percentiles 5/50/75/95/max {percentiles:.2?}",
        share(clear, count),
        share(strong, count),
        share(strong_and_clear, strong),
    );
    assert!((share(clear, count) - 0.24).abs() < 0.01);
    assert!((share(strong, count) - 0.15).abs() < 0.01);
    assert!(share(strong_and_clear, strong) > 0.98);
    for (measured, documented) in percentiles.into_iter().zip([-25.0, -16.0, -3.0, 13.0, 21.5]) {
        assert!((measured - documented).abs() <= 0.5, "{measured} for {documented}");
    }
}

/// Line of sight by sampling; `None` within `margin_m` of a building's edge or top, where sampling is not conclusive.
fn sampled_sight(heights: &HeightMap, device: Cell, uav: Cell, margin_m: f64) -> Option<bool> {
    const SAMPLES: u32 = 10_000;
    let at = |from: i16, to: i16, t: f64| (f64::from(from) + 0.5 + t * f64::from(to - from)) * 20.0;
    let mut certain = true;
    for sample in 0..=SAMPLES {
        let t = f64::from(sample) / f64::from(SAMPLES);
        let (east_m, north_m, up_m) = (at(device.x, uav.x, t), at(device.y, uav.y, t), 60.0 * t);
        // The tallest building within the margin, and the lowest.
        let mut near_m = [0_u8; 4];
        for (slot, (de, dn)) in near_m.iter_mut().zip([(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]) {
            let (x, y) = ((east_m + de * margin_m) / 20.0, (north_m + dn * margin_m) / 20.0);
            *slot = heights.height_m(Cell::new(x.floor() as i16, y.floor() as i16)).unwrap_or(0);
        }
        let lowest_m = f64::from(*near_m.iter().min().unwrap());
        let tallest_m = f64::from(*near_m.iter().max().unwrap());
        if up_m < lowest_m - margin_m {
            return Some(false);
        }
        certain &= tallest_m == 0.0 || up_m >= tallest_m + margin_m;
    }
    certain.then_some(true)
}

#[test]
fn line_of_sight_agrees_with_sampling_along_the_line() {
    let (mut judged, mut undecided, mut clear) = (0, 0, 0);
    for (number, city) in [City::default_city(), City::generate(1), City::generate(2)].iter().enumerate() {
        let mut rng = Seed::evaluation(number as u64).rng(Stream::Choices);
        for _ in 0..700 {
            let device = city.open_cells()[rng.random_range(0..city.open_cells().len() as u32) as usize];
            let uav = Cell::new(rng.random_range(0..40_u32) as i16, rng.random_range(0..30_u32) as i16);
            match sampled_sight(city.heights(), device, uav, 0.1) {
                Some(sight) => {
                    assert_eq!(city.line_of_sight(device, uav), sight, "city {number}, {device} to {uav}");
                    judged += 1;
                    clear += u32::from(sight);
                }
                None => undecided += 1,
            }
        }
    }
    println!("judged {judged}, of them clear {clear}, undecided {undecided}");
    assert!(judged > 1900 && clear > 300, "{judged} judged, {clear} clear, {undecided} undecided");
}

#[test]
fn mirrored_cities_have_mirrored_sight() {
    for city in [City::default_city(), City::generate(3)] {
        for mirror in Mirror::ALL {
            let image = city.mirrored(mirror);
            let grid = city.grid();
            for (device, uav) in links(&city) {
                assert_eq!(
                    city.line_of_sight(device, uav),
                    image.line_of_sight(mirror.cell(grid, device), mirror.cell(grid, uav)),
                    "{mirror:?}, {device} to {uav}"
                );
            }
            assert_eq!(image.mirrored(mirror), city);
        }
    }
}

#[test]
fn a_flat_city_hides_nothing_and_outside_nothing_is_seen() {
    let grid = City::default_city().grid();
    let flat = City::new(HeightMap::flat(grid)).unwrap();
    assert!(links(&flat).all(|(device, uav)| flat.line_of_sight(device, uav)));
    assert!(!flat.line_of_sight(Cell::new(0, 0), Cell::new(0, 30)));
    assert!(!flat.line_of_sight(Cell::new(-1, 0), Cell::new(0, 0)));
    let city = City::default_city();
    let roof = grid.cells().find(|&cell| !city.is_open(cell)).unwrap();
    assert!(!city.line_of_sight(roof, roof));
    assert_eq!(grid.cell(), Metres(20.0));
}

#[test]
fn generated_cities_are_like_the_default_one() {
    let (mut built, mut clear) = (Vec::new(), Vec::new());
    for number in 0..20 {
        let city = City::generate(number);
        built.push(1.0 - city.open_cells().len() as f64 / 1200.0);
        let seen = links(&city).filter(|&(device, uav)| city.line_of_sight(device, uav)).count();
        clear.push(seen as f64 / (city.open_cells().len() * 1200) as f64);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    println!(
        "20 generated cities: built {:.3} {built:.2?}, line of sight {:.3} {clear:.2?}",
        mean(&built),
        mean(&clear)
    );
    assert!((0.36..0.50).contains(&mean(&built)), "{}", mean(&built));
    assert!((0.17..0.32).contains(&mean(&clear)), "{}", mean(&clear));
    // Each has room for a mission with the largest number of devices.
    for number in 0..20 {
        let city = City::generate(number);
        let zone = city.open_cells()[0];
        let scenario = Scenario { start: zone, terminal: zone, ..Scenario::return_base() }.with_devices(12);
        gleaner_world::Realization::draw(&city, &scenario, Seed::training(number)).unwrap();
    }
}
