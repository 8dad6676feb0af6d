//! What goes into the machine and what comes out of it.

use crate::Vehicle;
use core::fmt::{self, Write};
use gleaner_link::{AutopilotCommand, Parameters, Severity};
use gleaner_policy::DeviceState;
use gleaner_units::{BatteryUnits, Ned};
use heapless::{String, Vec};

/// What the operator asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// `GLN_ENABLE` 0 or `MAV_CMD_USER_2` 0.
    Off,
    /// `GLN_ENABLE` 1 or `MAV_CMD_USER_2` 1, also when it was 1 before.
    Engage,
    /// `GLN_ENABLE` 2 or `MAV_CMD_USER_2` 2.
    Shadow,
    /// `MAV_CMD_USER_3`.
    Return,
}

/// What the machine looks at in one poll.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// What the autopilot says.
    pub vehicle: &'a Vehicle,
    /// The devices of the mission, in its order, with ageing already applied.
    pub devices: &'a [DeviceState],
    /// The operator's parameters.
    pub parameters: &'a Parameters,
    /// The operator's newest request since the last poll.
    pub request: Option<Request>,
    /// Whether any heartbeat since the last poll showed a mode in which someone else steers, even if the last
    /// one does not.
    pub other_mode_seen: bool,
    /// Commands of ours that ended since the last poll, and whether the autopilot accepted them.
    pub ended: &'a [(AutopilotCommand, bool)],
    /// Whether an input on the companion or board inhibits engaging, such as a remove-before-flight switch.
    pub engage_inhibited: bool,
}

/// One line for the operator (`STATUSTEXT`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// How bad.
    pub severity: Severity,
    /// At most 50 characters: one message.
    pub text: String<50>,
}

/// Once a second, for `NAMED_VALUE_FLOAT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Weight of data.
    pub w_data: f32,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// Battery beyond the way to the terminal, while it is watched.
    pub spare: Option<BatteryUnits>,
    /// The device most attended to in the last decision, as its index in the mission.
    pub attended: Option<u16>,
}

/// What the machine wants to be sent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Drop every target and command of ours that has not left or is not answered yet. Comes before the rest.
    pub withdraw: bool,
    /// Position target; always finite.
    pub setpoint: Option<Ned>,
    /// A command for the autopilot; the link repeats it until it is answered.
    pub command: Option<AutopilotCommand>,
    /// Lines for the operator.
    pub notices: Vec<Notice, 6>,
    /// Whether a decision was made: see [`crate::Machine::decision`].
    pub decided: bool,
    /// Once a second.
    pub telemetry: Option<Telemetry>,
}

impl Outputs {
    pub(crate) fn say(&mut self, severity: Severity, text: fmt::Arguments<'_>) {
        let mut line = String::new();
        // A line that is too long is cut; a test shows that none of ours is.
        let _ = line.write_fmt(text);
        let _ = self.notices.push(Notice { severity, text: line });
    }
}
