//! `gleaner mission`: a mission before the flight, as text and as a web page.

use crate::args::{MissionCommand, MissionShow};
use crate::error::StartError;
use crate::load;
use gleaner_dashboard::{Flight, render, scene};
use gleaner_units::BatteryUnits;
use std::fs;
use std::process::ExitCode;

/// Does what is ordered.
///
/// # Errors
/// The mission cannot be read, or the page cannot be written.
pub fn mission(order: &MissionCommand) -> Result<ExitCode, StartError> {
    match order {
        MissionCommand::Show(order) => show(order),
    }
}

fn show(order: &MissionShow) -> Result<ExitCode, StartError> {
    let mission = load::mission(&order.mission)?.mission;
    let name = order.mission.file_stem().unwrap_or_default().to_string_lossy();
    let scene = scene(&mission, order.altitude, name.into_owned());
    let (grid, fenced) = (mission.grid(), mission.fence.len());
    let cells = usize::from(grid.width()) * usize::from(grid.height());
    let tallest_m = scene.heights_m.iter().max().copied().unwrap_or(0);
    println!(
        "city        {} x {} cells of {} m, buildings up to {tallest_m} m",
        grid.width(),
        grid.height(),
        grid.cell().0
    );
    println!("rotation    {} degrees", scene.grid.rotation_deg);
    println!("fence       {fenced} of {cells} cells");
    println!("terminal    {}", mission.terminal);
    println!("battery     {} units", mission.budget.0);
    // The mission's check has found the guard possible.
    let guard = mission.guard(BatteryUnits(0.0)).ok();
    for (site, sight) in mission.devices.iter().zip(&scene.sight) {
        let seen = sight.bytes().filter(|&cell| cell == b'1').count();
        let home = guard.as_ref().and_then(|guard| guard.distance(site.cell));
        let home =
            home.map_or("outside the fence".into(), |moves| format!("{moves} moves from the terminal"));
        println!(
            "device {:<4} {}, {} data units, in sight from {:.0} % of the cells at {} m, {home}",
            site.id,
            site.cell,
            site.data,
            100.0 * seen as f32 / cells as f32,
            order.altitude
        );
    }
    if let Some(path) = &order.html {
        let page = render(&Flight::new(scene));
        fs::write(path, page).map_err(|source| StartError::Write { path: path.clone(), source })?;
        println!("page        {}", path.display());
    }
    Ok(ExitCode::SUCCESS)
}
