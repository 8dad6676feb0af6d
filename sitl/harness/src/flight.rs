//! A whole mission: the scripted operator, the simulation, and the pilot between them.

use crate::aboard::Aboard;
use crate::autopilot::CopterMode;
use crate::mission::{PlanError, Staged};
use crate::operator::{Operator, Orders, Switch};
use crate::referee::Violation;
use crate::simulation::Simulation;
use crate::wires::WireFault;
use gleaner_pilot::{Onboard, OnboardError, Parameters, Settings, State};
use gleaner_policy::{Policy, SelfTestError};
use gleaner_units::{BatteryUnits, Duration, Instant};
use gleaner_world::ScenarioKind;
use std::fmt;
use thiserror::Error;

/// What the operator wants of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Wishes {
    /// Weight of data at the start.
    pub preference: f32,
    /// Changes in flight, in order of time.
    pub switches: Vec<Switch>,
    /// What happens to the aircraft, in order of time.
    pub incidents: Vec<Incident>,
}

impl Wishes {
    /// One preference from beginning to end, and nothing happens.
    #[must_use]
    pub const fn plain(preference: f32) -> Wishes {
        Wishes { preference, switches: Vec::new(), incidents: Vec::new() }
    }
}

/// Something that happens to the aircraft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// After the first decision.
    pub after: Duration,
    /// What.
    pub kind: IncidentKind,
}

/// The kinds of incidents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IncidentKind {
    /// The human pilot turns the mode switch.
    PilotSelects(CopterMode),
    /// A circular fence of the autopilot around home is switched on, radius in metres.
    Fence(f32),
    /// The pack's voltage drops to this, volts.
    Voltage(f32),
    /// The pack loses charge.
    LosesBattery(BatteryUnits),
    /// The autopilot's supply fails for a moment.
    AutopilotReboots,
    /// The autopilot's estimator mistrusts itself for so long.
    EstimatorFails(Duration),
    /// Something is wrong with a wire for so long.
    Wire(WireFault, Duration),
}

impl IncidentKind {
    /// What happens, in two words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            IncidentKind::PilotSelects(_) => "pilot takes over",
            IncidentKind::Fence(_) => "fence",
            IncidentKind::Voltage(_) => "low voltage",
            IncidentKind::LosesBattery(_) => "charge lost",
            IncidentKind::AutopilotReboots => "autopilot reboots",
            IncidentKind::EstimatorFails(_) => "estimator fails",
            IncidentKind::Wire(WireFault::RadioSilent, _) => "radio silent",
            IncidentKind::Wire(WireFault::LineCut, _) => "line cut",
            IncidentKind::Wire(WireFault::LineNoise(_), _) => "line noise",
        }
    }

    /// Battery units that it takes beyond what the decisions pay: a reserve that covers them brings the aircraft home.
    pub(crate) const fn takes(&self) -> BatteryUnits {
        match self {
            IncidentKind::LosesBattery(units) => *units,
            // Some slots of waiting, and back to the start from the far end of RD.
            IncidentKind::Fence(_) | IncidentKind::Wire(WireFault::LineCut | WireFault::LineNoise(_), _) => {
                BatteryUnits(38.0)
            }
            _ => BatteryUnits(0.0),
        }
    }
}

impl fmt::Display for IncidentKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            IncidentKind::PilotSelects(mode) => write!(f, "the pilot selects {}", mode.name()),
            IncidentKind::Fence(radius_m) => write!(f, "a fence of {radius_m} m around home is switched on"),
            IncidentKind::Voltage(volts) => write!(f, "the voltage drops to {volts} V"),
            IncidentKind::LosesBattery(units) => write!(f, "the pack loses {} battery units", units.0),
            IncidentKind::AutopilotReboots => write!(f, "the autopilot reboots"),
            IncidentKind::EstimatorFails(lasts) => {
                write!(f, "the estimator mistrusts itself for {:.1} s", lasts.as_secs_f32())
            }
            IncidentKind::Wire(fault, lasts) => write!(f, "{fault} for {:.0} s", lasts.as_secs_f32()),
        }
    }
}

