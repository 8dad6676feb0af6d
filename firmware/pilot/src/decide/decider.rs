//! How a decision is made: by the policy inside the guard's mask, or by the guard alone.

use super::{Decision, Deliberator, Place};
use crate::exchange::{collected, device_states};
use crate::scene::Scene;
use crate::{Outputs, ReturnReason, State};
use gleaner_link::Severity;
use gleaner_policy::{ChannelOffset, DeviceState, Situation, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Rays, Sight};

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
    /// Whether the next decision is the first of a mission.
    begins: bool,
    /// Whether the network decided the last slot although look-ahead is switched on.
    fell_back: bool,
}

impl Decider {
    pub(crate) const fn new() -> Decider {
        Decider { last: None, count: 0, begins: true, fell_back: false }
    }

    pub(crate) const fn last(&self) -> Option<&Decision> {
        self.last.as_ref()
    }

    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    /// Begins a mission: with the next decision the look-ahead discards plan and channel.
    pub(crate) const fn begin_mission(&mut self) {
        self.begins = true;
        self.fell_back = false;
    }

    /// Whether the policy was asked in this mission. Until then it has the channel of the one before.
    pub(crate) const fn has_begun(&self) -> bool {
        !self.begins
    }

    /// The policy's best action among those that the guard allows.
    ///
    /// # Errors
    /// [`ReturnReason::Policy`]: the engine failed, or a logit is not a finite number. A model that answers nonsense
    /// for one action is not believed for the others. There is no last decision then.
    ///
    /// # Cost
    /// One inference, and a search if there is look-ahead.
    #[inline(never)]
    pub(crate) fn ask<D: Deliberator>(
        &mut self,
        scene: &Scene<'_>,
        at: Standpoint,
        policy: &mut D,
        out: &mut Outputs,
    ) -> Result<Action, ReturnReason> {
        let mask = scene.guard.mask(at.cell, at.battery);
        if core::mem::take(&mut self.begins) {
            begin(policy, scene);
        }
        let decision = self.draft(scene, at, (Action::Hover, mask), policy.channel_for_tokens());
        match infer(policy, decision) {
            Ok(()) => {
                propose(policy, scene, decision);
                if D::LOOKS_AHEAD {
                    let is_alone = decision.lookahead.is_none_or(|record| record.tours == 0);
                    let fell_back = is_alone && scene.inputs.parameters.looks_ahead();
                    if fell_back && !self.fell_back {
                        out.say(Severity::Notice, format_args!("gleaner: no look-ahead, network decides"));
                    }
                    self.fell_back = fell_back;
                }
                let decision = self.last.as_ref().ok_or(ReturnReason::Policy)?;
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
        self.draft(scene, at, (action, ActionMask::EMPTY.with(action)), ChannelOffset::NONE);
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
        (action, mask): (Action, ActionMask),
        channel: ChannelOffset,
    ) -> &mut Decision {
        let mission = scene.mission;
        let spare = scene.guard.spare(at.cell, at.battery).unwrap_or_default();
        let sight = rays(scene);
        let situation = Situation {
            cell: at.cell,
            battery: at.battery,
            spare,
            terminal: mission.terminal,
            preference: scene.preference(),
            sight: &sight,
            channel,
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
            lookahead: None,
            channel,
        })
    }
}

/// Line of sight over the mission's buildings.
fn rays<'a>(scene: &Scene<'a>) -> Rays<'a> {
    let altitude_m = scene.inputs.parameters.altitude().0 as u16;
    Rays { heights: &scene.mission.heights, altitude_m }
}

fn begin<D: Deliberator>(policy: &mut D, scene: &Scene<'_>) {
    let rays = rays(scene);
    // A map without any building is no map: the model would take every link for unobstructed.
    let has_map = rays.heights.tallest().0 > 0.0;
    let sites = scene.mission.devices.iter();
    let full = sites.map(|site| DeviceState { cell: site.cell, remaining: site.data, snr: None });
    policy.begin(has_map.then_some(&rays as &dyn Sight), full, scene.mission.seed());
}

/// Tells what was heard, and lets the look-ahead choose among the actions that the guard allows.
fn propose<D: Deliberator>(policy: &mut D, scene: &Scene<'_>, decision: &mut Decision) {
    let Some(inference) = &decision.inference else { return };
    let Decision { cell, battery, preference, mask, .. } = *decision;
    let place = Place { cell, battery, preference, guard: scene.guard, sight: &rays(scene) };
    let devices = device_states(scene.mission, scene.inputs.devices);
    let is_on = scene.inputs.parameters.looks_ahead();
    let proposed = policy.propose(&place, devices, &inference.logits, mask, is_on);
    if let Some((action, record)) = proposed.filter(|(action, _)| mask.allows(*action)) {
        decision.action = action;
        decision.lookahead = Some(record);
    }
}

fn infer<D: Deliberator>(policy: &mut D, decision: &mut Decision) -> Result<(), ReturnReason> {
    let answer = policy.infer(&decision.tokens).ok_or(ReturnReason::Policy);
    let inference = decision.inference.insert(answer?);
    if !inference.logits.iter().all(|logit| logit.is_finite()) {
        return Err(ReturnReason::Policy);
    }
    decision.action = decision.mask.argmax(&inference.logits).ok_or(ReturnReason::Policy)?;
    decision.attended = inference.attention.most_attended(&decision.slots);
    Ok(())
}
