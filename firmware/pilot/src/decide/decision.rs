//! One decision: whole for the log on board, short for the wire.

use super::LookAheadRecord;
use crate::State;
use gleaner_policy::{ChannelOffset, Inference, Preference, Slots, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Instant};
use serde::{Deserialize, Serialize};

/// The most bytes that a [`DecisionRecord`] takes: one `TUNNEL` payload.
pub const RECORD_BYTES_MAX: usize = 128;

/// Everything that a decision was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// Counts from 0 since boot.
    pub sequence: u32,
    /// When.
    pub time: Instant,
    /// [`State::Engaged`], [`State::Homing`] or [`State::Shadow`].
    pub state: State,
    /// The cell that the aircraft is in.
    pub cell: Cell,
    /// What was decided.
    pub action: Action,
    /// What the guard allowed.
    pub mask: ActionMask,
    /// Battery before the action.
    pub battery: BatteryUnits,
    /// Battery beyond the way to the terminal.
    pub spare: BatteryUnits,
    /// The preference that was in force.
    pub preference: Preference,
    /// The model's input.
    pub tokens: Tokens,
    /// Which device of the mission stands in which device token.
    pub slots: Slots,
    /// The model's answer; `None` where the guard decided alone.
    pub inference: Option<Inference>,
    /// The device most attended to, as its index in the mission.
    pub attended: Option<u16>,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// How the look-ahead came to the action; `None` in a program without look-ahead.
    pub lookahead: Option<LookAheadRecord>,
    /// The channel behind yield map and vantages.
    pub channel: ChannelOffset,
}

/// What a ground station gets of a [`Decision`]: postcard in `TUNNEL` type 40001.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DecisionRecord {
    /// Counts from 0 since boot.
    pub sequence: u32,
    /// Time since boot, ms, wrapping.
    pub time_ms: u32,
    /// The state when it was made.
    pub state: State,
    /// The cell that the aircraft is in.
    pub cell: Cell,
    /// What was decided.
    pub action: Action,
    /// What the guard allowed.
    pub mask: ActionMask,
    /// Battery before the action, units.
    pub battery: BatteryUnits,
    /// Battery beyond the way to the terminal, units.
    pub spare: BatteryUnits,
    /// Weight of data.
    pub w_data: f32,
    /// One per action, in contract order; `None` where the guard decided alone.
    pub logits: Option<[f32; Action::COUNT]>,
    /// The device most attended to, as its index in the mission.
    pub attended: Option<u16>,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// How the look-ahead came to the action; `None` in a program without look-ahead.
    pub lookahead: Option<LookAheadRecord>,
    /// The channel behind yield map and vantages.
    pub channel: ChannelOffset,
}

impl Decision {
    /// The short form.
    #[must_use]
    pub fn record(&self) -> DecisionRecord {
        DecisionRecord {
            sequence: self.sequence,
            time_ms: self.time.as_boot_ms(),
            state: self.state,
            cell: self.cell,
            action: self.action,
            mask: self.mask,
            battery: self.battery,
            spare: self.spare,
            w_data: self.preference.w_data(),
            logits: self.inference.as_ref().map(|inference| inference.logits),
            attended: self.attended,
            collected: self.collected,
            lookahead: self.lookahead,
            channel: self.channel,
        }
    }
}

impl DecisionRecord {
    /// Writes the record; the bytes used. `None` only for a buffer below [`RECORD_BYTES_MAX`].
    pub fn encode<'b>(&self, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        postcard::to_slice(self, buffer).ok().map(|bytes| &*bytes)
    }

    /// Reads a record; `None` for anything else.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Option<DecisionRecord> {
        postcard::from_bytes(bytes).ok()
    }
}
