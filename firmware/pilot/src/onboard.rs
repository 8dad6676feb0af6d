//! Bytes in, bytes out: link endpoint, radio decoder, device table and [`Machine`] in one.

use crate::{Decision, Fault, Machine, Mission, MissionError, Parameters, State};
use gleaner_policy::{Policy, SelfTestError};
use gleaner_units::{BatteryUnits, Cell, Duration, Instant};

/// Who we are on the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// MAVLink system id; `None` adopts the autopilot's.
    pub system_id: Option<u8>,
    /// MAVLink component id, 191 unless something else on the vehicle has it.
    pub component_id: u8,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { system_id: None, component_id: 191 }
    }
}

/// Numbers for a summary or a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    /// Decisions since boot, of policy and guard.
    pub decisions: u32,
    /// Battery units paid since the mission was engaged (0.5 a hover, 1 a move).
    pub spent: BatteryUnits,
    /// Battery units left, by the ledger; `None` before the first engagement.
    pub battery: Option<BatteryUnits>,
    /// Fraction of the initial data that is known to be collected.
    pub collected: f32,
    /// The cell that the current leg leads to.
    pub target: Option<Cell>,
    /// Why the pilot gave up.
    pub fault: Option<Fault>,
    /// Whether the aircraft has landed at the end of a mission.
    pub landed: bool,
}

/// The whole pilot. Feed it bytes, poll it at 20 Hz or more, carry its bytes away.
pub struct Onboard<P> {
    machine: Machine,
    policy: P,
    inference_time: Option<Duration>,
    parameters: Parameters,
    settings: Settings,
}

impl<P: Policy> Onboard<P> {
    /// A pilot at boot. `self_test` is the result of [`gleaner_policy::self_test`] with this policy; after a
    /// failure the pilot speaks but never engages. `GLN_ENABLE` starts at 0 whatever `parameters` say: only a
    /// request in this run engages.
    ///
    /// # Errors
    /// The mission cannot be flown.
    pub fn new(
        mission: Mission,
        parameters: Parameters,
        settings: Settings,
        policy: P,
        self_test: Result<(), SelfTestError>,
    ) -> Result<Onboard<P>, MissionError> {
        let machine = Machine::new(mission, self_test.is_ok())?;
        Ok(Onboard { machine, policy, inference_time: None, parameters, settings })
    }

    /// Bytes from the autopilot's link (which also carries the ground station), in any pieces.
    pub fn receive_link(&mut self, now: Instant, bytes: &[u8]) {
        let _ = (now, bytes, &self.settings);
    }

    /// Bytes from the radio: postcard reports in COBS, in any pieces.
    pub fn receive_radio(&mut self, now: Instant, bytes: &[u8]) {
        let _ = (now, bytes);
    }

    /// One step: decides what to send. The model runs inside. Call at 20 Hz or more; the clock must not go back.
    pub fn poll(&mut self, now: Instant) {
        let _ = (now, &mut self.policy, &self.parameters);
    }

    /// Moves bytes for the link into `buffer`; how many. Call until it gives 0.
    pub fn transmit(&mut self, buffer: &mut [u8]) -> usize {
        let _ = buffer;
        0
    }

    /// The last decision, once.
    pub fn decision(&mut self) -> Option<&Decision> {
        self.machine.decision()
    }

    /// What the pilot is doing.
    #[must_use]
    pub const fn state(&self) -> State {
        self.machine.state()
    }

    /// The numbers so far.
    #[must_use]
    pub fn stats(&self) -> Stats {
        Stats {
            decisions: 0,
            spent: BatteryUnits(0.0),
            battery: None,
            collected: 0.0,
            target: None,
            fault: None,
            landed: false,
        }
    }

    /// The parameters as they are now.
    #[must_use]
    pub const fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The engine, for a program that times it.
    pub const fn policy(&self) -> &P {
        &self.policy
    }

    /// How long the last inference took, measured by the program (a clock is an input); sent as `infer_us`.
    pub fn set_inference_time(&mut self, took: Duration) {
        self.inference_time = Some(took);
    }
}
