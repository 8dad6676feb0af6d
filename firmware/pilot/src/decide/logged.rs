//! One line of a decision log (`decisions.jsonl`), as `gleaner` and `gleaner-sitl` write it and `gleaner replay`
//! reads it.

use super::LoggedLookAhead;
use crate::{Decision, DecisionRecord, State};
use gleaner_policy::{Slots, Tokens};
use gleaner_units::{Action, ActionMask, Duration};
use serde::{Deserialize, Serialize};
use std::string::String;
use std::vec::Vec;

/// A decision with the whole input of the model, so that it can be made again. Units as in [`Decision`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoggedDecision {
    /// Start of the run, seconds since 1970: distinguishes the runs in one file.
    pub run_s: u64,
    /// Counts from 0 since boot.
    pub sequence: u32,
    /// Since the start of the run.
    pub time_us: u64,
    /// The state in which it was made.
    #[serde(with = "state")]
    pub state: State,
    /// The cell of the aircraft: x (east), y (north).
    pub cell: [i16; 2],
    /// The decision.
    #[serde(with = "action")]
    pub action: Action,
    /// The actions that the guard allowed.
    #[serde(with = "mask")]
    pub mask: ActionMask,
    /// Battery before the action.
    pub battery: f32,
    /// Battery beyond the way to the terminal.
    pub spare: f32,
    /// Weight of data.
    pub w_data: f32,
    /// Fraction of the initial data that was collected.
    pub collected: f32,
    /// The model's answer; `None` where the guard decided alone.
    pub logits: Option<[f32; Action::COUNT]>,
    /// The device with the most attention, as its index in the mission.
    pub attended: Option<u16>,
    /// Duration of the inference, where it was measured.
    pub infer_us: Option<u64>,
    /// Where the aircraft was, in the estimator's local frame.
    #[serde(default)]
    pub position_ned_m: Option<[f32; 3]>,
    /// The mission's index of the device in each device token.
    pub slots: Slots,
    /// The model's input.
    pub tokens: Tokens,
    /// What the look-ahead was given and what it answered; absent in a program without look-ahead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lookahead: Option<LoggedLookAhead>,
    /// What only a simulation knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<SimulatedSlot>,
}

/// The result of the slot after a decision, known in a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedSlot {
    /// The device that was served, as its index in the mission.
    pub served: Option<usize>,
    /// Data units that it sent.
    pub served_units: f32,
    /// Fraction of the initial data that was collected by the end of the slot.
    pub collected_after: f32,
}

impl LoggedDecision {
    /// The line of a decision made in this process.
    #[must_use]
    pub fn new(run_s: u64, decision: &Decision, inference_time: Option<Duration>) -> LoggedDecision {
        LoggedDecision {
            time_us: decision.time.as_micros(),
            infer_us: inference_time.map(Duration::as_micros),
            ..LoggedDecision::from_record(
                run_s,
                &decision.record(),
                decision.tokens.clone(),
                decision.slots.clone(),
            )
        }
    }

    /// The line of a decision made elsewhere, whose input was built again.
    #[must_use]
    pub fn from_record(run_s: u64, record: &DecisionRecord, tokens: Tokens, slots: Slots) -> LoggedDecision {
        LoggedDecision {
            run_s,
            sequence: record.sequence,
            time_us: u64::from(record.time_ms) * 1_000,
            state: record.state,
            cell: [record.cell.x, record.cell.y],
            action: record.action,
            mask: record.mask,
            battery: record.battery.0,
            spare: record.spare.0,
            w_data: record.w_data,
            collected: record.collected,
            logits: record.logits,
            attended: record.attended,
            infer_us: None,
            position_ned_m: None,
            slots,
            tokens,
            lookahead: None,
            truth: None,
        }
    }
}

/// A value of `all` by its name.
fn named<T: Copy, E: serde::de::Error>(
    what: &str,
    name: &str,
    all: impl IntoIterator<Item = T>,
    name_of: fn(T) -> &'static str,
) -> Result<T, E> {
    let found = all.into_iter().find(|&value| name_of(value) == name);
    found.ok_or_else(|| E::custom(format_args!("there is no {what} {name:?}")))
}

mod action {
    use super::*;
    use serde::{Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(action: &Action, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(action.name())
    }

    pub(super) fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<Action, D::Error> {
        named("action", &String::deserialize(from)?, Action::ALL, Action::name)
    }
}

mod mask {
    use super::*;
    use serde::{Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(mask: &ActionMask, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(mask.iter().map(Action::name))
    }

    pub(super) fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<ActionMask, D::Error> {
        let names = Vec::<String>::deserialize(from)?;
        names.iter().try_fold(ActionMask::EMPTY, |mask, name| {
            Ok(mask.with(named("action", name, Action::ALL, Action::name)?))
        })
    }
}

mod state {
    use super::*;
    use serde::{Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(state: &State, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(state.name())
    }

    pub(super) fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<State, D::Error> {
        named("state", &String::deserialize(from)?, State::ALL, State::name)
    }
}
