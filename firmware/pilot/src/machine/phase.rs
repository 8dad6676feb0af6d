//! A state with the data that belongs to it.

use crate::states::flying::Flight;
use crate::states::hand_back::HandBack;
use crate::states::shadow::Shadow;
use crate::states::waiting::Wait;
use crate::{Fault, State, TakeOver};

/// The phases behind [`State`].
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a flight is large, and there is no heap to put it on")]
pub(super) enum Phase {
    Boot,
    Idle,
    Waiting(Wait),
    Flying(Flight),
    Done { landed: bool },
    Passive(TakeOver),
    Fault(Fault, HandBack),
    Shadow(Shadow),
}

impl Phase {
    pub(super) const fn state(&self) -> State {
        match self {
            Phase::Boot => State::Boot,
            Phase::Idle => State::Idle,
            Phase::Waiting(_) => State::Waiting,
            Phase::Flying(flight) => flight.state(),
            Phase::Done { .. } => State::Done,
            Phase::Passive(_) => State::Passive,
            Phase::Fault(..) => State::Fault,
            Phase::Shadow(_) => State::Shadow,
        }
    }
}
