//! Scenarios: start, terminal, battery and number of devices of a mission.

use crate::City;
use core::fmt;
use core::str::FromStr;
use gleaner_units::{BatteryUnits, Cell};
use thiserror::Error;

/// The two kinds of mission (paper, section V-A).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ScenarioKind {
    /// RD: start and terminal are apart.
    ReachDestination,
    /// RB: the mission ends where it began.
    ReturnBase,
}

impl ScenarioKind {
    /// Both.
    pub const ALL: [ScenarioKind; 2] = [ScenarioKind::ReachDestination, ScenarioKind::ReturnBase];

    /// `rd` or `rb`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            ScenarioKind::ReachDestination => "rd",
            ScenarioKind::ReturnBase => "rb",
        }
    }

    /// The default scenario of this kind.
    #[must_use]
    pub const fn scenario(self) -> Scenario {
        match self {
            ScenarioKind::ReachDestination => Scenario::reach_destination(),
            ScenarioKind::ReturnBase => Scenario::return_base(),
        }
    }
}

impl fmt::Display for ScenarioKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ScenarioKind {
    type Err = ScenarioError;

    fn from_str(name: &str) -> Result<ScenarioKind, ScenarioError> {
        ScenarioKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or(ScenarioError::Unknown)
    }
}

/// A mission before the devices are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Start cell.
    pub start: Cell,
    /// A move into this cell ends it.
    pub terminal: Cell,
    /// B: energy at the start.
    pub battery: BatteryUnits,
    /// K: number of devices.
    pub device_count: usize,
}

/// Why a scenario or a realization does not fit a city.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ScenarioError {
    /// Not the name of a scenario.
    #[error("unknown scenario: use rd or rb")]
    Unknown,
    /// Start or terminal lies outside the city or on a building.
    #[error("{0} is no open cell of this city: choose another start or terminal")]
    ZoneNotOpen(Cell),
    /// A device lies outside the city or on a building.
    #[error("{0} is no open cell of this city: choose another place for the device")]
    DeviceNotOpen(Cell),
    /// The initial data is not a positive, finite amount.
    #[error("the data of the device at {0} is not a positive amount")]
    DeviceData(Cell),
    /// The battery is negative, not finite, or does not reach the terminal.
    #[error("the battery does not last for the {moves} moves to the terminal: start with more")]
    BatteryTooSmall {
        /// Moves of the shortest mission.
        moves: u32,
    },
    /// The city has no room for this number of devices at their least distance.
    #[error("the city has no room for {0} devices 100 m apart: ask for fewer")]
    TooManyDevices(usize),
}

impl Scenario {
    /// RD with 6 devices and 80 battery units: 32 cells from start to terminal.
    #[must_use]
    pub const fn reach_destination() -> Scenario {
        Scenario {
            start: Cell::new(10, 6),
            terminal: Cell::new(30, 18),
            battery: BatteryUnits(80.0),
            device_count: 6,
        }
    }

    /// RB with 6 devices and 80 battery units, from the middle of the city.
    #[must_use]
    pub const fn return_base() -> Scenario {
        let base = Cell::new(20, 15);
        Scenario { start: base, terminal: base, battery: BatteryUnits(80.0), device_count: 6 }
    }

    /// The same with another number of devices.
    #[must_use]
    pub const fn with_devices(self, device_count: usize) -> Scenario {
        Scenario { device_count, ..self }
    }

    /// The same with another battery.
    #[must_use]
    pub const fn with_battery(self, battery: BatteryUnits) -> Scenario {
        Scenario { battery, ..self }
    }

    /// The same in another city, with start and terminal on the nearest open cells, the first of equal ones.
    #[must_use]
    pub fn in_city(self, city: &City) -> Scenario {
        let open_near = |zone: Cell| {
            city.open_cells().iter().copied().min_by_key(|cell| cell.manhattan(zone)).unwrap_or(zone)
        };
        Scenario { start: open_near(self.start), terminal: open_near(self.terminal), ..self }
    }

    /// Moves of the shortest mission on an open map. Two if start and terminal are one cell: only a *move* into the
    /// terminal ends a mission.
    #[must_use]
    pub const fn shortest_moves(&self) -> u32 {
        match self.start.manhattan(self.terminal) {
            0 => 2,
            moves => moves,
        }
    }

    /// Whether the mission can be flown in this city.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn check(&self, city: &City) -> Result<(), ScenarioError> {
        for zone in [self.start, self.terminal] {
            if !city.is_open(zone) {
                return Err(ScenarioError::ZoneNotOpen(zone));
            }
        }
        let moves = self.shortest_moves();
        if self.battery.0.is_finite() && self.battery.0 >= moves as f32 {
            Ok(())
        } else {
            Err(ScenarioError::BatteryTooSmall { moves })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_scenarios_fit_the_default_city() {
        let city = City::default_city();
        for kind in ScenarioKind::ALL {
            assert_eq!(kind.scenario().check(&city), Ok(()));
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        assert_eq!(Scenario::reach_destination().shortest_moves(), 32);
        assert_eq!(Scenario::return_base().shortest_moves(), 2);
        assert_eq!("up".parse::<ScenarioKind>(), Err(ScenarioError::Unknown));
    }

    #[test]
    fn impossible_scenarios_are_refused() {
        let city = City::default_city();
        let rd = Scenario::reach_destination();
        let short = rd.with_battery(BatteryUnits(31.5));
        assert_eq!(short.check(&city), Err(ScenarioError::BatteryTooSmall { moves: 32 }));
        let nan = rd.with_battery(BatteryUnits(f32::NAN));
        assert_eq!(nan.check(&city), Err(ScenarioError::BatteryTooSmall { moves: 32 }));
        let roof = city.grid().cells().find(|&cell| !city.is_open(cell)).unwrap();
        assert_eq!(Scenario { start: roof, ..rd }.check(&city), Err(ScenarioError::ZoneNotOpen(roof)));
        let away = Cell::new(40, 0);
        assert_eq!(Scenario { terminal: away, ..rd }.check(&city), Err(ScenarioError::ZoneNotOpen(away)));
    }
}
