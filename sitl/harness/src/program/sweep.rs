//! `sweep`: many flights in virtual time, each with incidents of its own.

use super::arguments::SweepOrder;
use super::results;
use super::shrink::{self, Failure};
use super::{ProgramError, model};
use crate::{AutopilotKind, Ending, FlightError, FlightResult, FlightScript, MissionSetup, Trial};
use gleaner_pilot::{Budget, LookingAhead};
use gleaner_policy::Engine;
use gleaner_world::World;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// The report; `--json` prints it.
#[derive(Serialize)]
struct Report {
    autopilot: &'static str,
    first: u64,
    flights: u64,
    model: String,
    engine: &'static str,
    /// By fault class.
    rows: BTreeMap<&'static str, Row>,
    /// Flights that broke a rule.
    findings: Vec<Finding>,
}

/// How the flights of a fault class ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Row {
    pub flights: u64,
    /// Landed on the terminal under the pilot's command.
    pub completed: u64,
    /// On the ground elsewhere: brought back by the autopilot or by the human pilot.
    pub returned: u64,
    /// In the air in the hands of the human pilot or another station.
    pub handed_back: u64,
    /// With a broken rule, or without an end.
    pub violations: u64,
}

/// A flight with a broken rule, or without an end.
#[derive(Clone, Debug, Serialize)]
struct Finding {
    flight: u64,
    incidents: Vec<String>,
    faults: Vec<String>,
    /// The command that repeats the flight.
    replay: String,
    /// The command that repeats it with fewer incidents, if fewer suffice.
    smaller: Option<String>,
}

struct Judged {
    number: u64,
    class: &'static str,
    row: Row,
    finding: Option<Finding>,
}

pub(super) fn sweep(order: &SweepOrder) -> Result<bool, ProgramError> {
    let policy = model::info(&model::load(order.model.as_deref(), order.engine)?);
    let mut judged = fly_all(order)?;
    judged.sort_by_key(|judged| judged.number);
    let mut rows = BTreeMap::<&'static str, Row>::new();
    for judged in &judged {
        rows.entry(judged.class).or_default().add(judged.row);
    }
    let report = Report {
        autopilot: order.autopilot.name(),
        first: order.first,
        flights: order.flights,
        model: policy.model,
        engine: policy.engine,
        rows,
        findings: judged.into_iter().filter_map(|judged| judged.finding).collect(),
    };
    if let Some(path) = &order.table {
        std::fs::write(path, table(order.autopilot, order.first, order.flights, &report.rows))
            .map_err(|source| ProgramError::Write { path: path.clone(), source })?;
    }
    if order.json {
        // Serialising cannot fail: every key is a string.
        println!("{}", serde_json::to_string(&report).unwrap_or_default());
    } else {
        report.print(order);
    }
    Ok(report.findings.is_empty())
}

/// A pilot for the largest grid is moved through several frames of a stack: 2 MB, the default, do not suffice.
const STACK_BYTES: usize = 32 << 20;

/// Flies on all cores; a flight is the same on any number of them.
fn fly_all(order: &SweepOrder) -> Result<Vec<Judged>, ProgramError> {
    let world = Arc::new(World::default_world());
    let bar = ProgressBar::new(order.flights);
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} flights, {eta} left {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let done = AtomicU64::new(0);
    let worker = || -> Result<Vec<Judged>, ProgramError> {
        let mut policy = model::load(order.model.as_deref(), order.engine)?;
        let mut judged = Vec::new();
        loop {
            let index = done.fetch_add(1, Ordering::Relaxed);
            if index >= order.flights {
                return Ok(judged);
            }
            let one = judge(order, &world, order.first + index, &mut policy)
                // An error ends the other workers too.
                .inspect_err(|_| done.store(order.flights, Ordering::Relaxed))?;
            if let Some(finding) = &one.finding {
                bar.set_message(format!("(last violation: flight {})", finding.flight));
            }
            judged.push(one);
            bar.inc(1);
        }
    };
    let workers = order.jobs.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from));
    let judged = thread::scope(|scope| {
        let start = |_| thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, worker);
        let workers = (0..workers).map(start).collect::<Result<Vec<_>, _>>().map_err(ProgramError::Thread)?;
        let results = workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        results.collect::<Result<Vec<_>, _>>()
    })?;
    bar.finish_and_clear();
    Ok(judged.into_iter().flatten().collect())
}

