//! `gleaner replay`: decides a decision log again and compares.
//!
//! What flew is in the log whole: what the model saw, what it answered, what the guard allowed. So after a flight, or
//! before another model flies, everybody can see what would have been decided.

use crate::args::Replay;
use crate::error::StartError;
use crate::load;
use gleaner_policy::{Engine, Policy, Tokens};
use gleaner_units::{Action, ActionMask};
use serde::Deserialize;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::process::ExitCode;

/// Of each kind so many lines are shown one by one; the others are counted.
const SHOWN: u64 = 10;

/// Prints what is decided otherwise, and how far logits are apart.
///
/// # Errors
/// The model or the log cannot be read, or the log holds no decision.
pub fn replay(order: &Replay) -> Result<ExitCode, StartError> {
    let unreadable = |source| StartError::Read { what: "decision log", path: order.log.clone(), source };
    let log = BufReader::new(File::open(&order.log).map_err(unreadable)?);
    let engine = load::model(&order.model, order.engine)?;
    println!("{}, engine {} ({})", engine.name(), order.engine.name(), order.model.display());
    let mut again = Again { engine, findings: Findings::default() };
    for (index, line) in log.split(b'\n').enumerate() {
        let line = line.map_err(unreadable)?;
        match serde_json::from_slice(&line) {
            Ok(logged) => again.decide(&logged),
            // A full disk leaves half a line.
            Err(error) => again.findings.note(Kind::Skipped, || {
                format!("line {} is not a decision of `gleaner run`: {error}", index + 1)
            }),
        }
    }
    let Findings { counts, furthest } = again.findings;
    let [alike, differing, guards, skipped] = counts;
    if alike + differing + guards == 0 {
        return Err(StartError::NoDecisions { path: order.log.clone() });
    }
    println!("decided as logged        {alike}");
    println!("decided otherwise        {differing}");
    println!("by the guard, no model   {guards}");
    println!("lines skipped            {skipped}");
    println!("logits apart by at most  {furthest:.1e}");
    // Nothing compared is no success.
    Ok(if differing == 0 && alike > 0 { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// What is read of a line; [`crate::log`] writes more.
#[derive(Deserialize)]
struct Logged {
    run_s: u64,
    sequence: u32,
    #[serde(deserialize_with = "action")]
    action: Action,
    #[serde(deserialize_with = "mask")]
    mask: ActionMask,
    logits: Option<[f32; Action::COUNT]>,
    tokens: Tokens,
}

fn named<E: serde::de::Error>(name: &str) -> Result<Action, E> {
    let found = Action::ALL.into_iter().find(|action| action.name() == name);
    found.ok_or_else(|| E::custom(format_args!("there is no action {name:?}")))
}

fn action<'d, D: serde::Deserializer<'d>>(from: D) -> Result<Action, D::Error> {
    named(&String::deserialize(from)?)
}

fn mask<'d, D: serde::Deserializer<'d>>(from: D) -> Result<ActionMask, D::Error> {
    let names = Vec::<String>::deserialize(from)?;
    names.iter().try_fold(ActionMask::EMPTY, |mask, name| Ok(mask.with(named(name)?)))
}

/// What comes of a line.
#[derive(Clone, Copy)]
enum Kind {
    Alike,
    Differing,
    Guards,
    Skipped,
}

#[derive(Default)]
struct Findings {
    /// By [`Kind`].
    counts: [u64; 4],
    furthest: f32,
}

impl Findings {
    fn note(&mut self, kind: Kind, text: impl FnOnce() -> String) {
        self.counts[kind as usize] += 1;
        if matches!(kind, Kind::Differing | Kind::Skipped) {
            match self.counts[kind as usize] {
                ..=SHOWN => println!("{}", text()),
                count if count == SHOWN + 1 => println!("and more of these, counted below"),
                _ => {}
            }
        }
    }
}

struct Again {
    engine: Engine,
    findings: Findings,
}

impl Again {
    fn decide(&mut self, logged: &Logged) {
        let Some(logits) = logged.logits else {
            return self.findings.note(Kind::Guards, String::new);
        };
        let differs = |how: String| format!("run {}, decision {}: {how}", logged.run_s, logged.sequence);
        let was = logged.action.name();
        let answer = match self.engine.infer(&logged.tokens) {
            Ok(answer) => answer,
            Err(error) => {
                let how = || differs(format!("logged {was}, now no answer: {error}"));
                return self.findings.note(Kind::Differing, how);
            }
        };
        let apart = |(then, now): (&f32, &f32)| (then - now).abs();
        let furthest = logits.iter().zip(&answer.logits).map(apart).fold(0.0, f32::max);
        self.findings.furthest = self.findings.furthest.max(furthest);
        match logged.mask.argmax(&answer.logits) {
            Some(action) if action == logged.action => self.findings.note(Kind::Alike, String::new),
            decided => self.findings.note(Kind::Differing, || {
                let now = decided.map_or("nothing", Action::name);
                differs(format!("logged {was}, now {now}; logits up to {furthest:.1e} apart"))
            }),
        }
    }
}
