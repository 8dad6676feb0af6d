//! `poll(now, inputs) -> outputs`: the dispatch by state, and the only place that moves from state to state.

mod monitor;
mod phase;
mod report;
mod transition;

use self::monitor::Monitor;
use self::phase::Phase;
use crate::decide::{Decider, Decision, Deliberator};
use crate::flight::energy::Energy;
use crate::scene::Scene;
use crate::states::{Outcome, landing};
use crate::{Fault, Inputs, Missing, Mission, MissionError, Outputs, ReturnReason, State, TakeOver};
use gleaner_guard::Guard;
use gleaner_link::SystemState;
use gleaner_units::{BatteryUnits, Cell, Instant};

/// The mission machine. About ten kilobytes, no heap.
#[derive(Clone, Debug)]
pub struct Machine {
    mission: Mission,
    guard: Guard,
    self_test_passed: bool,
    phase: Phase,
    decider: Decider,
    energy: Energy,
    monitor: Monitor,
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
            self_test_passed: false,
            phase: Phase::Boot,
            decider: Decider::new(),
            energy: Energy::new(),
            monitor: Monitor::new(),
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

    /// Continues the budget of a mission that an earlier run of the program flew, in which it used `spent`. It counts until
    /// the motors are armed anew.
    pub fn resume_budget(&mut self, spent: BatteryUnits) {
        self.energy.resume(spent);
    }

    /// One step. Call at 20 Hz or more.
    ///
    /// # Cost
    /// One inference and, with look-ahead, one search when a decision is due, else a few hundred operations.
    pub fn poll<D: Deliberator>(&mut self, now: Instant, inputs: &Inputs<'_>, policy: &mut D) -> Outputs {
        let mut out = Outputs::default();
        let late = self.monitor.keep_time(now);
        // The parameter's range is within what the guard accepts.
        let _ = self.guard.set_reserve(inputs.parameters.reserve());
        if let Phase::Boot = self.phase {
            self.boot(&mut out);
        }
        self.monitor.watch(now, inputs, self.flight_down_m(), &mut out);
        if self.monitor.armed_again(inputs.vehicle) {
            self.energy.begin_mission();
        }
        for &request in inputs.requests {
            self.answer(now, request, inputs, &mut out);
        }
        let outcome = self.step(now, late, inputs, policy, &mut out);
        self.apply(now, outcome, inputs, &mut out);
        self.send_target(now, inputs, &mut out);
        let channel = policy.channel().filter(|_| self.decider.has_begun());
        let snr_off = channel.map(|channel| channel.gain_db[1]);
        self.report(now, inputs, snr_off, &mut out);
        out
    }

    /// Lets the current state look at the scene.
    fn step<D: Deliberator>(
        &mut self,
        now: Instant,
        late: bool,
        inputs: &Inputs<'_>,
        policy: &mut D,
        out: &mut Outputs,
    ) -> Outcome {
        let Machine { mission, guard, phase, decider, energy, monitor, .. } = self;
        let scene = Scene {
            now,
            mission,
            guard,
            inputs,
            evidence_from: monitor.evidence_from(),
            late,
            pace: monitor.pace(),
        };
        match phase {
            Phase::Boot | Phase::Idle | Phase::Passive(_) => Outcome::Stay,
            Phase::Waiting(wait) => wait.step(&scene, energy, out),
            Phase::Flying(flight) => flight.step(&scene, energy, decider, policy, out),
            Phase::Done { landed } => landing::descend(&scene, *landed),
            Phase::Fault(_, hand_back) => hand_back.step(&scene, out),
            Phase::Shadow(shadow) => shadow.step(&scene, energy, decider, policy, out),
        }
    }

    /// The one place where targets leave.
    fn send_target(&mut self, now: Instant, inputs: &Inputs<'_>, out: &mut Outputs) {
        let Machine { mission, guard, phase, monitor, .. } = self;
        let evidence_from = monitor.evidence_from();
        let scene = Scene { now, mission, guard, inputs, evidence_from, late: false, pace: monitor.pace() };
        out.setpoint = match phase {
            Phase::Flying(flight) => flight.target_due(&scene),
            Phase::Waiting(wait) => wait.target_due(&scene),
            _ => None,
        };
    }

    /// What the pilot is doing.
    #[must_use]
    pub const fn state(&self) -> State {
        self.phase.state()
    }

    /// `MAV_STATE` for the heartbeat.
    #[must_use]
    pub const fn system_state(&self) -> SystemState {
        match self.phase {
            Phase::Boot => SystemState::Boot,
            Phase::Idle | Phase::Waiting(_) | Phase::Passive(_) | Phase::Done { landed: true } => {
                SystemState::Standby
            }
            Phase::Flying(_) | Phase::Shadow(_) | Phase::Done { landed: false } => SystemState::Active,
            Phase::Fault(..) => SystemState::Critical,
        }
    }

    /// Whether a request to engage can succeed at all.
    #[must_use]
    pub const fn may_engage(&self) -> bool {
        self.self_test_passed
    }

    /// Whether a request to return makes sense: the pilot flies.
    #[must_use]
    pub const fn may_return(&self) -> bool {
        self.state().flies()
    }

    /// Whether a fault left an aircraft that is not given back yet.
    #[must_use]
    pub const fn is_handing_back(&self) -> bool {
        matches!(&self.phase, Phase::Fault(_, hand_back) if hand_back.is_pending())
    }

    /// The last decision; `None` also when the policy failed since.
    #[must_use]
    pub const fn decision(&self) -> Option<&Decision> {
        self.decider.last()
    }

    /// The mission that is flown.
    #[must_use]
    pub const fn mission(&self) -> &Mission {
        &self.mission
    }

    /// Decisions since boot, of policy, guard and shadow.
    #[must_use]
    pub const fn decisions(&self) -> u32 {
        self.decider.count()
    }

    /// Battery units paid in this mission: since arming.
    #[must_use]
    pub const fn spent(&self) -> BatteryUnits {
        self.energy.spent()
    }

    /// Fraction of the initial data that is known to be collected, as of the last second.
    #[must_use]
    pub const fn collected(&self) -> f32 {
        self.monitor.collected()
    }

    /// Changes of the preference since boot.
    #[must_use]
    pub const fn preference_changes(&self) -> u32 {
        self.monitor.preference_changes()
    }

    /// The cell that the current leg leads to.
    #[must_use]
    pub const fn target(&self) -> Option<Cell> {
        match &self.phase {
            Phase::Flying(flight) => Some(flight.course.leg.cell),
            _ => None,
        }
    }

    /// What is still missing before the mission can be engaged.
    #[must_use]
    pub const fn missing(&self) -> Option<Missing> {
        match &self.phase {
            Phase::Waiting(wait) => wait.missing(),
            _ => None,
        }
    }

    /// Why the pilot flies home.
    #[must_use]
    pub const fn return_reason(&self) -> Option<ReturnReason> {
        match &self.phase {
            Phase::Flying(flight) => flight.homing,
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

    /// How someone else got the aircraft.
    #[must_use]
    pub const fn take_over(&self) -> Option<TakeOver> {
        match self.phase {
            Phase::Passive(take_over) => Some(take_over),
            _ => None,
        }
    }

    /// Whether the mission ended with the aircraft on the ground.
    #[must_use]
    pub const fn landed(&self) -> bool {
        matches!(self.phase, Phase::Done { landed: true })
    }

    const fn flight_down_m(&self) -> Option<f32> {
        match &self.phase {
            Phase::Flying(flight) => Some(flight.plan.down_m),
            _ => None,
        }
    }
}
