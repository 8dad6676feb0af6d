//! `poll(now, inputs) -> outputs`: the operator's word, the dispatch by state, and what is told of it.

use crate::states::flying::{Flight, HandBack};
use crate::states::waiting::{ShadowWatch, Wait};
use crate::{
    Decision, Fault, Inputs, Mission, MissionError, Outputs, Request, ReturnReason, State, Telemetry, Vehicle,
};
use gleaner_guard::Guard;
use gleaner_link::{Firmware, Parameters, Severity, SystemState};
use gleaner_policy::{DeviceState, Policy, Preference};
use gleaner_units::{BatteryUnits, Cell, Decimal, Duration, Instant};

/// A decision loop that is later than this is no loop any more: PX4 has left OFFBOARD by then
/// (`COM_OF_LOSS_T` 1 s), and an aircraft at 20 m/s has flown a whole cell unwatched.
const LATE: Duration = Duration::from_secs(1);
const TELEMETRY_PERIOD: Duration = Duration::from_secs(1);

/// A state with what belongs to it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Phase {
    Boot,
    Idle,
    Waiting(Wait),
    Engaged(Flight),
    Homing(Flight, ReturnReason),
    Done { landed: bool },
    Passive,
    Fault(Fault, HandBack),
    Shadow(ShadowWatch),
}

/// The mission machine. About ten kilobytes, no heap.
#[derive(Clone, Debug)]
pub struct Machine {
    pub(crate) mission: Mission,
    pub(crate) guard: Guard,
    pub(crate) phase: Phase,
    pub(crate) collected: f32,
    pub(crate) sequence: u32,
    self_test_passed: bool,
    decision: Option<Decision>,
    polled_at: Option<Instant>,
    told_at: Option<Instant>,
    w_data: Option<f32>,
    preference_changes: u32,
    spent: BatteryUnits,
}

impl Machine {
    /// A machine in [`State::Boot`].
    ///
    /// # Errors
    /// The mission cannot be flown.
    pub fn new(mission: Mission, self_test_passed: bool) -> Result<Machine, MissionError> {
        let mut machine = Machine::grounded();
        machine.load(&mission, self_test_passed)?;
        Ok(machine)
    }

    /// A machine in [`State::Boot`] that has no mission and whose self-test counts as failed.
    pub(crate) const fn grounded() -> Machine {
        Machine {
            mission: Mission::nowhere(),
            guard: Guard::closed(),
            phase: Phase::Boot,
            collected: 0.0,
            sequence: 0,
            self_test_passed: false,
            decision: None,
            polled_at: None,
            told_at: None,
            w_data: None,
            preference_changes: 0,
            spent: BatteryUnits(0.0),
        }
    }

    /// Gives a machine that was not polled yet its mission, in place.
    ///
    /// # Errors
    /// The mission cannot be flown; nothing changes.
    pub(crate) fn load(&mut self, mission: &Mission, self_test_passed: bool) -> Result<(), MissionError> {
        mission.check()?;
        self.guard.enclose(&mission.fence, mission.terminal).map_err(MissionError::Guard)?;
        self.mission.clone_from(mission);
        self.self_test_passed = self_test_passed;
        Ok(())
    }

    /// One step. Call at 20 Hz or more.
    ///
    /// # Cost
    /// One inference when a decision is due, else a few hundred operations.
    pub fn poll<P: Policy>(&mut self, now: Instant, inputs: &Inputs<'_>, policy: &mut P) -> Outputs {
        let mut out = Outputs::default();
        let late = self.polled_at.is_some_and(|at| now.since(at) > LATE);
        self.polled_at = Some(now);
        // The parameter's range is within what the guard accepts.
        let _ = self.guard.set_reserve(inputs.parameters.reserve());
        self.collected = collected(&self.mission, inputs.devices);
        self.watch_preference(inputs, &mut out);

        let before = (self.state(), self.landed());
        let mut phase = core::mem::replace(&mut self.phase, Phase::Passive);
        if let Phase::Boot = phase {
            phase = match self.self_test_passed {
                true => Phase::Idle,
                false => Phase::Fault(Fault::SelfTest, HandBack::nothing()),
            };
        }
        if let Some(request) = inputs.request {
            phase = self.answer(phase, request, inputs, &mut out);
        }
        self.phase = match phase {
            Phase::Boot | Phase::Idle => Phase::Idle,
            Phase::Waiting(wait) => self.wait(now, wait, inputs, &mut out),
            Phase::Engaged(flight) => self.engaged(now, flight, late, inputs, policy, &mut out),
            Phase::Homing(flight, reason) => self.homing(now, flight, reason, late, inputs, &mut out),
            Phase::Done { landed } => done(landed, inputs.vehicle),
            Phase::Passive => Phase::Passive,
            Phase::Fault(fault, hand_back) => hand_back.step(now, fault, inputs, &mut out),
            Phase::Shadow(watch) => self.shadow(now, watch, inputs, policy, &mut out),
        };
        self.send_target(now, inputs.vehicle, &mut out);
        self.announce(before, &mut out);
        self.tell(now, inputs, &mut out);
        out
    }

