//! The mission: everything that is fixed before take-off.

#[cfg(feature = "std")]
pub mod file;
pub mod image;

use core::fmt;
use gleaner_guard::{Guard, GuardError};
use gleaner_units::{BatteryUnits, Cell, CellSet, Degrees, GeoPoint, Grid, GridPose, HeightMap};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The most devices in one mission.
pub const MAX_DEVICES: usize = 64;

/// One ground device as the mission knows it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceSite {
    /// The number that its radio reports carry.
    pub id: u32,
    /// Where it stands.
    pub cell: Cell,
    /// Data that it holds at the start, data units.
    pub data: f32,
}

/// City, fence, terminal, battery budget, devices. About five kilobytes, no heap.
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// The city.
    pub heights: HeightMap,
    /// The cells that may be flown over.
    pub fence: CellSet,
    /// Position and rotation of the grid.
    pub pose: GridPose,
    /// The cell that ends the mission; the aircraft lands there.
    pub terminal: Cell,
    /// The most battery that the mission may use (paper, B).
    pub budget: BatteryUnits,
    /// The devices, in the order that decisions name them.
    pub devices: Vec<DeviceSite, MAX_DEVICES>,
}

/// Why a mission cannot be flown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionError {
    /// The fence belongs to another grid than the city.
    FenceGrid,
    /// Fence and terminal allow no way home.
    Guard(GuardError),
    /// The corner is no point of the globe.
    Corner,
    /// The grid's rotation is not an angle from -180 to 180 degrees.
    Rotation,
    /// The battery budget is not a positive number.
    Budget,
    /// This device stands outside the city.
    DeviceOutside {
        /// Its id.
        id: u32,
    },
    /// Two devices have this id.
    DuplicateDevice {
        /// The id.
        id: u32,
    },
    /// This device's data is negative or not a number.
    DeviceData {
        /// Its id.
        id: u32,
    },
}

impl fmt::Display for MissionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MissionError::FenceGrid => write!(f, "the fence belongs to another grid than the city"),
            MissionError::Guard(error) => write!(f, "{error}"),
            MissionError::Corner => write!(f, "the grid's corner is not a latitude and longitude"),
            MissionError::Rotation => write!(f, "the grid's rotation is not from -180 to 180 degrees"),
            MissionError::Budget => write!(f, "battery_units is not a number above 0"),
            MissionError::DeviceOutside { id } => write!(f, "device {id} stands outside the city"),
            MissionError::DuplicateDevice { id } => write!(f, "two devices have the id {id}"),
            MissionError::DeviceData { id } => write!(f, "the data of device {id} is not a number >= 0"),
        }
    }
}

impl core::error::Error for MissionError {}

impl Mission {
    /// No mission: one cell that nothing may fly over, which [`Mission::check`] refuses.
    #[must_use]
    pub const fn nowhere() -> Mission {
        Mission {
            heights: HeightMap::flat(Grid::ONE_CELL),
            fence: CellSet::empty(Grid::ONE_CELL),
            pose: GridPose { corner: GeoPoint { lat_deg_e7: 0, lon_deg_e7: 0 }, rotation: Degrees(0.0) },
            terminal: Cell::new(0, 0),
            budget: BatteryUnits(0.0),
            devices: Vec::new(),
        }
    }

    /// The grid of the city.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.heights.grid()
    }

    /// Data of all devices at the start, data units.
    #[must_use]
    pub fn initial_data(&self) -> f32 {
        self.devices.iter().map(|device| device.data).sum()
    }

    /// A number for random draws: equal for equal missions (FNV-1a over terminal and devices).
    #[must_use]
    pub fn seed(&self) -> u32 {
        let sites = self.devices.iter().map(|site| (site.cell, site.data.to_bits()));
        sites.fold(mix(0x811C_9DC5, self.terminal, 0), |hash, (cell, data)| mix(hash, cell, data))
    }

    /// Whether the mission makes sense.
    ///
    /// # Errors
    /// The first fault, see [`MissionError`].
    pub fn check(&self) -> Result<(), MissionError> {
        if self.fence.grid() != self.grid() {
            return Err(MissionError::FenceGrid);
        }
        let GridPose { corner: GeoPoint { lat_deg_e7, lon_deg_e7 }, rotation } = self.pose;
        if lat_deg_e7.unsigned_abs() > 900_000_000 || lon_deg_e7.unsigned_abs() > 1_800_000_000 {
            return Err(MissionError::Corner);
        }
        if !(-180.0..=180.0).contains(&rotation.0) {
            return Err(MissionError::Rotation);
        }
        if !(self.budget.0.is_finite() && self.budget.0 > 0.0) {
            return Err(MissionError::Budget);
        }
        for (index, &DeviceSite { id, cell, data }) in self.devices.iter().enumerate() {
            if !self.grid().contains(cell) {
                return Err(MissionError::DeviceOutside { id });
            }
            if self.devices.iter().take(index).any(|other| other.id == id) {
                return Err(MissionError::DuplicateDevice { id });
            }
            if !(data.is_finite() && data >= 0.0) {
                return Err(MissionError::DeviceData { id });
            }
        }
        Guard::check(&self.fence, self.terminal).map_err(MissionError::Guard)
    }

    /// The envelope of this mission with `reserve` kept back.
    ///
    /// # Errors
    /// As [`Mission::check`], or the reserve is no number of battery units.
    pub fn guard(&self, reserve: BatteryUnits) -> Result<Guard, MissionError> {
        self.check()?;
        Guard::new(&self.fence, self.terminal, reserve).map_err(MissionError::Guard)
    }
}

/// FNV-1a over a cell and a number.
fn mix(hash: u32, cell: Cell, number: u32) -> u32 {
    let [x, y] = [cell.x, cell.y].map(i16::to_le_bytes);
    let bytes = x.into_iter().chain(y).chain(number.to_le_bytes());
    bytes.fold(hash, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}
