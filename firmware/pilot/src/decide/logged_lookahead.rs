//! Look-ahead in a decision log: what it was given, and its answer.

use super::LookAheadRecord;
use crate::Mission;
use gleaner_guard::Guard;
use gleaner_policy::DeviceState;
use gleaner_units::{BatteryUnits, Cell, CellSet, Grid, HeightMap, Metres};
use serde::{Deserialize, Serialize};
use std::vec::Vec;

/// What the look-ahead was given, and its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoggedLookAhead {
    /// Its answer.
    #[serde(flatten)]
    pub record: LookAheadRecord,
    /// Battery units kept back on top of the way home.
    pub reserve: f32,
    /// The devices, in the mission's order.
    pub devices: Vec<LoggedDevice>,
    /// The mission, with its first decision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mission: Option<LoggedMission>,
}

/// One device at a decision.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoggedDevice {
    /// Data units left.
    pub remaining: f32,
    /// SNR, dB; `None` if there is no report that is young enough.
    pub snr_db: Option<f32>,
}

/// What the look-ahead knows of a mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoggedMission {
    /// Columns and rows of the grid.
    pub cells: [u16; 2],
    /// Side of a cell, m.
    pub cell_m: f32,
    /// Flight altitude, m.
    pub altitude_m: u16,
    /// Building heights, m, row by row from the south-west.
    pub heights_m: Vec<u8>,
    /// Cells outside the fence.
    pub closed: Vec<[i16; 2]>,
    /// The cell that ends the mission.
    pub terminal: [i16; 2],
    /// The devices' cells.
    pub devices: Vec<[i16; 2]>,
    /// Data units at the start, by device.
    pub data: Vec<f32>,
}

impl LoggedLookAhead {
    /// The entry of a decision. `devices` are those of the mission when it was decided.
    #[must_use]
    pub fn new(
        record: LookAheadRecord,
        mission: &Mission,
        (altitude, reserve): (Metres, BatteryUnits),
        devices: impl IntoIterator<Item = DeviceState>,
    ) -> LoggedLookAhead {
        let logged = |device: DeviceState| LoggedDevice {
            remaining: device.remaining,
            snr_db: device.snr.map(|snr| snr.0),
        };
        LoggedLookAhead {
            record,
            reserve: reserve.0,
            devices: devices.into_iter().map(logged).collect(),
            mission: (record.slot == 0).then(|| LoggedMission::new(mission, altitude)),
        }
    }
}

impl LoggedMission {
    fn new(mission: &Mission, altitude: Metres) -> LoggedMission {
        let grid = mission.grid();
        let pair = |cell: Cell| [cell.x, cell.y];
        LoggedMission {
            cells: [grid.width(), grid.height()],
            cell_m: grid.cell().0,
            altitude_m: altitude.0 as u16,
            heights_m: mission.heights.as_slice().to_vec(),
            closed: grid.cells().filter(|&cell| !mission.fence.contains(cell)).map(pair).collect(),
            terminal: pair(mission.terminal),
            devices: mission.devices.iter().map(|site| pair(site.cell)).collect(),
            data: mission.devices.iter().map(|site| site.data).collect(),
        }
    }

    /// The buildings and the envelope; `None` if the entry makes no sense.
    pub(super) fn restore(&self) -> Option<(HeightMap, Guard)> {
        let cell = |&[x, y]: &[i16; 2]| Cell::new(x, y);
        let [width, height] = self.cells;
        let grid = Grid::new(width, height, Metres(self.cell_m)).ok()?;
        let mut heights = HeightMap::flat(grid);
        for (place, &height_m) in grid.cells().zip(&self.heights_m) {
            heights.set(place, height_m);
        }
        let mut fence = CellSet::full(grid);
        self.closed.iter().for_each(|closed| fence.remove(cell(closed)));
        let guard = Guard::new(&fence, cell(&self.terminal), BatteryUnits(0.0)).ok()?;
        Some((heights, guard))
    }

    pub(super) fn sites(&self) -> impl Iterator<Item = DeviceState> + '_ {
        let cells = self.devices.iter().zip(&self.data);
        cells.map(|(&[x, y], &remaining)| DeviceState { cell: Cell::new(x, y), remaining, snr: None })
    }
}
