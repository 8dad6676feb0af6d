//! The results of a flight: figures as text and as JSON, and files.

use super::ProgramError;
use crate::journal::Slot;
use crate::picture;
use crate::{Figures, Simulation};
use gleaner_pilot::mission_image;
use serde::Serialize;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// The policy of a flight, as far as it is known here.
#[derive(Clone, Debug)]
pub(super) struct PolicyInfo {
    /// The model's name, version and hash, or where it runs.
    pub model: String,
    /// The engine that runs the model.
    pub engine: &'static str,
}

impl PolicyInfo {
    /// The policy of a pilot outside this process.
    pub fn outside(place: &'static str) -> PolicyInfo {
        PolicyInfo { model: format!("of the {place}"), engine: place }
    }
}

/// What `--json` prints: these keys and no others.
#[derive(Serialize)]
struct Report<'r> {
    scenario: &'static str,
    seed: u64,
    preference: f32,
    devices: usize,
    collected: f32,
    energy: f32,
    decisions: u32,
    landed: bool,
    violations: usize,
    switches: usize,
    model: &'r str,
    engine: &'static str,
    wall_s: f64,
}

/// Writes trajectory.svg, flight.tlog, decisions.jsonl and mission.bin into `folder`; where the picture is.
pub(super) fn write_files(
    folder: &Path,
    simulation: &Simulation,
    figures: &Figures,
    model: &str,
) -> Result<PathBuf, ProgramError> {
    let fail = |path: &Path| {
        let path = path.to_owned();
        move |source| ProgramError::Write { path, source }
    };
    fs::create_dir_all(folder).map_err(fail(folder))?;
    let write = |name: &str,
                 fill: &dyn Fn(&mut BufWriter<File>) -> io::Result<()>|
     -> Result<PathBuf, ProgramError> {
        let path = folder.join(name);
        let file = File::create(&path).map_err(fail(&path))?;
        let mut out = BufWriter::new(file);
        fill(&mut out).and_then(|()| out.flush()).map_err(fail(&path))?;
        Ok(path)
    };
    let journal = simulation.journal();
    write("flight.tlog", &|out| journal.write_tlog(out))?;
    let mission = mission_image::encode(&simulation.setup().mission);
    write("mission.bin", &|out| out.write_all(&mission))?;
    write("decisions.jsonl", &|out| journal.write_decisions(simulation.setup(), out))?;
    let picture = picture::trajectory(simulation, figures, model);
    let path = write("trajectory.svg", &|out| out.write_all(picture.as_bytes()))?;
    Ok(path.canonicalize().unwrap_or(path))
}

/// One JSON object.
pub(super) fn json(figures: &Figures, policy: &PolicyInfo, wall_s: f64) -> String {
    let report = Report {
        scenario: figures.scenario.name(),
        seed: figures.seed,
        preference: figures.preference,
        devices: figures.devices,
        collected: figures.collected,
        energy: figures.energy.0,
        decisions: figures.decisions,
        landed: figures.landed,
        violations: figures.violations.len(),
        switches: figures.switches,
        model: &policy.model,
        engine: policy.engine,
        wall_s,
    };
    // Serialising cannot fail: every key is a string.
    serde_json::to_string(&report).unwrap_or_default()
}

/// The figures, each with its name.
pub(super) fn summary(
    simulation: &Simulation,
    figures: &Figures,
    policy: &PolicyInfo,
) -> Vec<(&'static str, String)> {
    let scenario = figures.scenario.name().to_uppercase();
    let (seed, devices, preference) = (figures.seed, figures.devices, figures.preference);
    let budget = simulation.setup().realization.battery().0;
    let flight_s =
        simulation.journal().slots().first().map_or(0.0, |slot| (simulation.now() - slot.at).as_secs_f32());
    vec![
        ("mission", format!("{scenario}, seed {seed}, {devices} devices, w_data {preference}")),
        ("policy", format!("{}, engine {}", policy.model, policy.engine)),
        ("look-ahead", lookahead(simulation.journal().slots())),
        ("collected", format!("{:.1} % of the data", 100.0 * figures.collected)),
        ("energy", format!("{} of {budget} battery units", figures.energy.0)),
        ("decisions", format!("{} in {flight_s:.0} s of flight", figures.decisions)),
    ]
}

/// Whether the look-ahead was on, and in how many decisions it found a plan.
fn lookahead(slots: &[Slot]) -> String {
    let records = || slots.iter().filter_map(|slot| slot.record.lookahead);
    if records().all(|record| record.budget == 0) {
        return "off, the network decides alone".into();
    }
    let planned = records().filter(|record| record.tours > 0).count();
    format!("on, {planned} of {} decisions planned", slots.len())
}

/// Prints the figures, the violations and where the picture is.
pub(super) fn print(lines: &[(&'static str, String)], figures: &Figures, wall_s: f64, picture: &Path) {
    for (name, value) in lines {
        println!("{name:<12} {value}");
    }
    println!("{:<12} {}", "violations", figures.violations.len());
    for violation in &figures.violations {
        println!("  {:8.1} s  {}", violation.at.as_micros() as f64 * 1e-6, violation.rule);
    }
    println!("{:<12} {wall_s:.2} s", "wall time");
    println!("{:<12} {}", "picture", picture.display());
}
