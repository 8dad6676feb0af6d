//! A whole mission: the scripted operator, the simulation, and the companion computer between them.

use crate::autopilot::VehicleMode;
use crate::companion::{Companion, Computer};
use crate::operator::{Operator, Orders};
use crate::referee::Violation;
use crate::script::{FlightScript, IncidentKind};
use crate::setup::{MissionSetup, PlanError};
use crate::simulation::Simulation;
use gleaner_pilot::{Deliberator, OnboardError, Settings, State};
use gleaner_policy::SelfTestError;
use gleaner_units::{BatteryUnits, Duration, Instant};
use gleaner_world::ScenarioKind;
use thiserror::Error;

/// Why a flight cannot begin.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FlightError {
    /// The mission cannot be simulated.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// The pilot refuses its mission or settings.
    #[error("{0}")]
    Onboard(OnboardError),
}

/// How a flight ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Disarmed on the ground.
    OnTheGround,
    /// A human pilot or another program flies the aircraft, and the pilot stays passive.
    TakenOver,
    /// The pilot was never engaged.
    NeverEngaged,
    /// The time limit was reached.
    TimeUp,
    /// The port of the companion computer is closed.
    PilotGone,
}

/// A flight that is over.
#[derive(Debug)]
pub struct FlightResult {
    /// Everything around the pilot, as it was at the end.
    pub simulation: Simulation,
    /// The script.
    pub script: FlightScript,
    /// How it ended.
    pub ending: Ending,
    /// The pilot's state at the end; `None` where it cannot be read.
    pub state: Option<State>,
    /// Changes of the preference that were confirmed.
    pub switches: usize,
    /// Time of the first decision, since the autopilot's boot.
    pub engaged_at: Option<Instant>,
    /// Texts that the operator received.
    pub texts: Vec<(Instant, String)>,
    /// What the operator waited for at the end.
    pub waiting_for: String,
}

/// The figures of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// RD or RB.
    pub scenario: ScenarioKind,
    /// Seed of the realization.
    pub seed: u64,
    /// Weight of data at the start.
    pub preference: f32,
    /// Number of devices.
    pub devices: usize,
    /// Fraction of the data collected.
    pub collected: f32,
    /// Battery units paid by the decisions.
    pub energy: BatteryUnits,
    /// Decisions flown.
    pub decisions: u32,
    /// Whether it landed on the terminal.
    pub landed: bool,
    /// Rules broken.
    pub violations: Vec<Violation>,
    /// Changes of the preference confirmed.
    pub switches: usize,
}

impl Figures {
    /// The figures of a simulation so far; `preference` is that at the start.
    #[must_use]
    pub fn of(simulation: &Simulation, preference: f32, switches: usize) -> Figures {
        let (plan, referee) = (&simulation.setup().plan, simulation.referee());
        Figures {
            scenario: plan.kind,
            seed: plan.seed,
            preference,
            devices: simulation.field().devices().len(),
            collected: simulation.field().collected_fraction(),
            energy: referee.energy(),
            decisions: referee.decisions(),
            landed: referee.landed(),
            violations: referee.violations().to_vec(),
            switches,
        }
    }

    /// Landed on the terminal without a broken rule.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.landed && self.violations.is_empty()
    }
}

/// One step of a flight: the rate of the physics, and of polling a pilot in this process.
pub const STEP: Duration = Duration::from_millis(20);
/// Estimator, climb and two heartbeats take less than a minute.
const ENGAGE_LIMIT: Duration = Duration::from_secs(180);
/// After disarming, for the pilot's last messages.
const LAST_MESSAGES: Duration = Duration::from_secs(2);
/// Long enough to see that a passive pilot stays passive.
const TAKEN_LIMIT: Duration = Duration::from_secs(60);
/// 500 battery units of hovering take 2000 s.
const FLIGHT_LIMIT: Duration = Duration::from_secs(4000);

/// A mission under way: simulation, operator and incidents, one step at a time.
#[derive(Debug)]
pub struct FlightRun {
    simulation: Simulation,
    operator: Operator,
    script: FlightScript,
    incidents_done: usize,
    watch: EndWatch,
    now: Instant,
}

