//! Builds a world with a city of your own and flies one episode in it. Run it from the repository's root:
//!
//! ```sh
//! cargo run --release -p gleaner-world --example own_city
//! ```

use gleaner_units::Action;
use gleaner_world::{Channel, City, Episode, Realization, Scenario, Seed, World};
use std::sync::Arc;

/// Building heights in metres, one row a line from north to south. Replace it by your own file:
/// `std::fs::read_to_string("city.csv")`. The city has the size of the scenario's map, 40 x 30 cells of 20 m.
fn heights() -> String {
    let row = |y: usize| {
        let height = |x: usize| if x % 5 == 2 && !y.is_multiple_of(4) { "30" } else { "0" };
        (0..40).map(height).collect::<Vec<_>>().join(",")
    };
    (0..30).map(row).collect::<Vec<_>>().join("\n")
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let city = City::from_csv(&heights())?;
    let world = Arc::new(World::new(city, Channel::default()));
    let scenario = Scenario::reach_destination().in_city(world.city()).with_devices(4);
    let seed = Seed::evaluation(1);
    let realization = Realization::draw(world.city(), &scenario, seed)?;
    let mut episode = Episode::new(Arc::clone(&world), &realization, seed)?;

    // Your policy goes here; this one flies the shortest way to the terminal.
    while !episode.is_done() {
        let (at, to) = (episode.uav(), episode.terminal());
        let action = match (to.x.cmp(&at.x), to.y.cmp(&at.y)) {
            (std::cmp::Ordering::Greater, _) => Action::East,
            (std::cmp::Ordering::Less, _) => Action::West,
            (_, std::cmp::Ordering::Greater) => Action::North,
            _ => Action::South,
        };
        episode.step(action)?;
    }
    println!("{} slots, {} battery units left", episode.slots(), episode.battery().0);
    println!("collected {:.1} %", 100.0 * episode.field().collected_fraction());
    Ok(())
}
