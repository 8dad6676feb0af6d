//! `poll(now, inputs) -> outputs`.

use crate::{Decision, Mission, MissionError, Parameters, State, Vehicle};
use gleaner_guard::Guard;
use gleaner_policy::{DeviceState, Policy};
use gleaner_units::{BatteryUnits, Instant, MetresPerSecond, Ned};
use heapless::{String, Vec};

/// What the operator asked for since the last poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// `GLN_ENABLE` 0 or `MAV_CMD_USER_2` 0.
    Off,
    /// `GLN_ENABLE` 1 or `MAV_CMD_USER_2` 1.
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
    /// How a command of ours ended since the last poll.
    pub command_accepted: Option<(Command, bool)>,
}

/// What the machine asks of the autopilot, besides targets. Sent again by the link until it is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// `MAV_CMD_NAV_LAND` where the aircraft is.
    Land,
    /// `MAV_CMD_NAV_RETURN_TO_LAUNCH`: the autopilot's own way out.
    ReturnToLaunch,
    /// `MAV_CMD_DO_CHANGE_SPEED`, ground speed.
    Speed(MetresPerSecond),
}

/// How bad a notice is (RFC 5424, as `MAV_SEVERITY`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// A human must act.
    Critical,
    /// A human should know.
    Warning,
    /// A human asked for it.
    Info,
}

/// One line for the operator (`STATUSTEXT`).
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// How bad.
    pub severity: Severity,
    /// At most 50 characters.
    pub text: String<50>,
}

/// Once a second, for `NAMED_VALUE_FLOAT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Weight of data.
    pub w_data: f32,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// Battery beyond the way to the terminal, when both are known.
    pub spare: Option<BatteryUnits>,
    /// The device most attended to in the last decision, as its index in the mission.
    pub attended: Option<u16>,
}

/// What the machine wants to be sent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Position target; always finite.
    pub setpoint: Option<Ned>,
    /// A command for the autopilot.
    pub command: Option<Command>,
    /// Lines for the operator.
    pub notices: Vec<Notice, 6>,
    /// Whether a decision was made: see [`Machine::decision`].
    pub decided: bool,
    /// Once a second.
    pub telemetry: Option<Telemetry>,
}

/// The mission machine.
#[derive(Clone, Debug)]
pub struct Machine {
    mission: Mission,
    guard: Guard,
    state: State,
    decision: Option<Decision>,
}

impl Machine {
    /// A machine in [`State::Boot`].
    ///
    /// # Errors
    /// The mission cannot be flown.
    pub fn new(mission: Mission, self_test_passed: bool) -> Result<Machine, MissionError> {
        let guard = mission.guard(BatteryUnits(0.0))?;
        let _ = self_test_passed;
        Ok(Machine { mission, guard, state: State::Boot, decision: None })
    }

    /// One step. Call at 20 Hz or more.
    pub fn poll<P: Policy>(&mut self, now: Instant, inputs: &Inputs<'_>, policy: &mut P) -> Outputs {
        let _ = (now, inputs, policy, &self.guard, &self.mission);
        Outputs::default()
    }

    /// What the pilot is doing.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// The last decision.
    #[must_use]
    pub const fn decision(&self) -> Option<&Decision> {
        self.decision.as_ref()
    }
}
