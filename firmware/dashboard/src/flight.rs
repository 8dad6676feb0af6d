//! What the page shows: the scene that is fixed before the flight, and the events of the flight.
//!
//! All of it is JSON for `assets/*.js`, which reads the same names. Absent is `null`. Cells count from the south-west
//! corner of the grid, x to grid east, y to grid north; positions are in cells, so the centre of cell (3, 4) is
//! (3.5, 4.5).

use serde::{Deserialize, Serialize};

/// Points of the track that are kept for viewers who come later, one a second at most. Above this every second one is
/// dropped, so that a day-long flight still fits.
const LIVE_MAX: usize = 4_000;
/// Decisions and messages that are kept.
const ENTRIES_MAX: usize = 10_000;
/// Shortest time between two kept points of the track, s.
const LIVE_INTERVAL_S: f64 = 1.0;
/// Shortest time between two kept predictions, s.
const WHAT_IF_INTERVAL_S: f64 = 10.0;

/// What is fixed before the flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// One line: mission, model, engine, autopilot.
    pub title: String,
    /// The grid.
    pub grid: Grid,
    /// Building height of each cell, m: `[height * width]`, row by row from the south-west.
    pub heights_m: Vec<u8>,
    /// Whether each cell may be flown over, in the order of `heights_m`; `None` where all may.
    pub fence: Option<Vec<bool>>,
    /// For each device the cells with line of sight to it at `altitude_m`: `1` or `0`, in the order of `heights_m`.
    pub sight: Vec<String>,
    /// Flight altitude above the ground, m.
    pub altitude_m: u16,
    /// The cell that ends the mission.
    pub terminal: [i16; 2],
    /// The devices, in the mission's order.
    pub devices: Vec<Device>,
    /// Battery units that the mission may use.
    pub battery_units: f32,
    /// Whether the page shows controls.
    pub controls: bool,
    /// Names of the incidents that can be caused; empty outside a simulation.
    pub incidents: Vec<String>,
}

/// The grid of the city.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Cells from west to east.
    pub width: u16,
    /// Cells from south to north.
    pub height: u16,
    /// Length of a cell, m.
    pub cell_m: f32,
    /// Clockwise angle from true north to grid north, degrees.
    pub rotation_deg: f32,
}

/// A ground device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// The id in its radio reports.
    pub id: u32,
    /// Its cell.
    pub x: i16,
    /// Its cell.
    pub y: i16,
    /// Data at the start, data units.
    pub data: f32,
}

/// The aircraft at one moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Live {
    /// Since the start of the program, s.
    pub t_s: f64,
    /// Name of the pilot's state.
    pub state: String,
    /// Who has the aircraft, in words.
    pub owner: String,
    /// Why it waits, returns or gave up, in words; empty while the mission runs.
    pub reason: String,
    /// Name of the autopilot's mode.
    pub mode: String,
    /// Position east, cells; `None` without a position.
    pub x: Option<f32>,
    /// Position north, cells.
    pub y: Option<f32>,
    /// Height above the take-off point, m.
    pub height_m: Option<f32>,
    /// Battery units left in the mission's budget.
    pub battery_units: Option<f32>,
    /// Battery units beyond the way to the terminal and the reserve.
    pub spare_units: Option<f32>,
    /// Measured charge, percent.
    pub battery_pct: Option<f32>,
    /// Charge expected at touchdown, percent.
    pub land_pct: Option<f32>,
    /// Weight of data.
    pub w_data: f32,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// The devices, in the mission's order.
    pub devices: Vec<DeviceState>,
}

impl Live {
    /// Leaves out digits that the page does not show: a flight of ten minutes then stays below half a megabyte.
    #[must_use]
    pub fn rounded(mut self) -> Live {
        for value in [&mut self.x, &mut self.y].into_iter().flatten() {
            *value = round(*value, 1_000.0);
        }
        let tenths = [&mut self.height_m, &mut self.battery_units, &mut self.spare_units, &mut self.land_pct];
        for value in tenths.into_iter().flatten() {
            *value = round(*value, 10.0);
        }
        self.collected = round(self.collected, 10_000.0);
        for device in &mut self.devices {
            device.remaining = device.remaining.round();
            device.snr_db = device.snr_db.map(|snr_db| round(snr_db, 10.0));
        }
        self
    }
}

/// To a multiple of `1 / per`.
pub(crate) fn round(value: f32, per: f32) -> f32 {
    (value * per).round() / per
}

/// A device at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceState {
    /// Data left, data units.
    pub remaining: f32,
    /// SNR of the newest report, dB; `None` where there is none or it is too old.
    pub snr_db: Option<f32>,
    /// Whether data would flow.
    pub reachable: bool,
}

