//! What goes into the machine and what comes out of it.

use crate::{DeviceSite, Mission, Vehicle};
use core::fmt::{self, Write};
use gleaner_link::{AutopilotCommand, Firmware, Parameters, PositionTarget, Severity};
use gleaner_policy::DeviceState;
use gleaner_units::{BatteryUnits, Duration, Instant, MetresPerSecond};
use heapless::{String, Vec};

/// What the operator requests.
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
    /// The program is about to end: give the aircraft back first.
    HandBack,
}

/// What the autopilot is requested to do when the program ends in flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnStop {
    /// Return to launch.
    #[default]
    Return,
    /// Hold the position, for an operator who stands by.
    Hold,
}

impl OnStop {
    pub(crate) fn command(self, firmware: Option<Firmware>) -> AutopilotCommand {
        match (self, firmware) {
            (OnStop::Hold, Some(firmware)) => AutopilotCommand::Hold(firmware),
            _ => AutopilotCommand::ReturnToLaunch,
        }
    }
}

/// Limits that a program sets once. They are not parameters: an operator does not change them in flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// A request to engage that is not fulfilled ends after this time.
    pub request_lifetime: Duration,
    /// After this time in flight without a report of any device the mission goes home.
    pub blind_return: Duration,
    /// Mean descent rate of the autopilot's landing: ArduCopter and PX4 took 57 s and 54 s from 60 m.
    pub descent_rate: MetresPerSecond,
    /// What is requested when the program ends in flight. After every other fault it is a return.
    pub on_stop: OnStop,
}

impl Rules {
    /// 60 s, 60 s, 1.05 m/s, return.
    pub const DEFAULT: Rules = Rules {
        request_lifetime: Duration::from_secs(60),
        blind_return: Duration::from_secs(60),
        descent_rate: MetresPerSecond(1.05),
        on_stop: OnStop::Return,
    };
}

impl Default for Rules {
    fn default() -> Rules {
        Rules::DEFAULT
    }
}

/// The radio's view of the mission's devices. Computed on request: only a decision needs all of it.
pub trait Devices {
    /// The device with this index in the mission, with ageing applied.
    fn state(&self, index: usize, site: &DeviceSite) -> DeviceState;
}

/// All devices of `mission`, in its order.
pub(crate) fn device_states<'a>(
    mission: &'a Mission,
    devices: &'a dyn Devices,
) -> impl Iterator<Item = DeviceState> + 'a {
    mission.devices.iter().enumerate().map(|(index, site)| devices.state(index, site))
}

/// 1 - remaining / initial, both over all devices; 0 for a mission without data.
pub(crate) fn collected(mission: &Mission, devices: &dyn Devices) -> f32 {
    let initial = mission.initial_data();
    let remaining: f32 = device_states(mission, devices).map(|device| device.remaining).sum();
    if initial > 0.0 { (1.0 - remaining / initial).clamp(0.0, 1.0) } else { 0.0 }
}

/// What came in from the radio.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RadioActivity {
    /// When the last report of a device of this mission arrived.
    pub heard_at: Option<Instant>,
    /// Bytes on the radio's port since boot.
    pub bytes: u32,
    /// Reports since boot, of all devices and ports.
    pub reports: u32,
}

/// What the machine looks at in one poll.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// The autopilot's messages.
    pub vehicle: &'a Vehicle,
    /// The devices of the mission.
    pub devices: &'a dyn Devices,
    /// The radio's port.
    pub radio: RadioActivity,
    /// The operator's parameters.
    pub parameters: &'a Parameters,
    /// The program's limits.
    pub rules: &'a Rules,
    /// The operator's requests since the last poll, in order.
    pub requests: &'a [Request],
    /// Whether any heartbeat since the last poll showed a mode in which someone else steers, even if the last
    /// one does not.
    pub other_mode_seen: bool,
    /// Whether the autopilot followed a target that we did not send, since we began to send targets.
    pub foreign_target: bool,
    /// Whether the autopilot reported the target that it follows since the last poll.
    pub target_reported: bool,
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
    /// Battery percent that a unit costs, as learned in flight.
    pub unit_pct: f32,
    /// Battery percent expected at touchdown if the mission went home now; negative when it does not suffice.
    pub land_pct: Option<f32>,
    /// Gain of links with line of sight at 100 m compared to the nominal channel, dB, as estimated in this mission; `None`
    /// where it is not estimated.
    pub snr_off: Option<f32>,
}

/// What the machine sends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Drop every target and command of ours that has not left or is not answered yet. Comes before the rest.
    pub withdraw: bool,
    /// Position target, with a velocity while it moves; always finite.
    pub setpoint: Option<PositionTarget>,
    /// A command for the autopilot; the link repeats it until it is answered.
    pub command: Option<AutopilotCommand>,
    /// Lines for the operator.
    pub notices: Vec<Notice, 8>,
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
