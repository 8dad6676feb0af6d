//! How a decision is made: by the policy inside the guard's mask, or by the guard alone.

use super::Decision;
use crate::exchange::{collected, device_states};
use crate::scene::Scene;
use crate::{Outputs, ReturnReason, State};
use gleaner_policy::{Policy, Situation, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Rays};

/// Where a decision is made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standpoint {
    pub(crate) state: State,
    pub(crate) cell: Cell,
    pub(crate) battery: BatteryUnits,
}

/// Makes decisions, counts them and keeps the last one: two kilobytes, built in place because the stack is at its
/// deepest here.
#[derive(Clone, Debug)]
pub(crate) struct Decider {
    last: Option<Decision>,
    count: u32,
}

impl Decider {
    pub(crate) const fn new() -> Decider {
        Decider { last: None, count: 0 }
    }

    pub(crate) const fn last(&self) -> Option<&Decision> {
        self.last.as_ref()
    }

    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    /// The policy's best action among those that the guard allows.
    ///
    /// # Errors
    /// [`ReturnReason::Policy`]: the engine failed, or a logit is not a finite number. A model that answers nonsense
    /// for one action is not believed for the others. There is no last decision then.
    ///
    /// # Cost
    /// One inference.
    #[inline(never)]
    pub(crate) fn ask<P: Policy>(
        &mut self,
        scene: &Scene<'_>,
        at: Standpoint,
        policy: &mut P,
        out: &mut Outputs,
    ) -> Result<Action, ReturnReason> {
        let mask = scene.guard.mask(at.cell, at.battery);
        let decision = self.draft(scene, at, Action::Hover, mask);
        match infer(policy, decision) {
            Ok(()) => {
                let action = decision.action;
                self.publish(out);
                Ok(action)
            }
            Err(reason) => {
                self.last = None;
                Err(reason)
            }
        }
    }

    /// The first move of the shortest way to the terminal; `None` on the terminal and where there is no way.
    #[inline(never)]
    pub(crate) fn homeward(
        &mut self,
        scene: &Scene<'_>,
        at: Standpoint,
        out: &mut Outputs,
    ) -> Option<Action> {
        let action = scene.guard.homeward(at.cell)?;
        self.draft(scene, at, action, ActionMask::EMPTY.with(action));
        self.publish(out);
        Some(action)
    }

    fn publish(&mut self, out: &mut Outputs) {
        self.count = self.count.wrapping_add(1);
        out.decided = true;
    }

    fn draft(
        &mut self,
        scene: &Scene<'_>,
        at: Standpoint,
        action: Action,
        mask: ActionMask,
    ) -> &mut Decision {
        let mission = scene.mission;
        let spare = scene.guard.spare(at.cell, at.battery).unwrap_or_default();
        let altitude_m = scene.inputs.parameters.altitude().0 as u16;
        let sight = Rays { heights: &mission.heights, altitude_m };
        let situation = Situation {
            cell: at.cell,
            battery: at.battery,
            spare,
            terminal: mission.terminal,
            preference: scene.preference(),
            sight: &sight,
        };
        let (tokens, slots) = Tokens::build(&situation, device_states(mission, scene.inputs.devices));
        self.last.insert(Decision {
            sequence: self.count,
            time: scene.now,
            state: at.state,
            cell: at.cell,
            action,
            mask,
            battery: at.battery,
            spare,
            preference: situation.preference,
            tokens,
            slots,
            inference: None,
            attended: None,
            collected: collected(mission, scene.inputs.devices),
        })
    }
}

fn infer<P: Policy>(policy: &mut P, decision: &mut Decision) -> Result<(), ReturnReason> {
    let answer = policy.infer(&decision.tokens).map_err(|_| ReturnReason::Policy);
    let inference = decision.inference.insert(answer?);
    if !inference.logits.iter().all(|logit| logit.is_finite()) {
        return Err(ReturnReason::Policy);
    }
    decision.action = decision.mask.argmax(&inference.logits).ok_or(ReturnReason::Policy)?;
    decision.attended = inference.attention.most_attended(&decision.slots);
    Ok(())
}
