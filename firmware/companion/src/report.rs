//! `gleaner report`: a finished flight, from its decision log and its telemetry log, as a web page in one file.

use crate::args::Report;
use crate::config;
use crate::error::StartError;
use crate::load::{self, LoadError};
use crate::logs::MISSION;
use gleaner_dashboard::{Recording, render, scene, telemetry_frames};
use gleaner_link::{Address, Parameters};
use gleaner_pilot::{LoggedDecision, Settings};
use std::fs;
use std::path::Path;
use std::process::ExitCode;

/// `MAV_COMP_ID_AUTOPILOT1`.
const AUTOPILOT: u8 = 1;

/// Writes the page of the last run in the log.
///
/// # Errors
/// The mission, the model or the log cannot be read, the log holds no decision, or the page cannot be written.
pub fn report(order: &Report) -> Result<ExitCode, StartError> {
    let engine = load::model(order.model.as_deref(), None)?;
    let (settings, parameters) = match &order.config {
        Some(path) => config::identity(path)?,
        None => (Settings::default(), Parameters::default()),
    };
    let log = if order.flight.is_dir() { order.flight.join("decisions.jsonl") } else { order.flight.clone() };
    let path = order.mission.clone().unwrap_or_else(|| log.with_file_name(MISSION));
    let mission = match &order.mission {
        Some(path) => load::mission(path)?.mission,
        None => load::flown_mission(&path).ok_or_else(|| StartError::NoMission { path: path.clone() })?,
    };
    let decisions = last_run(&log)?;
    let Some(first) = decisions.first() else { return Err(StartError::NoDecisions { path: log }) };
    let telemetry = fs::read(log.with_file_name("flight.tlog")).unwrap_or_default();
    let begin_s = first.run_s as f64;
    let frames: Vec<(f64, &[u8])> = telemetry_frames(&telemetry)
        .map(|(unix_us, frame)| (unix_us as f64 * 1e-6 - begin_s, frame))
        .collect();
    // The telemetry of another run has other times. The start of the run is logged in whole seconds.
    let end_s = decisions.last().map_or(0.0, |last| last.time_us as f64 * 1e-6);
    let belongs = frames.iter().any(|(t_s, _)| (0.0..=end_s + 1.0).contains(t_s));
    let frames = if belongs { frames } else { Vec::new() };
    let system = settings.system_id.or_else(|| autopilot_system(&frames)).unwrap_or(1);
    let title = format!(
        "flight of {} decisions, mission {}",
        decisions.len(),
        path.file_stem().unwrap_or_default().to_string_lossy()
    );
    let mut recording = Recording::new(
        scene(&mission, parameters.altitude().0 as u16, title),
        &mission,
        Address::new(system, settings.component_id),
        parameters.reserve(),
        engine,
    );
    recording.replay(&decisions, frames.iter().copied());
    let page = render(&recording.finish());
    fs::write(&order.html, page).map_err(|source| StartError::Write { path: order.html.clone(), source })?;
    println!("decisions   {}", decisions.len());
    println!("telemetry   {} messages", frames.len());
    println!("page        {}", order.html.display());
    Ok(ExitCode::SUCCESS)
}

/// The decisions of the last run in the file. Lines that a full disk left unfinished are skipped.
fn last_run(log: &Path) -> Result<Vec<LoggedDecision>, StartError> {
    let unreadable = |source| LoadError::Read { what: "decision log", path: log.to_owned(), source };
    let bytes = fs::read(log).map_err(unreadable)?;
    let lines = bytes.split(|&byte| byte == b'\n');
    let all: Vec<LoggedDecision> = lines.filter_map(|line| serde_json::from_slice(line).ok()).collect();
    let run_s = all.last().map_or(0, |last| last.run_s);
    Ok(all.into_iter().filter(|decision| decision.run_s == run_s).collect())
}

/// The system id of the first autopilot in the telemetry. The sender stands in bytes 5 and 6 of a MAVLink 2 frame.
fn autopilot_system(frames: &[(f64, &[u8])]) -> Option<u8> {
    frames.iter().find_map(|(_, frame)| match frame {
        [0xFD, _, _, _, _, system, AUTOPILOT, ..] => Some(*system),
        _ => None,
    })
}