    /// What the pilot is doing.
    #[must_use]
    pub const fn state(&self) -> State {
        match self.phase {
            Phase::Boot => State::Boot,
            Phase::Idle => State::Idle,
            Phase::Waiting(_) => State::Waiting,
            Phase::Engaged(_) => State::Engaged,
            Phase::Homing(..) => State::Homing,
            Phase::Done { .. } => State::Done,
            Phase::Passive => State::Passive,
            Phase::Fault(..) => State::Fault,
            Phase::Shadow(_) => State::Shadow,
        }
    }

    /// `MAV_STATE` for the heartbeat.
    #[must_use]
    pub const fn system_state(&self) -> SystemState {
        match self.phase {
            Phase::Boot => SystemState::Boot,
            Phase::Idle | Phase::Waiting(_) | Phase::Passive | Phase::Done { landed: true } => {
                SystemState::Standby
            }
            Phase::Engaged(_) | Phase::Homing(..) | Phase::Shadow(_) | Phase::Done { landed: false } => {
                SystemState::Active
            }
            Phase::Fault(..) => SystemState::Critical,
        }
    }

    /// Whether a request to engage can succeed at all.
    #[must_use]
    pub const fn may_engage(&self) -> bool {
        self.self_test_passed
    }

    /// The last decision.
    #[must_use]
    pub const fn decision(&self) -> Option<&Decision> {
        self.decision.as_ref()
    }

    /// The mission that is flown.
    #[must_use]
    pub const fn mission(&self) -> &Mission {
        &self.mission
    }

    /// Decisions since boot, of policy, guard and shadow.
    #[must_use]
    pub const fn decisions(&self) -> u32 {
        self.sequence
    }

    /// Battery units paid since the mission was engaged.
    #[must_use]
    pub const fn spent(&self) -> BatteryUnits {
        self.spent
    }

    /// Fraction of the initial data that is known to be collected.
    #[must_use]
    pub const fn collected(&self) -> f32 {
        self.collected
    }

    /// Changes of the preference since boot.
    #[must_use]
    pub const fn preference_changes(&self) -> u32 {
        self.preference_changes
    }

    /// The cell that the current leg leads to.
    #[must_use]
    pub const fn target(&self) -> Option<Cell> {
        match &self.phase {
            Phase::Engaged(flight) | Phase::Homing(flight, _) => Some(flight.leg.cell),
            _ => None,
        }
    }

    /// What is still missing before the mission can be engaged.
    #[must_use]
    pub const fn missing(&self) -> Option<crate::Missing> {
        match &self.phase {
            Phase::Waiting(wait) => wait.missing(),
            _ => None,
        }
    }

    /// Why the pilot flies home.
    #[must_use]
    pub const fn return_reason(&self) -> Option<ReturnReason> {
        match self.phase {
            Phase::Homing(_, reason) => Some(reason),
            _ => None,
        }
    }

