//! Finds fewer incidents with which a flight still fails.

use crate::{Rule, Trial};
use std::mem::Discriminant;

/// The kind of a failure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Failure {
    /// The first broken rule, by its kind.
    Rule(Discriminant<Rule>),
    /// The flight never began or never ended.
    NoEnd,
}

/// The indices of a smaller set of incidents with which the flight fails in the same way: incidents are left out one
/// after the other as long as it still does. `None` if all are needed. `fly` flies a trial and reports its failure.
pub(super) fn smallest<E>(
    trial: &Trial,
    mut fly: impl FnMut(&Trial) -> Result<Option<Failure>, E>,
) -> Result<Option<Vec<usize>>, E> {
    let all: Vec<usize> = (0..trial.script.incidents.len()).collect();
    let failure = fly(trial)?;
    let mut kept = all.clone();
    for index in all.iter().rev() {
        let fewer: Vec<usize> = kept.iter().copied().filter(|kept| kept != index).collect();
        if fly(&trial.clone().with_incidents(&fewer))? == failure {
            kept = fewer;
        }
    }
    Ok((kept.len() < all.len()).then_some(kept))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AutopilotKind, Incident, IncidentKind, VehicleMode};
    use gleaner_units::Duration;

    fn trial(count: u64) -> Trial {
        let mut trial = Trial::draw(1, AutopilotKind::ArduPilot, true);
        let kind = IncidentKind::pilot_selects(VehicleMode::Hold);
        trial.script.incidents =
            (0..count).map(|n| Incident { after: Duration::from_secs(n), kind }).collect();
        trial
    }

    /// Fails when the incidents at 1 s and 3 s are both there.
    fn fails(trial: &Trial) -> Result<Option<Failure>, ()> {
        let has = |s| trial.script.incidents.iter().any(|i| i.after == Duration::from_secs(s));
        Ok((has(1) && has(3)).then_some(Failure::NoEnd))
    }

    #[test]
    fn only_the_needed_incidents_remain() {
        assert_eq!(smallest(&trial(5), fails), Ok(Some(vec![1, 3])));
    }

    #[test]
    fn nothing_is_smaller_when_all_are_needed() {
        let needed = trial(4).with_incidents(&[1, 3]);
        assert_eq!(smallest(&needed, fails), Ok(None));
    }
}