fn judge(
    order: &SweepOrder,
    world: &Arc<World>,
    number: u64,
    policy: &mut Engine,
) -> Result<Judged, ProgramError> {
    let mut trial = Trial::draw(number, order.autopilot, order.calm);
    if let Some(kept) = &order.incidents {
        trial = trial.with_incidents(kept);
    }
    let mut fly = |trial: &Trial, keep: bool| -> Result<FlightResult, ProgramError> {
        let setup = MissionSetup::new(Arc::clone(world), trial.plan).map_err(FlightError::from)?;
        fly(order, number, (setup, trial.script.clone()), policy, keep)
    };
    let mut result = fly(&trial, order.keep)?;
    let faults = faults(&result);
    if !faults.is_empty() && !order.keep {
        // The same flight, for its files.
        result = fly(&trial, true)?;
    }
    let row = Row::of(&result, !faults.is_empty());
    let class = trial.class();
    if order.keep || !faults.is_empty() {
        let folder = order.out.join(format!("flight-{number}"));
        results::write_files(&folder, &result.simulation, &result.figures(), "gleaner")?;
    }
    if faults.is_empty() {
        return Ok(Judged { number, class, row, finding: None });
    }
    let kept = match order.incidents {
        Some(_) => None,
        None => shrink::smallest(&trial, |trial| Ok::<_, ProgramError>(failure(&fly(trial, false)?)))?,
    };
    let finding = Finding {
        flight: number,
        incidents: trial
            .script
            .incidents
            .iter()
            .enumerate()
            .map(|(i, incident)| {
                format!(
                    "[{i}] {:.0} s after the first decision: {}",
                    incident.after.as_secs_f32(),
                    incident.kind
                )
            })
            .collect(),
        faults,
        replay: order.replay(number, order.incidents.as_deref()),
        smaller: kept.map(|kept| order.replay(number, Some(&kept))),
    };
    Ok(Judged { number, class, row, finding: Some(finding) })
}

/// Each flight of this many looks ahead with the effort of a companion computer, whatever is set.
const FULL_EFFORT: u64 = 100;

/// Flies with the effort of the order, and with the record of the flight if it is to be kept.
fn fly(
    order: &SweepOrder,
    number: u64,
    (setup, script): (MissionSetup, FlightScript),
    policy: &mut Engine,
    keep: bool,
) -> Result<FlightResult, ProgramError> {
    let budget =
        if number.is_multiple_of(FULL_EFFORT) { Budget::LINUX } else { Budget { tours: order.tours } };
    let ahead = |policy| LookingAhead::new(policy, budget);
    Ok(match (order.lookahead, keep) {
        (true, true) => crate::fly(setup, script, ahead(policy), Ok(())),
        (true, false) => crate::fly_without_record(setup, script, ahead(policy), Ok(())),
        (false, true) => crate::fly(setup, script, policy, Ok(())),
        (false, false) => crate::fly_without_record(setup, script, policy, Ok(())),
    }?)
}

/// The kind of failure, to compare flights with.
fn failure(result: &FlightResult) -> Option<Failure> {
    let rule = result.simulation.referee().violations().first();
    match (rule, result.ending) {
        (Some(violation), _) => Some(Failure::Rule(std::mem::discriminant(&violation.rule))),
        (None, Ending::NeverEngaged | Ending::TimeUp) => Some(Failure::NoEnd),
        (None, _) => None,
    }
}

/// Broken rules with their times, and a flight that did not end.
fn faults(result: &FlightResult) -> Vec<String> {
    let violations = result.simulation.referee().violations().iter();
    let mut faults: Vec<String> = violations
        .map(|violation| format!("{:.1} s: {}", violation.at.as_micros() as f64 * 1e-6, violation.rule))
        .collect();
    match result.ending {
        Ending::NeverEngaged => faults.push(format!("never engaged, waiting for {}", result.waiting_for)),
        Ending::TimeUp => faults.push("still in the air at the time limit".into()),
        Ending::OnTheGround | Ending::TakenOver | Ending::PilotGone => {}
    }
    faults
}

