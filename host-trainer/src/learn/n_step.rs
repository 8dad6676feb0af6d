//! n-step returns: joins the slots of a flight into transitions that span n slots.

use crate::env::flight::Reward;
use crate::learn::replay::Transition;
use std::collections::VecDeque;

/// The slots of one flight that are not yet part of a finished transition.
#[derive(Clone, Debug)]
pub(super) struct NStep<O> {
    slots: usize,
    discount: f32,
    pending: VecDeque<Transition<O>>,
}

impl<O: Clone> NStep<O> {
    pub(super) fn new(slots: usize, discount: f32) -> NStep<O> {
        NStep { slots, discount, pending: VecDeque::new() }
    }

    /// Adds a slot and returns the transitions that it completes: one when `n` slots are together, all that are left at
    /// the end of the flight. Those are shorter, which needs no correction, since the value after the end is zero.
    pub(super) fn push(&mut self, slot: Transition<O>) -> Vec<Transition<O>> {
        let over = slot.over;
        self.pending.push_back(slot);
        let mut complete = Vec::new();
        while self.pending.len() >= self.slots || (over && !self.pending.is_empty()) {
            complete.extend(self.join());
            self.pending.pop_front();
        }
        complete
    }

    /// The first pending slot with the rewards of all, and the state after the last.
    fn join(&self) -> Option<Transition<O>> {
        let (first, last) = (self.pending.front()?, self.pending.back()?);
        let mut reward = Reward::default();
        for slot in self.pending.iter().rev() {
            for (sum, part) in reward.iter_mut().zip(slot.reward) {
                *sum = part + self.discount * *sum;
            }
        }
        Some(Transition {
            reward,
            after: last.after.clone(),
            mask_after: last.mask_after,
            over: last.over,
            ..first.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::{Action, ActionMask};

    fn slot(number: u32, over: bool) -> Transition<u32> {
        Transition {
            before: number,
            mask_before: ActionMask::FULL,
            action: Action::Hover,
            reward: [number as f32, -1.0],
            after: number + 1,
            mask_after: ActionMask::FULL,
            over,
        }
    }

    #[test]
    fn one_step_returns_every_slot_unchanged() {
        let mut one = NStep::new(1, 0.9);
        for (number, over) in [(1, false), (2, false), (3, true)] {
            assert_eq!(one.push(slot(number, over)), [slot(number, over)]);
        }
    }

    #[test]
    fn n_steps_are_discounted_and_the_end_flushes() {
        let mut three = NStep::new(3, 0.5);
        assert_eq!(three.push(slot(1, false)), []);
        assert_eq!(three.push(slot(2, false)), []);
        let complete = three.push(slot(3, false));
        let joined = Transition { reward: [1.0 + 1.0 + 0.75, -1.75], after: 4, ..slot(1, false) };
        assert_eq!(complete, [joined]);
        let rest = three.push(slot(4, true));
        let summary: Vec<_> = rest.iter().map(|t| (t.before, t.reward[0], t.after, t.over)).collect();
        assert_eq!(summary, [(2, 2.0 + 1.5 + 1.0, 5, true), (3, 3.0 + 2.0, 5, true), (4, 4.0, 5, true)]);
        assert_eq!(three.push(slot(9, false)), [], "the next flight starts empty");
    }
}