/// Why a flight could not be flown at all.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FlightError {
    /// The mission cannot be laid out.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// The pilot refuses its mission or settings.
    #[error("{0}")]
    Onboard(OnboardError),
}

/// How a flight ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Disarmed on the ground after the mission.
    OnTheGround,
    /// Somebody else has the aircraft, and the pilot leaves it to them.
    TakenOver,
    /// The pilot was never engaged.
    NeverEngaged,
    /// The time is up.
    TimeUp,
    /// The pilot's computer is gone: its port is closed.
    PilotGone,
}

/// A flight that is over.
#[derive(Debug)]
pub struct Flown {
    /// Everything around the pilot, as it was at the end.
    pub simulation: Simulation,
    /// What was wished for.
    pub wishes: Wishes,
    /// How it ended.
    pub ending: Ending,
    /// What the pilot was doing at the end; `None` where it can only be heard.
    pub state: Option<State>,
    /// Changes of the preference that were confirmed.
    pub switches: usize,
    /// When the first decision was made, since the autopilot's boot.
    pub engaged_at: Option<Instant>,
    /// What was said to the operator.
    pub texts: Vec<(Instant, String)>,
    /// What the operator waited for at the end.
    pub waiting_for: String,
}

/// The figures of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// RD or RB.
    pub scenario: ScenarioKind,
    /// Names the realization.
    pub seed: u64,
    /// Weight of data at the start.
    pub preference: f32,
    /// How many devices.
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
    /// What a simulation has come to, under the preference that it began with.
    #[must_use]
    pub fn of(simulation: &Simulation, preference: f32, switches: usize) -> Figures {
        let (plan, referee) = (&simulation.staged().plan, simulation.referee());
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

    /// Landed, and no rule was broken.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.landed && self.violations.is_empty()
    }
}

/// One step of a flight: the rate of the physics, at which a pilot in this process is polled too.
pub const STEP: Duration = Duration::from_millis(20);
/// Estimator, climb and two heartbeats take under a minute.
const ENGAGE_LIMIT: Duration = Duration::from_secs(180);
/// After the motors have stopped, for the pilot to say so.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Long enough to see whether a passive pilot stays passive.
const TAKEN_LIMIT: Duration = Duration::from_secs(60);
/// 500 battery units of hovering take 2000 s.
const FLIGHT_LIMIT: Duration = Duration::from_secs(4000);

/// A mission on its way: the simulation, the operator and whatever happens to the aircraft, one step at a time.
#[derive(Debug)]
pub struct Flight {
    simulation: Simulation,
    operator: Operator,
    wishes: Wishes,
    incidents_done: usize,
    watch: Watch,
    now: Instant,
}