/// A decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Since the start of the program, s.
    pub t_s: f64,
    /// Counts from 0.
    pub sequence: u32,
    /// Where.
    pub cell: [i16; 2],
    /// Name of the action.
    pub action: String,
    /// Which actions the guard allowed, in the order hover, north, west, south, east.
    pub allowed: [bool; 5],
    /// Probability of each action among the allowed ones; `None` where the guard decided alone.
    pub probabilities: Option<[f32; 5]>,
    /// Attention of the second layer, mean over the heads: rows attend to columns; aircraft, preference, map, then the
    /// devices of `slots`. `None` where the guard decided alone.
    pub attention: Option<Vec<Vec<f32>>>,
    /// Index in the mission of the device in each device token.
    pub slots: Vec<u16>,
    /// What decided, in words: network, kept plan, guard.
    pub source: Option<String>,
}

/// A message to the operator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Text {
    /// Since the start of the program, s.
    pub t_s: f64,
    /// As in RFC 5424: 0 emergency to 7 debug.
    pub severity: u8,
    /// The message.
    pub text: String,
}

/// The flight from here at several preferences, predicted with the on-board model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WhatIf {
    /// Since the start of the program, s.
    pub t_s: f64,
    /// One for each preference, in rising order of the weight of data.
    pub options: Vec<WhatIfOption>,
}

/// The predicted flight at one preference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WhatIfOption {
    /// Weight of data.
    pub w: f32,
    /// From here to the terminal: straight lines between these cells.
    pub path: Vec<[i16; 2]>,
    /// Expected fraction of the initial data at the end.
    pub collected: f32,
    /// Battery units from here to the end.
    pub energy: f32,
}

/// A change that is sent to viewers.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The aircraft moved on; at most five a second.
    Live(Live),
    /// A decision was made.
    Decision(Decision),
    /// A text was sent to the operator.
    Text(Text),
    /// New predictions.
    WhatIf(WhatIf),
}

impl Event {
    /// The name and the JSON of the event, as the stream carries them.
    pub(crate) fn encode(&self) -> (&'static str, String) {
        match self {
            Event::Live(live) => ("live", json(&live.clone().rounded())),
            Event::Decision(decision) => ("decision", json(decision)),
            Event::Text(text) => ("text", json(text)),
            Event::WhatIf(what_if) => ("what_if", json(what_if)),
        }
    }
}

/// Serialising cannot fail here: every key is a string.
pub(crate) fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// A flight so far: what a viewer needs at first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flight {
    /// What is fixed.
    pub scene: Scene,
    /// The track, in order of time.
    pub live: Vec<Live>,
    /// The decisions, in order of time.
    pub decisions: Vec<Decision>,
    /// The messages, in order of time.
    pub texts: Vec<Text>,
    /// The predictions, in order of time.
    pub what_if: Vec<WhatIf>,
}

impl Flight {
    /// A flight before its first event.
    #[must_use]
    pub const fn new(scene: Scene) -> Flight {
        Flight { scene, live: Vec::new(), decisions: Vec::new(), texts: Vec::new(), what_if: Vec::new() }
    }

    /// Adds an event. The track keeps one point a second, and the newest.
    pub fn add(&mut self, event: Event) {
        match event {
            Event::Live(live) => self.add_live(live),
            Event::Decision(decision) => push_bounded(&mut self.decisions, decision),
            Event::Text(text) => push_bounded(&mut self.texts, text),
            Event::WhatIf(what_if) => self.add_what_if(what_if),
        }
    }

    /// Keeps one prediction in ten seconds, and the newest.
    fn add_what_if(&mut self, what_if: WhatIf) {
        let before = self.what_if.len().checked_sub(2).map(|index| self.what_if[index].t_s);
        match self.what_if.last_mut() {
            Some(newest) if before.is_some_and(|before| what_if.t_s - before < WHAT_IF_INTERVAL_S) => {
                *newest = what_if;
            }
            _ => push_bounded(&mut self.what_if, what_if),
        }
    }

    fn add_live(&mut self, live: Live) {
        let live = live.rounded();
        let before = self.live.len().checked_sub(2).map(|index| self.live[index].t_s);
        match self.live.last_mut() {
            Some(newest) if before.is_some_and(|before| live.t_s - before < LIVE_INTERVAL_S) => {
                *newest = live
            }
            _ => self.live.push(live),
        }
        if self.live.len() > LIVE_MAX {
            let mut index = 0;
            self.live.retain(|_| {
                index += 1;
                index % 2 == 1
            });
        }
    }
}

/// Drops the older half when the list is full.
fn push_bounded<T>(list: &mut Vec<T>, entry: T) {
    if list.len() >= ENTRIES_MAX {
        list.drain(..ENTRIES_MAX / 2);
    }
    list.push(entry);
}
