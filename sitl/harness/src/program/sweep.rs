//! `sweep`: many flights in virtual time, each with incidents of its own.

use super::arguments::SweepOrder;
use super::results::{self, Brain};
use super::{ProgramError, model};
use crate::{Ending, FlightError, Flown, Incident, Staged, Trial, Wishes};
use gleaner_policy::Engine;
use gleaner_world::World;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    first: u64,
    flights: u64,
    model: String,
    engine: &'static str,
    /// By what happened.
    rows: BTreeMap<String, Row>,
    /// What should not have been.
    findings: Vec<Finding>,
}

/// How flights ended.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Row {
    flights: u64,
    /// On the terminal, by the pilot on board.
    landed: u64,
    /// The human pilot has the aircraft.
    taken_over: u64,
    /// On the ground elsewhere: handed back to the autopilot, or brought home by the human pilot.
    elsewhere: u64,
    /// Never engaged, or still in the air when the simulation gave up.
    stuck: u64,
    /// With a rule broken, or stuck.
    findings: u64,
}

/// A flight with a rule broken, or without an end.
#[derive(Clone, Debug, Serialize)]
struct Finding {
    flight: u64,
    incidents: Vec<String>,
    what: Vec<String>,
}

/// One flight, judged.
struct Judged {
    number: u64,
    incidents: String,
    row: Row,
    finding: Option<Finding>,
}

pub(super) fn sweep(order: &SweepOrder) -> Result<bool, ProgramError> {
    let brain = model::brain(&model::load(order.model.as_deref(), order.engine)?);
    let mut flown = fly_all(order, &brain)?;
    flown.sort_by_key(|judged| judged.number);
    let mut rows = BTreeMap::<String, Row>::new();
    for judged in &flown {
        rows.entry(judged.incidents.clone()).or_default().add(judged.row);
    }
    let report = Report {
        first: order.first,
        flights: order.flights,
        model: brain.model,
        engine: brain.engine,
        rows,
        findings: flown.into_iter().filter_map(|judged| judged.finding).collect(),
    };
    if order.json {
        // Serialising cannot fail: every key is a string.
        println!("{}", serde_json::to_string(&report).unwrap_or_default());
    } else {
        report.print(order);
    }
    Ok(report.findings.is_empty())
}

/// Flies on all cores; a flight is the same on any number of them.
fn fly_all(order: &SweepOrder, brain: &Brain) -> Result<Vec<Judged>, ProgramError> {
    let world = Arc::new(World::default_world());
    let bar = ProgressBar::new(order.flights);
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} flights, {eta} left {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let done = AtomicU64::new(0);
    let worker = || -> Result<Vec<Judged>, ProgramError> {
        let mut policy = model::load(order.model.as_deref(), order.engine)?;
        let mut flown = Vec::new();
        loop {
            let index = done.fetch_add(1, Ordering::Relaxed);
            if index >= order.flights {
                return Ok(flown);
            }
            let judged = fly(order, &world, order.first + index, &mut policy, brain)
                // The others need not go on for nothing.
                .inspect_err(|_| done.store(order.flights, Ordering::Relaxed))?;
            if let Some(finding) = &judged.finding {
                bar.set_message(format!("(last finding: flight {})", finding.flight));
            }
            flown.push(judged);
            bar.inc(1);
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let flown = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        let results = workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        results.collect::<Result<Vec<_>, _>>()
    })?;
    bar.finish_and_clear();
    Ok(flown.into_iter().flatten().collect())
}

fn fly(
    order: &SweepOrder,
    world: &Arc<World>,
    number: u64,
    policy: &mut Engine,
    brain: &Brain,
) -> Result<Judged, ProgramError> {
    let Trial { plan, wishes } = Trial::draw(number, order.calm);
    let staged = Staged::new(Arc::clone(world), plan).map_err(FlightError::from)?;
    let flown = crate::fly(staged, wishes, policy, Ok(()))?;
    let what = faults(&flown);
    let finding =
        (!what.is_empty()).then(|| Finding { flight: number, incidents: told(&flown.wishes), what });
    if finding.is_some() || order.keep {
        let folder = order.out.join(format!("flight-{number}"));
        results::write_files(&folder, &flown.simulation, &flown.figures(), brain)?;
    }
    Ok(Judged { number, incidents: kinds(&flown.wishes), row: Row::of(&flown, finding.is_some()), finding })
}

