//! Mission files: TOML text to a [`Mission`] and back. Opens nothing: the program hands over the texts.
//!
//! ```toml
//! terminal = [30, 18]             # cell x (east), y (north): the mission ends and lands here
//! terminal_height_m = 0.0         # needed where the terminal is on a building: its height in the city
//! battery_units = 80.0            # the most that the mission may use; one unit is one move
//!
//! [grid]
//! corner_lat_deg = -35.3632621    # south-west corner of cell (0, 0)
//! corner_lon_deg = 149.1652374
//! rotation_deg = 0.0              # optional: direction of the grid's north axis, clockwise from true north
//! cell_m = 20.0
//! heights = "city.csv"            # building heights above the ground, one row a line from north to south
//! ground = "ground.csv"           # optional: ground heights above a common level, a table like `heights`
//! take_off_ground_m = 12.0        # with `ground`: the ground height at the take-off point
//! highest_m = 75                  # instead of `ground`: the highest roof or hill above the take-off point
//!
//! [fence]                         # optional: without it all of the grid may be flown over
//! allowed = [[0, 0], [39, 29]]    # south-west and north-east cell of a rectangle
//! excluded = [[12, 7]]            # cells taken out
//!
//! [[device]]
//! id = 1                          # as in its radio reports; or dev_addr = "26011BDA", or dev_eui (its low 8 digits)
//! cell = [11, 4]                  # or lat_deg and lon_deg
//! data = 6000.0                   # data units at the start
//! ```

mod output;
mod place;

pub use output::write;

use crate::{DeviceSite, Mission, MissionError};
use gleaner_guard::GuardError;
use gleaner_units::city_file::{CityFileError, read_city};
use gleaner_units::{BatteryUnits, Cell, CellSet, Degrees, GeoPoint, GridPose, HeightMap, Metres};
use place::{cell_at, degrees_e7, roof_m};
use serde::Deserialize;
use std::format;
use std::string::String;
use std::vec::Vec;
use toml::Spanned;

/// What is wrong with a mission file, in one line that says where and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MissionFileError {
    /// Not TOML, a key that does not exist, one that is missing, or a value of the wrong kind.
    #[error("line {line}: {message}")]
    Syntax {
        /// Counted from 1.
        line: usize,
        /// What the TOML reader says.
        message: String,
    },
    /// A value that makes no sense.
    #[error("line {line}: {what}")]
    Value {
        /// Counted from 1.
        line: usize,
        /// What is wrong and what to do.
        what: String,
    },
    /// The city file could not be had; the text is the caller's.
    #[error("line {line}: heights \"{path}\": {cause}")]
    CityMissing {
        /// Line of the `heights` key.
        line: usize,
        /// The path as the mission file has it.
        path: String,
        /// Why, in the caller's words.
        cause: String,
    },
    /// The city file is wrong.
    #[error("heights \"{path}\", {fault}")]
    City {
        /// The path as the mission file has it.
        path: String,
        /// Where and what.
        fault: CityFileError,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    terminal: Spanned<[i16; 2]>,
    terminal_height_m: Option<Spanned<f32>>,
    battery_units: Spanned<f32>,
    grid: GridTable,
    fence: Option<FenceTable>,
    #[serde(default, rename = "device")]
    devices: Vec<Spanned<DeviceTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GridTable {
    corner_lat_deg: Spanned<f64>,
    corner_lon_deg: Spanned<f64>,
    rotation_deg: Option<Spanned<f32>>,
    cell_m: Spanned<f32>,
    heights: Spanned<String>,
    ground: Option<Spanned<String>>,
    take_off_ground_m: Option<Spanned<f32>>,
    highest_m: Option<Spanned<u16>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FenceTable {
    allowed: Option<Spanned<[[i16; 2]; 2]>>,
    #[serde(default)]
    excluded: Vec<Spanned<[i16; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DeviceTable {
    id: Option<DeviceId>,
    dev_addr: Option<String>,
    dev_eui: Option<String>,
    cell: Option<[i16; 2]>,
    lat_deg: Option<f64>,
    lon_deg: Option<f64>,
    data: f32,
}

/// A number, or eight hexadecimal digits.
#[derive(Deserialize)]
#[serde(untagged)]
enum DeviceId {
    Number(u32),
    Text(String),
}

/// Exactly this many hexadecimal digits.
fn hexadecimal(text: &str, digits: usize) -> Option<u64> {
    let is_hexadecimal = text.len() == digits && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    u64::from_str_radix(text, 16).ok().filter(|_| is_hexadecimal)
}

impl DeviceTable {
    /// The id in the device's radio reports: `id`, the LoRaWAN device address, or the low half of the device EUI.
    fn number(&self) -> Result<u32, &'static str> {
        match (&self.id, &self.dev_addr, &self.dev_eui) {
            (Some(DeviceId::Number(id)), None, None) => Ok(*id),
            (Some(DeviceId::Text(text)), None, None) | (None, Some(text), None) => hexadecimal(text, 8)
                .map(|address| address as u32)
                .ok_or("a device address has 8 hexadecimal digits, such as \"26011BDA\""),
            (None, None, Some(text)) => hexadecimal(text, 16)
                .map(|eui| eui as u32)
                .ok_or("dev_eui has 16 hexadecimal digits, such as \"70B3D57ED0001BDA\""),
            _ => Err("a device has either id, dev_addr or dev_eui: give one of them"),
        }
    }
}

/// Reads a mission file. `city` gives the text of the city file for the path in `heights`, which is relative to
/// the mission file; its error text is passed on.
///
/// # Errors
/// The first fault, see [`MissionFileError`].
pub fn read(
    text: &str,
    city: impl FnMut(&str) -> Result<String, String>,
) -> Result<Mission, MissionFileError> {
    let file: File = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(1, |span| line_of(text, span.start));
        let mut message = error.message().replace('\n', " ");
        if text.lines().nth(line - 1).is_some_and(has_decimal_comma) {
            message = "a decimal comma: write a point".into();
        }
        MissionFileError::Syntax { line, message }
    })?;
    Reader { text }.mission(file, city)
}

struct Reader<'t> {
    text: &'t str,
}