impl FlightRun {
    /// Everything at the autopilot's boot, for a pilot that is the component `component_id` of the vehicle.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn new(setup: MissionSetup, script: FlightScript, component_id: u8) -> Result<FlightRun, PlanError> {
        let mut parameters = setup.parameters();
        parameters.push(("GLN_W_DATA", script.preference));
        let operator = Operator::new(Orders {
            station_id: 255,
            system_id: setup.aircraft.system_id,
            component_id,
            autopilot: setup.plan.autopilot,
            parameters,
            altitude_m: setup.altitude_m(),
            engage: true,
            switches: script.switches.clone(),
        });
        let simulation = Simulation::new(setup, component_id)?;
        let watch = EndWatch::default();
        Ok(FlightRun { simulation, operator, script, incidents_done: 0, watch, now: Instant::ZERO })
    }

    /// The same without a record of the flight.
    fn without_record(self) -> FlightRun {
        FlightRun { simulation: self.simulation.without_record(), ..self }
    }

    /// Advances the aircraft by [`STEP`] with `companion` on board. How the flight ended, once it has.
    pub fn step(&mut self, companion: &mut impl Companion) -> Option<Ending> {
        let now = self.now + STEP;
        self.now = now;
        let simulation = &mut self.simulation;
        simulation.step(now);
        for frame in simulation.to_ground() {
            self.operator.receive(now, &frame);
        }
        for frame in self.operator.poll(now) {
            simulation.from_ground(&frame);
        }
        simulation.crew(&[]);
        companion.exchange(simulation, now);
        self.inject(now, companion);
        self.watch.ending(&self.simulation, &self.operator)
    }

    fn inject(&mut self, now: Instant, companion: &mut impl Companion) {
        let Some(engaged_at) = self.operator.engaged_at() else { return };
        while let Some(incident) = self.script.incidents.get(self.incidents_done)
            && now >= engaged_at + incident.after
        {
            self.incidents_done += 1;
            match incident.kind {
                IncidentKind::Computer(fault) => companion.inject(&mut self.simulation, now, fault),
                kind => self.simulation.inject(kind),
            }
        }
    }

    /// Everything around the pilot.
    #[must_use]
    pub const fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The ground station.
    #[must_use]
    pub const fn operator(&self) -> &Operator {
        &self.operator
    }

    /// Ends the flight; `state` is the pilot's, where it can be read.
    #[must_use]
    pub fn end(self, ending: Ending, state: Option<State>) -> FlightResult {
        FlightResult {
            state,
            switches: self.operator.switched(),
            engaged_at: self.operator.engaged_at(),
            texts: self.operator.texts().to_vec(),
            waiting_for: self.operator.waiting_for(),
            simulation: self.simulation,
            script: self.script,
            ending,
        }
    }
}

/// Flies a mission from boot to landing, in virtual time. `self_test` is the result of the policy's self-test.
/// `GLN_LOOKAHEAD` starts at 1 if the policy looks ahead.
///
/// # Errors
/// See [`FlightError`]. A flight that goes wrong is no error: see [`FlightResult::figures`].
///
/// # Cost
/// A few thousand polls per minute of flight, under a millisecond of work each second; one inference per decision.
pub fn fly<P: Deliberator>(
    setup: MissionSetup,
    script: FlightScript,
    policy: P,
    self_test: Result<(), SelfTestError>,
) -> Result<FlightResult, FlightError> {
    let (flight, computer) = begin(setup, script, policy, self_test)?;
    Ok(run(flight, computer))
}

/// The same flight without its record, for sweeps. Everything but [`Simulation::journal`] is equal.
///
/// # Errors
/// See [`FlightError`].
pub fn fly_without_record<P: Deliberator>(
    setup: MissionSetup,
    script: FlightScript,
    policy: P,
    self_test: Result<(), SelfTestError>,
) -> Result<FlightResult, FlightError> {
    let (flight, computer) = begin(setup, script, policy, self_test)?;
    Ok(run(flight.without_record(), computer))
}

fn begin<P: Deliberator>(
    setup: MissionSetup,
    script: FlightScript,
    policy: P,
    self_test: Result<(), SelfTestError>,
) -> Result<(FlightRun, Computer<P>), FlightError> {
    let settings = Settings::default();
    let computer = Computer::new(setup.mission.clone(), settings, policy, self_test);
    let computer = computer.map_err(FlightError::Onboard)?;
    Ok((FlightRun::new(setup, script, settings.component_id)?, computer))
}

fn run<P: Deliberator>(mut flight: FlightRun, mut computer: Computer<P>) -> FlightResult {
    loop {
        if let Some(ending) = flight.step(&mut computer) {
            let state = computer.state();
            return flight.end(ending, state);
        }
    }
}

/// Detects the end of a flight.
#[derive(Debug, Default)]
struct EndWatch {
    taken_since: Option<Instant>,
    grounded_since: Option<Instant>,
}

impl EndWatch {
    fn ending(&mut self, simulation: &Simulation, operator: &Operator) -> Option<Ending> {
        let (now, truth) = (simulation.now(), simulation.truth());
        let Some(engaged_at) = operator.engaged_at() else {
            return (now - Instant::ZERO > ENGAGE_LIMIT).then_some(Ending::NeverEngaged);
        };
        let since = |yes: bool, since: Option<Instant>| if yes { since.or(Some(now)) } else { None };
        let lands = matches!(truth.mode, VehicleMode::Land | VehicleMode::Return);
        let flown_by_other =
            !lands && (truth.mode != VehicleMode::Guided || simulation.referee().is_revoked());
        self.taken_since = since(flown_by_other, self.taken_since);
        self.grounded_since = since(truth.on_ground && !truth.armed, self.grounded_since);
        let longer = |since: Option<Instant>, limit: Duration| since.is_some_and(|since| now - since > limit);
        if longer(self.grounded_since, LAST_MESSAGES) {
            Some(Ending::OnTheGround)
        } else if longer(self.taken_since, TAKEN_LIMIT) {
            Some(Ending::TakenOver)
        } else {
            (now - engaged_at > FLIGHT_LIMIT).then_some(Ending::TimeUp)
        }
    }
}

impl FlightResult {
    /// The figures of this flight.
    #[must_use]
    pub fn figures(&self) -> Figures {
        Figures::of(&self.simulation, self.script.preference, self.switches)
    }
}
