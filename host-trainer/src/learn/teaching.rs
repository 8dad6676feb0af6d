//! The teachers of the distillation.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::env::flight::Flight;
use crate::judge::evaluation::DeciderError;
use crate::keep::snapshot::Snapshot;
use crate::planner::teacher::{Course, Teacher};
use gleaner_lookahead::{Budget, ChannelModel, FitSettings, LookAhead};
use gleaner_policy::{DeviceState, K_MAX};
use gleaner_units::Action;
use gleaner_world::Realization;

/// Temperature of the look-ahead's labels: a loss of this utility divides the probability of an action by e. At 0.1, the planner's
/// temperature, a detour that the rest of the plan makes good is as probable as the plan, and the student dithers.
const IMPROVED_TEMPERATURE: f32 = 0.01;

/// What the student imitates.
#[derive(Clone, Debug)]
pub enum Teaching {
    /// The planner with full knowledge, [`Teacher`].
    Planner,
    /// The look-ahead that flies, from the student's own action and with this budget: expert iteration (Anthony, Tian and Barber
    /// 2017). Its knowledge is the student's, so that nothing in the labels is beyond the observation but the memory of earlier
    /// slots.
    LookAhead(Budget),
    /// The mean of these policies over the eight views of the state.
    Mentors(Vec<Snapshot>),
}

/// The teacher in one flight.
pub(super) enum Lessons {
    Planner(Course),
    LookAhead(Box<LookAhead<K_MAX>>, Budget),
    Mentors,
}

impl Teaching {
    /// The chain of commands that ends with this run, without its settings.
    pub(super) fn method(&self, from: Option<&Snapshot>) -> String {
        let whole = |snapshot: &Snapshot, out: &str| {
            snapshot.command_line(out).trim_start_matches("gleaner-train ").to_owned()
        };
        let mut method = from.map_or("distil".to_owned(), |from| {
            format!("{} && gleaner-train distil --from FIRST", whole(from, "FIRST"))
        });
        let mentors = match self {
            Teaching::Planner => [].as_slice(),
            Teaching::LookAhead(Budget { tours }) => return method + &format!(" --lookahead {tours}"),
            Teaching::Mentors(mentors) => mentors,
        };
        for (index, mentor) in mentors.iter().enumerate() {
            if from.is_some_and(|from| from.actor == mentor.actor) {
                method += " --mentor FIRST";
            } else {
                let name = format!("MENTOR{index}");
                method = format!("{} && gleaner-train {method} --mentor {name}", whole(mentor, &name));
            }
        }
        method
    }

    /// The teacher at the begin of this flight. `seed`: of the look-ahead's search.
    pub(super) fn begin(
        &self,
        flight: &Flight,
        realization: &Realization,
        planner: &Teacher,
        seed: u64,
    ) -> Lessons {
        match self {
            Teaching::Planner => Lessons::Planner(planner.study(realization)),
            Teaching::LookAhead(budget) => {
                let mut lookahead = LookAhead::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
                let devices: Vec<DeviceState> = flight.device_states().collect();
                lookahead.begin(Some(flight.map()), &devices, seed);
                Lessons::LookAhead(Box::new(lookahead), *budget)
            }
            Teaching::Mentors(_) => Lessons::Mentors,
        }
    }
}

impl Lessons {
    /// The teacher's action in the present state, and the probability of each action. `logits`: the mean of the mentors, or of
    /// the student if there are none.
    pub(super) fn label(
        &mut self,
        flight: &Flight,
        logits: &[f32; ACTIONS],
    ) -> Result<(Action, [f32; ACTIONS]), DeciderError> {
        match self {
            Lessons::Planner(course) => Ok(course.teach(flight)),
            Lessons::LookAhead(lookahead, budget) => improve(lookahead, flight, logits, *budget),
            Lessons::Mentors => {
                let advice = flight.mask().argmax(logits).ok_or_else(not_a_number)?;
                Ok((advice, Distribution::new(logits, flight.mask()).probability))
            }
        }
    }
}

/// The action of the look-ahead, and a label: the softmax of the utilities of the allowed actions, each followed by the plan.
fn improve(
    lookahead: &mut LookAhead<K_MAX>,
    flight: &Flight,
    logits: &[f32; ACTIONS],
    budget: Budget,
) -> Result<(Action, [f32; ACTIONS]), DeciderError> {
    let (mask, devices) = (flight.mask(), flight.device_states().collect::<Vec<_>>());
    let view = flight.view(&devices);
    let choice = lookahead.propose(&view, logits, mask, budget).ok_or_else(not_a_number)?;
    // Without a plan the student's own action stays.
    let utilities = lookahead.utilities(&view, mask).unwrap_or(*logits);
    let label = Distribution::label(utilities, IMPROVED_TEMPERATURE, choice.action, mask);
    Ok((choice.action, label.probability))
}

fn not_a_number() -> DeciderError {
    DeciderError("a network's output is not a number".into())
}
