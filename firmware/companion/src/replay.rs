//! `gleaner replay`: makes the decisions of a log again and lists those that change.
//!
//! A log holds the input and the answer of the model and the actions that the guard allowed, and with look-ahead what that
//! was given. The look-ahead keeps a plan, so its decisions are made again from the first one of a mission on. It may come from
//! `gleaner run` or from a simulator.

use crate::args::Replay;
use crate::error::StartError;
use crate::load::{self, LoadError};
use gleaner_pilot::{LoggedDecision, LookAheadReplay, Replayed};
use gleaner_policy::{Engine, Policy};
use gleaner_units::Action;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::process::ExitCode;

/// Lines printed of each kind; the rest is only counted.
const SHOWN: u64 = 10;

/// Prints the decisions that change and the largest difference of a logit.
///
/// # Errors
/// The model or the log cannot be read, or the log holds no decision.
pub fn replay(order: &Replay) -> Result<ExitCode, StartError> {
    let unreadable = |source| LoadError::Read { what: "decision log", path: order.log.clone(), source };
    let log = BufReader::new(File::open(&order.log).map_err(unreadable)?);
    let engine = load::model(order.model.as_deref(), order.engine)?;
    println!(
        "{}, engine {} ({})",
        engine.name(),
        engine.kind().name(),
        load::model_name(order.model.as_deref()).display()
    );
    let (lookahead, findings) = (LookAheadReplay::default(), Findings::default());
    let mut comparison = Comparison { engine, lookahead, findings };
    for (index, line) in log.split(b'\n').enumerate() {
        let line = line.map_err(unreadable)?;
        match serde_json::from_slice(&line) {
            Ok(logged) => comparison.decide(&logged),
            // A full disk leaves half a line.
            Err(error) => comparison
                .findings
                .note(Kind::Skipped, || format!("line {} is not a decision: {error}", index + 1)),
        }
    }
    let Findings { counts, furthest } = comparison.findings;
    let [equal, different, guards, skipped, incomplete] = counts;
    if equal + different + guards + incomplete == 0 {
        return Err(StartError::NoDecisions { path: order.log.clone() });
    }
    println!("decisions equal             {equal}");
    println!("decisions different         {different}");
    println!("by the guard, not replayed  {guards}");
    if incomplete > 0 {
        println!("plan begins before the log  {incomplete}");
    }
    println!("lines skipped               {skipped}");
    println!("largest logit difference    {furthest:.1e}");
    // A log without a decision of the model proves nothing.
    Ok(if different == 0 && equal > 0 { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The result for one line.
#[derive(Clone, Copy)]
enum Kind {
    Equal,
    Different,
    Guards,
    Skipped,
    /// The look-ahead's plan is older than the log.
    Incomplete,
}

#[derive(Default)]
struct Findings {
    /// By [`Kind`].
    counts: [u64; 5],
    furthest: f32,
}

impl Findings {
    fn note(&mut self, kind: Kind, text: impl FnOnce() -> String) {
        self.counts[kind as usize] += 1;
        if matches!(kind, Kind::Different | Kind::Skipped) {
            match self.counts[kind as usize] {
                ..=SHOWN => println!("{}", text()),
                count if count == SHOWN + 1 => println!("more of these follow; they are counted below"),
                _ => {}
            }
        }
    }
}

struct Comparison {
    engine: Engine,
    lookahead: LookAheadReplay,
    findings: Findings,
}

impl Comparison {
    fn decide(&mut self, logged: &LoggedDecision) {
        let Some(logits) = logged.logits else {
            return self.findings.note(Kind::Guards, String::new);
        };
        let differs = |how: String| format!("run {}, decision {}: {how}", logged.run_s, logged.sequence);
        let was = logged.action.name();
        let answer = match self.engine.infer(&logged.tokens) {
            Ok(answer) => answer,
            Err(error) => {
                let how = || differs(format!("logged {was}, now no answer: {error}"));
                return self.findings.note(Kind::Different, how);
            }
        };
        let difference = |(then, now): (&f32, &f32)| (then - now).abs();
        let furthest = logits.iter().zip(&answer.logits).map(difference).fold(0.0, f32::max);
        self.findings.furthest = self.findings.furthest.max(furthest);
        let decided = match &logged.lookahead {
            None => logged.mask.argmax(&answer.logits),
            Some(entry) => match self.lookahead.decide(logged, entry, &answer.logits) {
                Replayed::Choice(action, record) if record == entry.record => Some(action),
                Replayed::Choice(action, _) => {
                    let now = action.name();
                    let how =
                        || differs(format!("logged {was}, now {now}, and the look-ahead's figures differ"));
                    return self.findings.note(Kind::Different, how);
                }
                Replayed::Incomplete => return self.findings.note(Kind::Incomplete, String::new),
            },
        };
        match decided {
            Some(action) if action == logged.action => self.findings.note(Kind::Equal, String::new),
            decided => self.findings.note(Kind::Different, || {
                let now = decided.map_or("nothing", Action::name);
                differs(format!("logged {was}, now {now}; logits differ by up to {furthest:.1e}"))
            }),
        }
    }
}
