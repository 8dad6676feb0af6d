//! The states that act. Each looks at a [`crate::scene::Scene`] and returns an [`Outcome`]; the machine alone moves from
//! state to state.

pub(crate) mod flying;
pub(crate) mod hand_back;
pub(crate) mod landing;
pub(crate) mod shadow;
pub(crate) mod waiting;

use crate::flight::plan::Plan;
use crate::{Fault, ReturnReason, TakeOver};

/// What a state's step comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// The state continues.
    Stay,
    /// The request is over.
    Idle,
    /// Nothing is missing: the mission is engaged.
    Engage(Plan),
    /// The flight goes home.
    GoHome(ReturnReason),
    /// The autopilot lands, or has landed.
    Done { landed: bool },
    /// Someone else has the aircraft.
    Passive(TakeOver),
    /// The flight cannot go on; the aircraft is handed back.
    Fault(Fault),
}
