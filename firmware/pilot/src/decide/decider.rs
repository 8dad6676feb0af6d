//! How a decision is made: by the policy inside the guard's mask, or by the guard alone.

use crate::{Decision, Mission, ReturnReason, State};
use gleaner_guard::Guard;
use gleaner_policy::{DeviceState, Policy, Preference, Situation, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Instant, Metres, Rays};

/// What a decision starts from.
#[derive(Clone, Copy)]
pub(crate) struct Deliberation<'a> {
    pub(crate) mission: &'a Mission,
    pub(crate) guard: &'a Guard,
    pub(crate) devices: &'a [DeviceState],
    pub(crate) preference: Preference,
    pub(crate) collected: f32,
    pub(crate) sequence: u32,
    pub(crate) now: Instant,
    pub(crate) state: State,
    pub(crate) cell: Cell,
    pub(crate) battery: BatteryUnits,
    pub(crate) altitude: Metres,
}

/// Lets the policy take `decision`: its best action among those that the guard allows. In place, because a decision
/// is two kilobytes, and the stack is at its deepest here.
///
/// # Errors
/// [`ReturnReason::Policy`]: the engine failed, or a logit is not a finite number. A model that answers nonsense
/// for one action is not believed for the others. The decision is then void.
///
/// # Cost
/// One inference.
pub(crate) fn ask<P: Policy>(policy: &mut P, decision: &mut Decision) -> Result<(), ReturnReason> {
    let answer = policy.infer(&decision.tokens).map_err(|_| ReturnReason::Policy);
    let inference = decision.inference.insert(answer?);
    if !inference.logits.iter().all(|logit| logit.is_finite()) {
        return Err(ReturnReason::Policy);
    }
    decision.action = decision.mask.argmax(&inference.logits).ok_or(ReturnReason::Policy)?;
    decision.attended = inference.attention.most_attended(&decision.slots);
    Ok(())
}

impl Deliberation<'_> {
    /// A decision for the policy to take, with [`ask`]: to hover, until then.
    pub(crate) fn open(&self) -> Decision {
        self.draft(Action::Hover, self.guard.mask(self.cell, self.battery))
    }

    /// The first move of the shortest way to the terminal; `None` on the terminal and where there is no way.
    pub(crate) fn homeward(&self) -> Option<Decision> {
        let action = self.guard.homeward(self.cell)?;
        Some(self.draft(action, ActionMask::EMPTY.with(action)))
    }

    fn draft(&self, action: Action, mask: ActionMask) -> Decision {
        let spare = self.guard.spare(self.cell, self.battery).unwrap_or_default();
        let sight = Rays { heights: &self.mission.heights, altitude_m: self.altitude.0 as u16 };
        let situation = Situation {
            cell: self.cell,
            battery: self.battery,
            spare,
            terminal: self.mission.terminal,
            preference: self.preference,
            sight: &sight,
        };
        let (tokens, slots) = Tokens::build(&situation, self.devices.iter().copied());
        Decision {
            sequence: self.sequence,
            time: self.now,
            state: self.state,
            cell: self.cell,
            action,
            mask,
            battery: self.battery,
            spare,
            preference: self.preference,
            tokens,
            slots,
            inference: None,
            attended: None,
            collected: self.collected,
        }
    }
}
