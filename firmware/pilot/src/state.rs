//! The states of the pilot.

use serde::{Deserialize, Serialize};

/// What the pilot is doing.
///
/// ```text
///                 self-test failed
///        Boot ------------------------> Fault (never leaves)
///          | passed
///          v       request shadow
///   +--> Idle <---------------------> Shadow        decides and logs, commands nothing
///   |      | request engage
///   |      v
///   |   Waiting --- GUIDED left again -------------> Passive
///   |      |    --- 60 s, failsafe, disarmed ------> Idle
///   |      | every condition holds, heartbeat since the request
///   |      v
///   |   Engaged --- mode, target or place not ours -> Passive --- new request ---> Waiting, Shadow, Idle
///   |      | a move entered the terminal,     \
///   |      | return, battery, failsafe,        \ position, origin or autopilot lost,
///   |      | policy failed, no progress,        \ late poll, altitude lost, no progress at all,
///   |      | radio silent, position jumped       \ the program ends
///   |      v                                      v
///   |   Homing -- as from Engaged -> Passive   Fault --- new request ---> Waiting, Shadow, Idle
///   |      | landing confirmed                   | asks for return to launch until accepted,
///   |      v                                     | each time after a newer heartbeat in our mode
///   |    Done    landing, then landed --- another mode while landing -> Passive
///   |
///   +--- request off: from every state. Disarmed: from Waiting, Engaged and Homing (Done when landing).
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum State {
    /// The self-test's result is not applied yet.
    Boot,
    /// No request.
    Idle,
    /// The operator requested to engage; a condition is missing.
    Waiting,
    /// The policy flies.
    Engaged,
    /// The guard flies to the terminal and lands there.
    Homing,
    /// The autopilot lands or has landed at the terminal.
    Done,
    /// The human pilot, another station or a failsafe has the aircraft.
    Passive,
    /// The pilot gave up; see [`crate::Fault`].
    Fault,
    /// Decides and logs, commands nothing.
    Shadow,
}

impl State {
    /// Every state.
    pub const ALL: [State; 9] = [
        State::Boot,
        State::Idle,
        State::Waiting,
        State::Engaged,
        State::Homing,
        State::Done,
        State::Passive,
        State::Fault,
        State::Shadow,
    ];

    /// Lower-case English name, as logs and pages print it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            State::Boot => "boot",
            State::Idle => "idle",
            State::Waiting => "waiting",
            State::Engaged => "engaged",
            State::Homing => "homing",
            State::Done => "done",
            State::Passive => "passive",
            State::Fault => "fault",
            State::Shadow => "shadow",
        }
    }

    /// Whether the pilot flies the aircraft.
    #[must_use]
    pub const fn flies(self) -> bool {
        matches!(self, State::Engaged | State::Homing)
    }

    /// Whether targets or commands of ours may be under way. (A fault may still request a return, see
    /// [`crate::Fault`].)
    #[must_use]
    pub const fn commands(self) -> bool {
        self.flies() || matches!(self, State::Waiting)
    }
}
