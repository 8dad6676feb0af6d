//! Realizations: a scenario with its devices drawn.

use crate::seed::{below, open_unit};
use crate::{City, Mirror, Scenario, ScenarioError, Seed, Stream};
use gleaner_units::{BatteryUnits, Cell};
use rand::Rng;

/// A device and its data at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Its cell, which is open.
    pub cell: Cell,
    /// D_0: its data at the start, data units.
    pub data_units: f32,
}

/// A mission ready to fly.
#[derive(Clone, Debug, PartialEq)]
pub struct Realization {
    start: Cell,
    terminal: Cell,
    battery: BatteryUnits,
    devices: Vec<Placement>,
}

/// Least distance between two devices.
const SPACING_M: f32 = 100.0;
/// D_0 is uniform in this range.
const DATA_MIN_UNITS: f32 = 5000.0;
const DATA_SPAN_UNITS: f32 = 3000.0;
/// Draws for one device before the layout counts as stuck, and layouts before the city counts as full.
const DRAWS: usize = 2000;
const LAYOUTS: usize = 20;

impl Realization {
    /// A mission with the given devices, at any distance from each other.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn new(
        city: &City,
        scenario: &Scenario,
        devices: Vec<Placement>,
    ) -> Result<Realization, ScenarioError> {
        scenario.check(city)?;
        for device in &devices {
            if !city.is_open(device.cell) {
                return Err(ScenarioError::DeviceNotOpen(device.cell));
            }
            if !(device.data_units.is_finite() && device.data_units > 0.0) {
                return Err(ScenarioError::DeviceData(device.cell));
            }
        }
        let Scenario { start, terminal, battery, .. } = *scenario;
        Ok(Realization { start, terminal, battery, devices })
    }

    /// Draws the devices: open cells at least 100 m apart, data uniform in 5000 to 8000 units.
    ///
    /// The devices are drawn one after the other, so the layout with K devices contains the layout of the same seed with
    /// K - 1, unless the city is so full that the draw had to start again.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn draw(city: &City, scenario: &Scenario, seed: Seed) -> Result<Realization, ScenarioError> {
        let mut rng = seed.rng(Stream::Layout);
        for _ in 0..LAYOUTS {
            if let Some(devices) = draw_devices(city, scenario.device_count, &mut rng) {
                return Realization::new(city, scenario, devices);
            }
        }
        Err(ScenarioError::TooManyDevices(scenario.device_count))
    }

    /// Start cell.
    #[must_use]
    pub const fn start(&self) -> Cell {
        self.start
    }

    /// A move into this cell ends it.
    #[must_use]
    pub const fn terminal(&self) -> Cell {
        self.terminal
    }

    /// Battery at the start.
    #[must_use]
    pub const fn battery(&self) -> BatteryUnits {
        self.battery
    }

    /// The devices.
    #[must_use]
    pub fn devices(&self) -> &[Placement] {
        &self.devices
    }

    /// The same mission in the mirrored city; `city` is the one that this realization was drawn for.
    #[must_use]
    pub fn mirrored(&self, city: &City, mirror: Mirror) -> Realization {
        let image = |cell| mirror.cell(city.grid(), cell);
        Realization {
            start: image(self.start),
            terminal: image(self.terminal),
            battery: self.battery,
            devices: self.devices.iter().map(|d| Placement { cell: image(d.cell), ..*d }).collect(),
        }
    }
}

fn draw_devices(city: &City, count: usize, rng: &mut impl Rng) -> Option<Vec<Placement>> {
    let mut devices: Vec<Placement> = Vec::with_capacity(count);
    for _ in 0..count {
        let cell = (0..DRAWS)
            .map(|_| city.open_cells()[below(rng, city.open_cells().len() as u32) as usize])
            .find(|&cell| devices.iter().all(|other| are_apart(city, cell, other.cell)))?;
        let data_units = DATA_MIN_UNITS + DATA_SPAN_UNITS * open_unit(rng);
        devices.push(Placement { cell, data_units });
    }
    Some(devices)
}

fn are_apart(city: &City, a: Cell, b: Cell) -> bool {
    let cell_m = city.grid().cell().0;
    let (east_m, north_m) = (f32::from(a.x.abs_diff(b.x)) * cell_m, f32::from(a.y.abs_diff(b.y)) * cell_m);
    east_m * east_m + north_m * north_m >= SPACING_M * SPACING_M
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_open_apart_and_hold_5000_to_8000_units() {
        let city = City::default_city();
        for number in 0..200 {
            let scenario = Scenario::reach_destination().with_devices(12);
            let realization = Realization::draw(&city, &scenario, Seed::training(number)).unwrap();
            for (index, a) in realization.devices().iter().enumerate() {
                assert!(city.is_open(a.cell), "seed {number}");
                assert!((5000.0..=8000.0).contains(&a.data_units), "seed {number}");
                for b in &realization.devices()[..index] {
                    let (dx, dy) = (a.cell.x - b.cell.x, a.cell.y - b.cell.y);
                    assert!(dx * dx + dy * dy >= 25, "seed {number}: {} and {}", a.cell, b.cell);
                }
            }
            let fewer = Realization::draw(&city, &scenario.with_devices(5), Seed::training(number)).unwrap();
            assert_eq!(fewer.devices(), &realization.devices()[..5], "seed {number}");
        }
    }

    #[test]
    fn a_full_city_and_bad_devices_are_refused() {
        let city = City::default_city();
        let rd = Scenario::reach_destination();
        let crowd = Realization::draw(&city, &rd.with_devices(200), Seed::training(0));
        assert_eq!(crowd, Err(ScenarioError::TooManyDevices(200)));
        let roof = city.grid().cells().find(|&cell| !city.is_open(cell)).unwrap();
        let at = |cell, data_units| Realization::new(&city, &rd, vec![Placement { cell, data_units }]);
        assert_eq!(at(roof, 1.0), Err(ScenarioError::DeviceNotOpen(roof)));
        assert_eq!(at(rd.start, f32::NAN), Err(ScenarioError::DeviceData(rd.start)));
        assert_eq!(at(rd.start, 0.0), Err(ScenarioError::DeviceData(rd.start)));
        assert!(at(rd.start, 1.0).is_ok());
    }
}