/// What of a flight should not have been, each with its time.
fn faults(flown: &Flown) -> Vec<String> {
    let violations = flown.simulation.referee().violations().iter();
    let mut faults: Vec<String> = violations
        .map(|violation| format!("{:.1} s: {}", violation.at.as_micros() as f64 * 1e-6, violation.breach))
        .collect();
    match flown.ending {
        Ending::NeverEngaged => faults.push(format!("never engaged, waiting for {}", flown.waiting_for)),
        Ending::TimeUp => faults.push("still in the air when the time was up".into()),
        Ending::OnTheGround | Ending::TakenOver | Ending::PilotGone => {}
    }
    faults
}

/// The kinds of incidents: the row of a flight.
fn kinds(wishes: &Wishes) -> String {
    let mut names: Vec<&str> = wishes.incidents.iter().map(|incident| incident.kind.name()).collect();
    names.dedup();
    match names[..] {
        [] => "none".into(),
        [one] => one.into(),
        _ => "several".into(),
    }
}

fn told(wishes: &Wishes) -> Vec<String> {
    let told = |incident: &Incident| {
        format!("{:.0} s after the first decision {}", incident.after.as_secs_f32(), incident.kind)
    };
    wishes.incidents.iter().map(told).collect()
}

impl Row {
    fn of(flown: &Flown, is_finding: bool) -> Row {
        let landed = flown.simulation.referee().landed();
        let ended = |endings: &[Ending]| u64::from(!landed && endings.contains(&flown.ending));
        Row {
            flights: 1,
            landed: u64::from(landed),
            taken_over: ended(&[Ending::TakenOver]),
            elsewhere: ended(&[Ending::OnTheGround]),
            stuck: ended(&[Ending::NeverEngaged, Ending::TimeUp, Ending::PilotGone]),
            findings: u64::from(is_finding),
        }
    }

    fn add(&mut self, other: Row) {
        self.flights += other.flights;
        self.landed += other.landed;
        self.taken_over += other.taken_over;
        self.elsewhere += other.elsewhere;
        self.stuck += other.stuck;
        self.findings += other.findings;
    }
}

impl Report {
    fn print(&self, order: &SweepOrder) {
        println!("policy {}, engine {}", self.model, self.engine);
        println!("incidents          flights   landed  taken over  elsewhere    stuck  findings");
        for (incidents, row) in &self.rows {
            let Row { flights, landed, taken_over, elsewhere, stuck, findings } = row;
            println!(
                "{incidents:<18} {flights:>7}  {landed:>7}  {taken_over:>10}  {elsewhere:>9}  {stuck:>7}  {findings:>8}"
            );
        }
        for Finding { flight, incidents, what } in &self.findings {
            println!(
                "\nflight {flight} (again: gleaner-sitl sweep --first {flight} --flights 1{})",
                order.same()
            );
            incidents.iter().chain(what).for_each(|line| println!("  {line}"));
        }
        if !self.findings.is_empty() {
            println!("\nlogs and pictures of these flights are in {}", order.out.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{IncidentKind, MissionPlan};
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

    /// Hovers in RD; after ten seconds the pack loses so many units.
    fn flown(lost: f32) -> Flown {
        let plan = MissionPlan::new(ScenarioKind::ReachDestination, 4);
        let staged = Staged::new(Arc::new(World::default_world()), plan).unwrap();
        let kind = IncidentKind::LosesBattery(BatteryUnits(lost));
        let incidents = vec![Incident { after: Duration::from_secs(10), kind }];
        crate::fly(staged, Wishes { incidents, ..Wishes::plain(1.0) }, Hover, Ok(())).unwrap()
    }

    #[test]
    fn a_flight_that_nobody_could_bring_home_is_a_finding() {
        let flown = flown(90.0);
        let what = faults(&flown);
        assert!(what.iter().any(|line| line.contains("the battery is empty in flight")), "{what:?}");
        let row = Row::of(&flown, true);
        assert_eq!((row.flights, row.findings), (1, 1));
        assert_eq!(kinds(&flown.wishes), "charge lost");
        assert_eq!(told(&flown.wishes), ["10 s after the first decision the pack loses 90 battery units"]);
    }

    #[test]
    fn a_good_flight_is_none() {
        let flown = flown(0.0);
        assert_eq!(faults(&flown), [""; 0]);
        let row = Row::of(&flown, false);
        assert_eq!((row.landed, row.taken_over, row.elsewhere, row.stuck, row.findings), (1, 0, 0, 0, 0));
    }
}
