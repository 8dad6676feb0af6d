//! Decisions as the page shows them.

use crate::flight::{Decision, round};
use gleaner_pilot::{LoggedDecision, Source};
use gleaner_policy::{FIRST_DEVICE_TOKEN, Inference, Policy};
use gleaner_units::{Action, ActionMask};

/// Logits that differ by more come from another model. The board's 16-bit weights differ by less than this from the
/// trainer's.
const SAME_MODEL: f32 = 0.05;

/// A decision of a pilot in this process.
#[must_use]
pub fn shown(decision: &gleaner_pilot::Decision) -> Decision {
    let logged = LoggedDecision::new(0, decision, None);
    let lookahead = decision.lookahead.map(|record| record.source);
    Decision {
        source: Some(source(logged.logits.is_some(), lookahead).into()),
        ..shown_logged(&logged, decision.inference.as_ref())
    }
}

/// A decision of a log. `inference` is the model's answer to its input, made again: see [`explain`].
#[must_use]
pub fn shown_logged(logged: &LoggedDecision, inference: Option<&Inference>) -> Decision {
    let tokens = FIRST_DEVICE_TOKEN + logged.slots.len();
    Decision {
        t_s: logged.time_us as f64 * 1e-6,
        sequence: logged.sequence,
        cell: logged.cell,
        action: logged.action.name().into(),
        allowed: Action::ALL.map(|action| logged.mask.allows(action)),
        probabilities: logged.logits.map(|logits| probabilities(&logits, logged.mask).map(thousandths)),
        attention: inference.map(|inference| {
            let rows = inference.attention.0.iter().take(tokens);
            rows.map(|row| row.iter().take(tokens).copied().map(thousandths).collect()).collect()
        }),
        slots: logged.slots.to_vec(),
        source: Some(
            source(logged.logits.is_some(), logged.lookahead.as_ref().map(|logged| logged.record.source))
                .into(),
        ),
    }
}

/// What chose the action.
const fn source(has_logits: bool, lookahead: Option<Source>) -> &'static str {
    match (has_logits, lookahead) {
        (false, _) => "the guard",
        (true, None | Some(Source::Network)) => "the network",
        (true, Some(Source::KeptPlan)) => "the kept plan",
        (true, Some(Source::DeviceOrder)) => "a new order of devices",
        (true, Some(Source::SingleMove)) => "a single move, then the plan",
    }
}

/// Makes the inference of a logged decision again, for its attention; `None` where the guard decided alone, and where
/// `policy` is another model than the one that decided.
pub fn explain<P: Policy>(policy: &mut P, logged: &LoggedDecision) -> Option<Inference> {
    let logits = logged.logits?;
    let inference = policy.infer(&logged.tokens).ok()?;
    let same = logits.iter().zip(&inference.logits).all(|(then, now)| (then - now).abs() <= SAME_MODEL);
    same.then_some(inference)
}

/// Shares need no more digits on the page.
fn thousandths(value: f32) -> f32 {
    round(value, 1_000.0)
}

/// The softmax over the allowed actions; zero for the others.
fn probabilities(logits: &[f32; Action::COUNT], mask: ActionMask) -> [f32; Action::COUNT] {
    let highest = mask.iter().map(|action| logits[action.index()]).fold(f32::NEG_INFINITY, f32::max);
    let weight = |action: Action| {
        if mask.allows(action) { (logits[action.index()] - highest).exp() } else { 0.0 }
    };
    let sum: f32 = Action::ALL.into_iter().map(weight).sum();
    Action::ALL.map(|action| if sum > 0.0 { weight(action) / sum } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masked_actions_have_no_probability() {
        let mask = ActionMask::EMPTY.with(Action::Hover).with(Action::East);
        assert_eq!(probabilities(&[0.0, 9.0, 9.0, 9.0, 0.0], mask), [0.5, 0.0, 0.0, 0.0, 0.5]);
        assert_eq!(probabilities(&[0.0; 5], ActionMask::EMPTY), [0.0; 5]);
    }
}
