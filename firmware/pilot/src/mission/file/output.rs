//! A mission as the text of a mission file.

use super::place::roof_m;
use crate::Mission;
use gleaner_units::Cell;
use serde::Serialize;
use std::string::String;
use std::vec::Vec;

#[derive(Serialize)]
struct FileOut<'m> {
    terminal: [i16; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    terminal_height_m: Option<f32>,
    battery_units: f32,
    grid: GridOut<'m>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fence: Option<FenceOut>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    device: Vec<DeviceOut>,
}

#[derive(Serialize)]
struct GridOut<'m> {
    corner_lat_deg: f64,
    corner_lon_deg: f64,
    #[serde(skip_serializing_if = "is_zero")]
    rotation_deg: f32,
    cell_m: f32,
    heights: &'m str,
    #[serde(skip_serializing_if = "Option::is_none")]
    highest_m: Option<u16>,
}

// The signature that serde requires.
fn is_zero(number: &f32) -> bool {
    *number == 0.0
}

#[derive(Serialize)]
struct FenceOut {
    excluded: Vec<[i16; 2]>,
}

#[derive(Serialize)]
struct DeviceOut {
    id: u32,
    cell: [i16; 2],
    data: f32,
}

/// Writes a mission file that [`read`](super::read) turns back into the same mission, given the city under `heights`.
#[must_use]
pub fn write(mission: &Mission, heights: &str) -> String {
    let pair = |cell: Cell| [cell.x, cell.y];
    let roof = roof_m(mission);
    let excluded: Vec<[i16; 2]> =
        mission.grid().cells().filter(|&cell| !mission.fence.contains(cell)).map(pair).collect();
    let file = FileOut {
        terminal: pair(mission.terminal),
        terminal_height_m: (roof > 0.0).then_some(roof),
        battery_units: mission.budget.0,
        grid: GridOut {
            corner_lat_deg: f64::from(mission.pose.corner.lat_deg_e7) / 1e7,
            corner_lon_deg: f64::from(mission.pose.corner.lon_deg_e7) / 1e7,
            rotation_deg: mission.pose.rotation.0,
            cell_m: mission.grid().cell().0,
            heights,
            highest_m: mission.heights.stated_highest_m(),
        },
        fence: (!excluded.is_empty()).then_some(FenceOut { excluded }),
        device: mission
            .devices
            .iter()
            .map(|site| DeviceOut { id: site.id, cell: pair(site.cell), data: site.data })
            .collect(),
    };
    // Only maps with unrepresentable keys fail to serialise; there are none here.
    toml::to_string(&file).unwrap_or_default()
}