    /// Why the pilot gave up.
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        match self.phase {
            Phase::Fault(fault, _) => Some(fault),
            _ => None,
        }
    }

    /// Whether the mission ended with the aircraft on the ground.
    #[must_use]
    pub const fn landed(&self) -> bool {
        matches!(self.phase, Phase::Done { landed: true })
    }

    /// The operator's word comes before everything but the self-test.
    fn answer(&self, phase: Phase, request: Request, inputs: &Inputs<'_>, out: &mut Outputs) -> Phase {
        match (request, phase) {
            (_, Phase::Fault(Fault::SelfTest, none)) => {
                out.say(Severity::Critical, format_args!("gleaner: refused, self-test failed"));
                Phase::Fault(Fault::SelfTest, none)
            }
            (Request::Off, Phase::Engaged(_) | Phase::Homing(..)) => {
                // ArduCopter hovers at the last target until its battery is empty: someone must take it.
                out.say(Severity::Warning, format_args!("gleaner: off in flight, take over now"));
                Phase::Idle
            }
            (Request::Off, Phase::Fault(_, hand_back)) if hand_back.is_pending() => {
                out.say(Severity::Warning, format_args!("gleaner: off in flight, take over now"));
                Phase::Idle
            }
            (Request::Off, _) => Phase::Idle,
            (Request::Engage, flying @ (Phase::Engaged(_) | Phase::Homing(..))) => flying,
            (Request::Engage, _) => Phase::Waiting(Wait::new(inputs.vehicle)),
            (Request::Shadow, _) => Phase::Shadow(ShadowWatch::default()),
            (Request::Return, Phase::Engaged(flight)) => flight.go_home(ReturnReason::Request),
            (Request::Return, flying @ Phase::Homing(..)) => flying,
            (Request::Return, other) => {
                out.say(Severity::Warning, format_args!("gleaner: return refused, not engaged"));
                other
            }
        }
    }

    /// The one place where targets leave.
    fn send_target(&mut self, now: Instant, vehicle: &Vehicle, out: &mut Outputs) {
        let Some(firmware) = vehicle.firmware else { return };
        out.setpoint = match &mut self.phase {
            Phase::Engaged(flight) | Phase::Homing(flight, _) => flight.target_due(now, firmware),
            // PX4 accepts OFFBOARD only when targets already stream; ArduPilot needs none.
            Phase::Waiting(wait) if firmware == Firmware::Px4 => wait.target_due(now, vehicle),
            _ => None,
        };
    }

    fn watch_preference(&mut self, inputs: &Inputs<'_>, out: &mut Outputs) {
        let w_data = inputs.parameters.data_weight();
        if self.w_data.is_some_and(|last| last != w_data) {
            self.preference_changes = self.preference_changes.saturating_add(1);
            out.say(
                Severity::Info,
                format_args!("gleaner: preference w_data {}, next decision", Decimal::<2>(w_data)),
            );
        }
        self.w_data = Some(w_data);
    }

    /// Keeps a decision and counts it; the caller acts on it.
    pub(crate) fn keep(&mut self, decision: Decision, out: &mut Outputs) {
        self.sequence = self.sequence.wrapping_add(1);
        out.decided = true;
        self.decision = Some(decision);
    }

    fn announce(&mut self, (before, landed_before): (State, bool), out: &mut Outputs) {
        match &self.phase {
            Phase::Engaged(flight) | Phase::Homing(flight, _) => self.spent = flight.spent(),
            _ => {}
        }
        let state = self.state();
        if (state, self.landed()) == (before, landed_before) {
            return;
        }
        let flies = matches!(state, State::Engaged | State::Homing);
        out.withdraw |= !flies && (before.commands() || before == State::Fault);
        let percent = Decimal::<0>(self.collected * 100.0);
        match &self.phase {
            Phase::Boot => {}
            Phase::Idle => out.say(Severity::Info, format_args!("gleaner: idle")),
            Phase::Waiting(_) => out.say(Severity::Info, format_args!("gleaner: engage requested")),
            Phase::Engaged(flight) => {
                out.say(Severity::Notice, format_args!("gleaner: engaged at {}", flight.leg.cell))
            }
            Phase::Homing(_, reason @ (ReturnReason::Terminal | ReturnReason::Request)) => {
                out.say(Severity::Notice, format_args!("gleaner: {}", reason.text()));
            }
            Phase::Homing(_, reason) => {
                out.say(Severity::Warning, format_args!("gleaner: going home: {}", reason.text()));
            }
            Phase::Done { landed: false } => {
                out.say(Severity::Notice, format_args!("gleaner: landing, {percent} % collected"))
            }
            Phase::Done { landed: true } => {
                out.say(Severity::Notice, format_args!("gleaner: landed, {percent} % collected"))
            }
            Phase::Passive => {
                out.say(Severity::Warning, format_args!("gleaner: passive, someone else has control"))
            }
            Phase::Fault(fault, _) => {
                out.say(Severity::Critical, format_args!("gleaner: fault: {}", fault.text()))
            }
            Phase::Shadow(_) => {
                out.say(Severity::Notice, format_args!("gleaner: shadow, commanding nothing"))
            }
        }
    }

    fn tell(&mut self, now: Instant, inputs: &Inputs<'_>, out: &mut Outputs) {
        if self.told_at.is_some_and(|at| now.since(at) < TELEMETRY_PERIOD) {
            return;
        }
        self.told_at = Some(now);
        let spare = match &self.phase {
            Phase::Engaged(flight) | Phase::Homing(flight, _) => {
                self.guard.spare(flight.leg.cell, flight.battery(inputs))
            }
            Phase::Shadow(_) => self.decision.as_ref().map(|decision| decision.spare),
            _ => None,
        };
        out.telemetry = Some(Telemetry {
            w_data: inputs.parameters.data_weight(),
            collected: self.collected,
            spare,
            attended: self.decision.as_ref().and_then(|decision| decision.attended),
        });
    }
}

/// Watches our own landing; the human pilot may still take over.
fn done(landed: bool, vehicle: &Vehicle) -> Phase {
    if landed || !vehicle.armed || vehicle.on_ground {
        Phase::Done { landed: true }
    } else if vehicle.is_taken() && !vehicle.is_landing_or_returning() {
        Phase::Passive
    } else {
        Phase::Done { landed: false }
    }
}

/// The preference as the operator has set it now.
pub(crate) fn preference(parameters: &Parameters) -> Preference {
    // The parameter's range is the preference's.
    Preference::new(parameters.data_weight()).unwrap_or(Preference::ENERGY)
}

/// 1 - remaining / initial, both over all devices; 0 for a mission without data.
fn collected(mission: &Mission, devices: &[DeviceState]) -> f32 {
    let initial = mission.initial_data();
    let remaining: f32 = devices.iter().map(|device| device.remaining).sum();
    if initial > 0.0 { (1.0 - remaining / initial).clamp(0.0, 1.0) } else { 0.0 }
}