impl Flight {
    /// Everything at the autopilot's boot, for a pilot that is the component `component_id` of the vehicle.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn new(staged: Staged, wishes: Wishes, component_id: u8) -> Result<Flight, PlanError> {
        let mut parameters = staged.parameters();
        parameters.push(("GLN_W_DATA", wishes.preference));
        let operator = Operator::new(Orders {
            station_id: 255,
            system_id: staged.copter.system_id,
            component_id,
            parameters,
            altitude_m: staged.altitude_m(),
            engage: true,
            switches: wishes.switches.clone(),
        });
        let simulation = Simulation::new(staged)?;
        let watch = Watch::default();
        Ok(Flight { simulation, operator, wishes, incidents_done: 0, watch, now: Instant::ZERO })
    }

    /// Lets [`STEP`] of the aircraft's life pass, with `pilot` on board; how the flight ended, once it has.
    pub fn step(&mut self, pilot: &mut impl Aboard) -> Option<Ending> {
        let now = self.now + STEP;
        self.now = now;
        let simulation = &mut self.simulation;
        simulation.step(now);
        for frame in simulation.to_ground() {
            self.operator.receive(now, &frame);
        }
        for frame in self.operator.poll(now) {
            simulation.hear_ground(&frame);
        }
        simulation.crew(&[]);
        pilot.exchange(simulation, now);
        self.let_happen(now);
        self.watch.ending(&self.simulation, &self.operator)
    }

    fn let_happen(&mut self, now: Instant) {
        let Some(engaged_at) = self.operator.engaged_at() else { return };
        while let Some(incident) = self.wishes.incidents.get(self.incidents_done)
            && now >= engaged_at + incident.after
        {
            self.incidents_done += 1;
            happen(&mut self.simulation, incident.kind);
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

    /// The flight is over; `state` is what the pilot says of itself, where it can be asked.
    #[must_use]
    pub fn end(self, ending: Ending, state: Option<State>) -> Flown {
        Flown {
            state,
            switches: self.operator.switched(),
            engaged_at: self.operator.engaged_at(),
            texts: self.operator.texts().to_vec(),
            waiting_for: self.operator.waiting_for(),
            simulation: self.simulation,
            wishes: self.wishes,
            ending,
        }
    }
}

/// Flies a mission from boot to landing, in virtual time. `self_test` is the result of the policy's self-test.
///
/// # Errors
/// See [`FlightError`]. A flight that goes wrong is no error: see [`Flown::figures`].
///
/// # Cost
/// A few thousand polls per minute of flight, under a millisecond of work each second; one inference per decision.
pub fn fly<P: Policy>(
    staged: Staged,
    wishes: Wishes,
    policy: P,
    self_test: Result<(), SelfTestError>,
) -> Result<Flown, FlightError> {
    let settings = Settings::default();
    let onboard = Onboard::new(staged.mission.clone(), Parameters::default(), settings, policy, self_test);
    let mut onboard = onboard.map_err(FlightError::Onboard)?;
    let mut flight = Flight::new(staged, wishes, settings.component_id)?;
    loop {
        if let Some(ending) = flight.step(&mut onboard) {
            return Ok(flight.end(ending, Some(onboard.state())));
        }
    }
}

fn happen(simulation: &mut Simulation, kind: IncidentKind) {
    let copter = simulation.copter_mut();
    match kind {
        IncidentKind::Wire(fault, lasts) => simulation.fail_wire(fault, lasts),
        IncidentKind::PilotSelects(mode) => copter.pilot_selects(mode),
        IncidentKind::Voltage(volts) => copter.set_voltage(volts),
        IncidentKind::LosesBattery(units) => copter.lose_battery(units),
        IncidentKind::AutopilotReboots => copter.reboot(),
        IncidentKind::EstimatorFails(lasts) => copter.estimator_fails(lasts),
        IncidentKind::Fence(radius_m) => {
            for (name, value) in [("FENCE_TYPE", 2.0), ("FENCE_RADIUS", radius_m), ("FENCE_ENABLE", 1.0)] {
                copter.set_parameter(name, value);
            }
        }
    }
}

/// Looks for the end.
#[derive(Debug, Default)]
struct Watch {
    taken_since: Option<Instant>,
    grounded_since: Option<Instant>,
}

impl Watch {
    fn ending(&mut self, simulation: &Simulation, operator: &Operator) -> Option<Ending> {
        let (now, truth) = (simulation.now(), simulation.truth());
        let Some(engaged_at) = operator.engaged_at() else {
            return (now - Instant::ZERO > ENGAGE_LIMIT).then_some(Ending::NeverEngaged);
        };
        let since = |yes: bool, since: Option<Instant>| if yes { since.or(Some(now)) } else { None };
        let ours = matches!(truth.mode, CopterMode::Guided | CopterMode::Land | CopterMode::Rtl);
        self.taken_since = since(!ours, self.taken_since);
        self.grounded_since = since(truth.on_ground && !truth.armed, self.grounded_since);
        let longer = |since: Option<Instant>, limit: Duration| since.is_some_and(|since| now - since > limit);
        if longer(self.grounded_since, LAST_WORDS) {
            Some(Ending::OnTheGround)
        } else if longer(self.taken_since, TAKEN_LIMIT) {
            Some(Ending::TakenOver)
        } else {
            (now - engaged_at > FLIGHT_LIMIT).then_some(Ending::TimeUp)
        }
    }
}

impl Flown {
    /// The figures of this flight.
    #[must_use]
    pub fn figures(&self) -> Figures {
        Figures::of(&self.simulation, self.wishes.preference, self.switches)
    }
}