/// The table of fault classes as a snapshot: it changes only when a flight ends differently.
pub(crate) fn table(
    autopilot: AutopilotKind,
    first: u64,
    flights: u64,
    rows: &BTreeMap<&'static str, Row>,
) -> String {
    let mut text = format!("autopilot {autopilot}, flights {first} to {}\n\n", first + flights - 1);
    text.push_str("fault class         flights  completed  returned  handed back  violations\n");
    let mut sum = Row::default();
    let mut line = |class: &str, row: Row| {
        let Row { flights, completed, returned, handed_back, violations } = row;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{class:<18} {flights:>8}  {completed:>9}  {returned:>8}  {handed_back:>11}  {violations:>10}"
        );
    };
    for (class, row) in rows {
        line(class, *row);
        sum.add(*row);
    }
    line("all", sum);
    text
}

impl Row {
    fn of(result: &FlightResult, violated: bool) -> Row {
        let landed = result.simulation.referee().landed();
        let ended = |ending: Ending| u64::from(!landed && result.ending == ending);
        Row {
            flights: 1,
            completed: u64::from(landed),
            returned: ended(Ending::OnTheGround),
            handed_back: ended(Ending::TakenOver),
            violations: u64::from(violated),
        }
    }

    fn add(&mut self, other: Row) {
        self.flights += other.flights;
        self.completed += other.completed;
        self.returned += other.returned;
        self.handed_back += other.handed_back;
        self.violations += other.violations;
    }
}

impl Report {
    fn print(&self, order: &SweepOrder) {
        println!("policy {}, engine {}", self.model, self.engine);
        print!("{}", table(order.autopilot, self.first, self.flights, &self.rows));
        for Finding { flight, incidents, faults, replay, smaller } in &self.findings {
            println!("\nflight {flight}");
            incidents.iter().chain(faults).for_each(|line| println!("  {line}"));
            println!("  replay: {replay}");
            if let Some(smaller) = smaller {
                println!("  fewer incidents: {smaller}");
            }
        }
        if !self.findings.is_empty() {
            println!("\nlogs and pictures of these flights are in {}", order.out.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AircraftFault, Incident, IncidentKind, MissionPlan};
    use gleaner_policy::{Attention, Inference, Policy, Tokens};
    use gleaner_units::{BatteryUnits, Duration};
    use gleaner_world::ScenarioKind;

    struct Hover;

    impl Policy for Hover {
        type Error = ();
        fn infer(&mut self, _tokens: &Tokens) -> Result<Inference, ()> {
            Ok(Inference { logits: [1.0, 0.0, 0.0, 0.0, 0.0], attention: Attention::NONE })
        }
    }

    /// Hovers in RD; after ten seconds the pack loses this many units.
    fn hovering(lost: f32) -> FlightResult {
        let plan = MissionPlan::new(ScenarioKind::ReachDestination, 4);
        let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
        let kind = IncidentKind::Aircraft(AircraftFault::ChargeLost(BatteryUnits(lost)));
        let incidents = vec![Incident { after: Duration::from_secs(10), kind }];
        crate::fly(setup, FlightScript { incidents, ..FlightScript::plain(1.0) }, Hover, Ok(())).unwrap()
    }

    #[test]
    fn a_good_flight_is_completed_without_violations() {
        let result = hovering(0.0);
        assert_eq!(faults(&result), [""; 0]);
        let row = Row::of(&result, false);
        assert_eq!((row.completed, row.returned, row.handed_back, row.violations), (1, 0, 0, 0));
    }

    #[test]
    fn the_table_lists_classes_and_their_sum() {
        let row = Row { flights: 3, completed: 2, returned: 1, ..Row::default() };
        let rows = BTreeMap::from([("delay", row), ("none", row)]);
        let text = table(AutopilotKind::Px4, 7, 6, &rows);
        assert!(text.starts_with("autopilot px4, flights 7 to 12\n"), "{text}");
        assert!(
            text.ends_with("all                       6          4         2            0           0\n"),
            "{text}"
        );
    }
}