impl Reader<'_> {
    fn line<T>(&self, value: &Spanned<T>) -> usize {
        line_of(self.text, value.span().start)
    }

    fn fault<T>(&self, at: &Spanned<T>, what: impl Into<String>) -> MissionFileError {
        MissionFileError::Value { line: self.line(at), what: what.into() }
    }

    fn mission(
        &self,
        file: File,
        mut city: impl FnMut(&str) -> Result<String, String>,
    ) -> Result<Mission, MissionFileError> {
        let mut heights = self.heights(&file.grid, &file.grid.heights, &mut city)?;
        if let Some(highest_m) = self.highest_m(&file.grid, &heights, &mut city)? {
            heights.set_highest(highest_m);
        }
        let corner = GeoPoint {
            lat_deg_e7: self.degrees(&file.grid.corner_lat_deg, 90.0)?,
            lon_deg_e7: self.degrees(&file.grid.corner_lon_deg, 180.0)?,
        };
        let mut mission = Mission {
            fence: self.fence(&heights, file.fence.as_ref())?,
            heights,
            pose: GridPose { corner, rotation: self.rotation(&file.grid)? },
            terminal: cell(*file.terminal.get_ref()),
            budget: BatteryUnits(*file.battery_units.get_ref()),
            devices: heapless::Vec::new(),
        };
        for entry in &file.devices {
            let site = self.site(&mission, entry)?;
            if let Some(first) = mission.devices.iter().position(|other| other.id == site.id) {
                let first = file.devices.get(first).map_or(0, |first| self.line(first));
                return Err(self.fault(
                    entry,
                    format!("device {} is already in line {first}: correct one of the ids", site.id),
                ));
            }
            mission.devices.push(site).map_err(|_| {
                self.fault(entry, format!("more than {} devices: take some out", crate::MAX_DEVICES))
            })?;
            // Checked one by one, so that the line is that of the device at fault.
            mission.check().map_err(|error| match error {
                MissionError::Guard(GuardError::TerminalOutsideFence | GuardError::TerminalIsolated) => {
                    self.fault(&file.terminal, format!("{error}: move the terminal or widen the fence"))
                }
                MissionError::Budget => self.fault(&file.battery_units, format!("{error}: give one")),
                _ => self.fault(entry, format!("{error}: correct this device")),
            })?;
        }
        mission.check().map_err(|error| match error {
            MissionError::Budget => self.fault(&file.battery_units, format!("{error}: give one")),
            _ => self.fault(&file.terminal, format!("{error}: move the terminal or widen the fence")),
        })?;
        self.landing(&file, &mission)?;
        Ok(mission)
    }

    /// The aircraft lands at the terminal. On a building it does so only if the mission states the height.
    fn landing(&self, file: &File, mission: &Mission) -> Result<(), MissionFileError> {
        let roof_m = roof_m(mission);
        match &file.terminal_height_m {
            None if roof_m > 0.0 => Err(self.fault(
                &file.terminal,
                format!(
                    "the terminal {} is on a building of {roof_m} m, where the aircraft would land: move it, or write terminal_height_m = {roof_m}",
                    mission.terminal
                ),
            )),
            Some(stated) if *stated.get_ref() != roof_m => Err(self.fault(
                stated,
                format!(
                    "terminal_height_m = {}, but the city has {roof_m} m at {}: correct one of them",
                    stated.get_ref(),
                    mission.terminal
                ),
            )),
            _ => Ok(()),
        }
    }

    fn heights(
        &self,
        grid: &GridTable,
        table: &Spanned<String>,
        city: &mut impl FnMut(&str) -> Result<String, String>,
    ) -> Result<HeightMap, MissionFileError> {
        let path = table.get_ref().clone();
        let cell_m = *grid.cell_m.get_ref();
        if !(cell_m.is_finite() && cell_m > 0.0) {
            return Err(self.fault(&grid.cell_m, "cell_m is not a length above 0: give the side in metres"));
        }
        let csv = city(&path).map_err(|cause| MissionFileError::CityMissing {
            line: self.line(table),
            path: path.clone(),
            cause,
        })?;
        let city = read_city(csv.as_bytes(), Metres(cell_m));
        city.map(|city| city.heights).map_err(|fault| MissionFileError::City { path, fault })
    }

    /// The highest roof or hill above the take-off point, where the ground is not flat.
    fn highest_m(
        &self,
        grid: &GridTable,
        heights: &HeightMap,
        city: &mut impl FnMut(&str) -> Result<String, String>,
    ) -> Result<Option<u16>, MissionFileError> {
        let Some(table) = &grid.ground else {
            if let Some(stray) = &grid.take_off_ground_m {
                return Err(
                    self.fault(stray, "take_off_ground_m without ground: name the table, or remove it")
                );
            }
            return Ok(grid.highest_m.as_ref().map(|highest| *highest.get_ref()));
        };
        if let Some(stray) = &grid.highest_m {
            return Err(self.fault(stray, "highest_m beside ground: remove one of them"));
        }
        let Some(take_off) = grid.take_off_ground_m.as_ref().filter(|value| value.get_ref().is_finite())
        else {
            return Err(self.fault(table, "ground without take_off_ground_m: give the ground height there"));
        };
        let ground = self.heights(grid, table, city)?;
        if ground.grid() != heights.grid() {
            return Err(self.fault(table, "ground has not as many rows and columns as heights: correct one"));
        }
        let tops = ground.as_slice().iter().zip(heights.as_slice());
        let highest = tops.map(|(&ground, &roof)| u16::from(ground) + u16::from(roof)).max().unwrap_or(0);
        // Out of range saturates; rounded up, as heights are.
        Ok(Some(libm::ceilf(f32::from(highest) - take_off.get_ref()) as u16))
    }

    fn rotation(&self, grid: &GridTable) -> Result<Degrees, MissionFileError> {
        let Some(value) = &grid.rotation_deg else { return Ok(Degrees(0.0)) };
        let rotation_deg = *value.get_ref();
        if (-180.0..=180.0).contains(&rotation_deg) {
            Ok(Degrees(rotation_deg))
        } else {
            Err(self
                .fault(value, "rotation_deg is not from -180 to 180: give the clockwise angle from north"))
        }
    }

    fn degrees(&self, value: &Spanned<f64>, limit: f64) -> Result<i32, MissionFileError> {
        degrees_e7(*value.get_ref(), limit)
            .ok_or_else(|| self.fault(value, format!("not an angle from -{limit} to {limit} degrees")))
    }

    fn fence(&self, heights: &HeightMap, table: Option<&FenceTable>) -> Result<CellSet, MissionFileError> {
        let grid = heights.grid();
        let outside =
            |at: Cell| format!("cell {at} is outside the {} x {} grid", grid.width(), grid.height());
        let mut fence = CellSet::full(grid);
        let Some(table) = table else { return Ok(fence) };
        if let Some(allowed) = &table.allowed {
            let [low, high] = allowed.get_ref().map(cell);
            for corner in [low, high] {
                if !grid.contains(corner) {
                    return Err(self.fault(allowed, outside(corner)));
                }
            }
            if low.x > high.x || low.y > high.y {
                return Err(
                    self.fault(allowed, "allowed needs the south-west cell first, then the north-east")
                );
            }
            for at in grid.cells() {
                if at.x < low.x || at.x > high.x || at.y < low.y || at.y > high.y {
                    fence.remove(at);
                }
            }
        }
        for excluded in &table.excluded {
            let at = cell(*excluded.get_ref());
            if !grid.contains(at) {
                return Err(self.fault(excluded, outside(at)));
            }
            fence.remove(at);
        }
        Ok(fence)
    }

    fn site(&self, mission: &Mission, entry: &Spanned<DeviceTable>) -> Result<DeviceSite, MissionFileError> {
        let id = entry.get_ref().number().map_err(|what| self.fault(entry, what))?;
        let &DeviceTable { cell: at, lat_deg, lon_deg, data, .. } = entry.get_ref();
        let at = match (at, lat_deg, lon_deg) {
            (Some(at), None, None) => cell(at),
            (None, Some(lat_deg), Some(lon_deg)) => cell_at(mission, lat_deg, lon_deg)
                .map_err(|what| self.fault(entry, format!("device {id}: {what}")))?,
            _ => {
                return Err(self
                    .fault(entry, format!("device {id}: give either cell = [x, y] or lat_deg and lon_deg")));
            }
        };
        Ok(DeviceSite { id, cell: at, data })
    }
}

fn cell([x, y]: [i16; 2]) -> Cell {
    Cell::new(x, y)
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
}

/// `key = 12,5`: digits around a comma, outside of brackets and quotes.
fn has_decimal_comma(line: &str) -> bool {
    let Some((_, value)) = line.split_once('=') else { return false };
    let Some((whole, rest)) = value.split_once(',') else { return false };
    let whole = whole.trim().trim_start_matches(['-', '+']);
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    is_digits(whole) && rest.starts_with(|next: char| next.is_ascii_digit())
}
