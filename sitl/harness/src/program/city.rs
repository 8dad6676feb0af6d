//! `city`: make a random city, show one, import building outlines.

use super::ProgramError;
use super::arguments::{CityOrder, ImportOrder};
use super::load::read_city_file;
use crate::city::devices::{self, ImportedDevice};
use crate::city::footprints::{self, HeightRules};
use crate::city::placement::{Placement, derived_rotation_deg};
use crate::city::plan::{Plan, cell_under};
use crate::city::raster::rasterise;
use gleaner_pilot::{DeviceSite, MAX_DEVICES, Mission, mission_file};
use gleaner_units::{BatteryUnits, Cell, CellSet, Degrees, GridPose, HeightMap, Metres};
use gleaner_world::City;
use std::path::{Path, PathBuf};

pub(super) fn city(order: &CityOrder) -> Result<bool, ProgramError> {
    match order {
        CityOrder::Make { seed, out } => {
            let city = City::generate(*seed);
            write(out, &city.to_csv())?;
            println!("{}: {}", out.display(), summary(city.heights()));
        }
        CityOrder::Show { path } => {
            let city = read_city_file(path)?;
            println!("{}", summary(city.heights()));
            println!("fingerprint  {:016x}", city.fingerprint());
            print!("{}", map(city.heights()));
        }
        CityOrder::Import(order) => import(order)?,
    }
    Ok(true)
}

fn write(path: &Path, text: &str) -> Result<(), ProgramError> {
    std::fs::write(path, text).map_err(|source| ProgramError::Write { path: path.into(), source })
}

/// Size, built share, tallest building.
fn summary(heights: &HeightMap) -> String {
    let grid = heights.grid();
    let built = heights.as_slice().iter().filter(|&&height_m| height_m > 0).count();
    format!(
        "{} x {} cells of {} m, {:.0} % built, tallest building {} m",
        grid.width(),
        grid.height(),
        grid.cell().0,
        100.0 * built as f64 / grid.len().max(1) as f64,
        heights.tallest().0
    )
}

/// One character a cell, north at the top: `.` open ground, digits tens of metres.
fn map(heights: &HeightMap) -> String {
    let grid = heights.grid();
    let mut text = String::new();
    for y in (0..grid.height()).rev() {
        for x in 0..grid.width() {
            let height_m = heights.height_m(Cell::new(x as i16, y as i16)).unwrap_or(0);
            text.push(match height_m {
                0 => '.',
                1..=99 => char::from(b'0' + height_m / 10),
                _ => '#',
            });
        }
        text.push('\n');
    }
    text
}

fn import(order: &ImportOrder) -> Result<(), ProgramError> {
    let rules = HeightRules { level_m: order.level_m.into(), default_m: order.default_m.into() };
    let (footprints, sources) = footprints::read(&order.footprints, rules)?;
    let rotation_deg = order.rotation_deg.unwrap_or_else(|| derived_rotation_deg(&footprints));
    let placement = Placement::cover(&footprints, order.bounds, Metres(order.cell_m), rotation_deg)?;
    let raster = rasterise(&footprints, placement);
    write(&order.out, &csv(&raster.heights))?;
    let corner = placement.corner;
    println!("{}: {}", order.out.display(), summary(&raster.heights));
    println!(
        "corner       {:.7}, {:.7}, rotation {rotation_deg:.1} degrees clockwise from north",
        f64::from(corner.lat_deg_e7) * 1e-7,
        f64::from(corner.lon_deg_e7) * 1e-7,
    );
    println!(
        "heights      {} given, {} from levels of {} m, {} by default {} m",
        sources.measured, sources.levels, order.level_m, sources.default, order.default_m
    );
    if raster.outside > 0 {
        println!("outside      {} buildings outside the grid", raster.outside);
    }
    if raster.capped > 0 {
        println!("capped       {} buildings above 255 m are written as 255 m", raster.capped);
    }
    if let Some(path) = &order.mission_out {
        write_mission(order, path, placement, raster.heights)?;
    }
    Ok(())
}

fn csv(heights: &HeightMap) -> String {
    let grid = heights.grid();
    let mut text = format!(
        "# building heights in metres, {} columns west to east, {} rows north to south (first row = northernmost), cell {} m\n",
        grid.width(),
        grid.height(),
        grid.cell().0
    );
    for row in heights.as_slice().chunks(usize::from(grid.width())).rev() {
        let values: Vec<String> = row.iter().map(u8::to_string).collect();
        text.push_str(&values.join(","));
        text.push('\n');
    }
    text
}

fn write_mission(
    order: &ImportOrder,
    path: &Path,
    placement: Placement,
    heights: HeightMap,
) -> Result<(), ProgramError> {
    let plan = order.plan.as_deref().map(Plan::read).transpose()?;
    let devices = match &order.devices {
        Some(file) => sites(file, &devices::read(file)?, placement)?,
        None => Vec::new(),
    };
    let wrong = |cause: String| ProgramError::Input { path: path.into(), cause };
    let terminal = order.terminal.or_else(|| plan.as_ref().and_then(Plan::rally_point));
    let terminal = terminal.ok_or_else(|| {
        wrong("no terminal: give --terminal LAT,LON, or a --plan with a rally point".into())
    })?;
    let terminal = cell_under(placement, terminal)
        .ok_or_else(|| wrong(format!("the terminal {}, {} is outside the grid", terminal[0], terminal[1])))?;
    let fence = plan.as_ref().map_or_else(|| CellSet::full(placement.grid), |plan| plan.fence(placement));
    let mission = Mission {
        heights,
        fence,
        pose: GridPose { corner: placement.corner, rotation: Degrees(placement.rotation_deg as f32) },
        terminal,
        budget: BatteryUnits(order.battery),
        devices: devices.into_iter().collect(),
    };
    mission.check().map_err(|error| wrong(error.to_string()))?;
    let city = order.out.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    write(path, &mission_file::write(&mission, &city))?;
    println!("mission      {}, {} devices, terminal {terminal}", path.display(), mission.devices.len());
    for line in warnings(&mission) {
        println!("warning      {line}");
    }
    Ok(())
}

/// What an operator should see before such a mission flies.
fn warnings(mission: &Mission) -> Vec<String> {
    let roof_m = |cell| mission.heights.height_m(cell).unwrap_or(0);
    let mut lines = Vec::new();
    if roof_m(mission.terminal) > 0 {
        let height_m = roof_m(mission.terminal);
        lines.push(format!("the terminal is on a building of {height_m} m: the aircraft lands on its roof"));
    }
    for DeviceSite { id, cell, .. } in &mission.devices {
        if roof_m(*cell) > 0 {
            lines.push(format!("device {id} at {cell} is on a building of {} m", roof_m(*cell)));
        }
        if !mission.fence.contains(*cell) {
            lines.push(format!("device {id} at {cell} is outside the fence"));
        }
    }
    lines
}

fn sites(
    file: &Path,
    devices: &[ImportedDevice],
    placement: Placement,
) -> Result<Vec<DeviceSite>, ProgramError> {
    let wrong = |cause: String| ProgramError::Input { path: PathBuf::from(file), cause };
    if devices.len() > MAX_DEVICES {
        return Err(wrong(format!("{} devices, a mission holds {MAX_DEVICES}", devices.len())));
    }
    let site = |device: &ImportedDevice| {
        let &ImportedDevice { lat, lon, id, data } = device;
        let cell = cell_under(placement, [lat, lon])
            .ok_or_else(|| wrong(format!("device {id} at {lat}, {lon} is outside the grid")))?;
        Ok(DeviceSite { id, cell, data })
    };
    devices.iter().map(site).collect()
}
