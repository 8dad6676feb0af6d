//! Look-ahead in a decision log, and how its decisions are made again.
//!
//! The look-ahead keeps a plan and a channel fit from slot to slot. A log therefore holds the mission with the first
//! decision of each mission, and with every decision what the look-ahead was given. Equal inputs in equal order give
//! equal choices, bit by bit.

use super::{Deliberator, LoggedDecision, LookAheadRecord, LookingAhead, Place};
use crate::Mission;
use gleaner_guard::Guard;
use gleaner_lookahead::Budget;
use gleaner_policy::{DeviceState, Inference, Policy, Preference, Tokens};
use gleaner_units::{Action, BatteryUnits, Cell, CellSet, Db, Grid, HeightMap, Metres, Rays, Sight};
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
    fn restore(&self) -> Option<(HeightMap, Guard)> {
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

    fn sites(&self) -> impl Iterator<Item = DeviceState> + '_ {
        let cells = self.devices.iter().zip(&self.data);
        cells.map(|(&[x, y], &remaining)| DeviceState { cell: Cell::new(x, y), remaining, snr: None })
    }
}

/// A decision made again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Replayed {
    /// The look-ahead's answer.
    Choice(Action, LookAheadRecord),
    /// The log begins in flight, or an earlier decision of the mission is missing.
    Incomplete,
}

/// Makes the decisions of a log again, in order.
#[derive(Debug, Default)]
pub struct LookAheadReplay {
    mission: Option<UnderWay>,
}

#[derive(Debug)]
struct UnderWay {
    run_s: u64,
    planner: LookingAhead<NoNetwork>,
    mission: LoggedMission,
    guard: Guard,
    next: u16,
}

/// Stands where the network's logits come from the log.
#[derive(Debug)]
struct NoNetwork;

impl Policy for NoNetwork {
    type Error = ();

    fn infer(&mut self, _: &Tokens) -> Result<Inference, ()> {
        Err(())
    }
}

impl LookAheadReplay {
    /// Makes one decision again, with these logits of the network. To be called for every decision with look-ahead, in
    /// the order of the log.
    pub fn decide(
        &mut self,
        logged: &LoggedDecision,
        entry: &LoggedLookAhead,
        logits: &[f32; Action::COUNT],
    ) -> Replayed {
        if let Some(mission) = &entry.mission {
            self.mission = UnderWay::begin(logged.run_s, mission.clone(), entry);
        }
        let record = &entry.record;
        let follows =
            |under_way: &&mut UnderWay| under_way.run_s == logged.run_s && under_way.next == record.slot;
        match self.mission.as_mut().filter(follows).and_then(|it| it.decide(logged, entry, logits)) {
            Some((action, record)) => Replayed::Choice(action, record),
            None => {
                self.mission = None;
                Replayed::Incomplete
            }
        }
    }
}

impl UnderWay {
    fn begin(run_s: u64, mission: LoggedMission, entry: &LoggedLookAhead) -> Option<UnderWay> {
        let (heights, guard) = mission.restore()?;
        let rays = Rays { heights: &heights, altitude_m: mission.altitude_m };
        let has_map = heights.tallest().0 > 0.0;
        let mut planner = LookingAhead::new(NoNetwork, Budget::NONE);
        planner.begin(has_map.then_some(&rays as &dyn Sight), mission.sites(), entry.record.seed);
        Some(UnderWay { run_s, planner, mission, guard, next: 0 })
    }

    fn decide(
        &mut self,
        logged: &LoggedDecision,
        entry: &LoggedLookAhead,
        logits: &[f32; Action::COUNT],
    ) -> Option<(Action, LookAheadRecord)> {
        self.guard.set_reserve(BatteryUnits(entry.reserve)).ok()?;
        let [x, y] = logged.cell;
        let place = Place {
            cell: Cell::new(x, y),
            battery: BatteryUnits(logged.battery),
            preference: Preference::new(logged.w_data)?,
            guard: &self.guard,
        };
        let devices = self.mission.sites().zip(&entry.devices).map(|(site, device)| DeviceState {
            remaining: device.remaining,
            snr: device.snr_db.map(Db),
            ..site
        });
        self.planner.set_budget(Budget { tours: entry.record.budget });
        self.next = self.next.saturating_add(1);
        self.planner.propose(&place, devices, logits, logged.mask, entry.record.budget > 0)
    }
}
