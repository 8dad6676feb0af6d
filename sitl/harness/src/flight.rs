//! A whole mission in virtual time: the scripted operator, the simulation, and the pilot between them.

use crate::autopilot::CopterMode;
use crate::mission::{PlanError, Staged};
use crate::operator::{Operator, Orders, Switch};
use crate::referee::Violation;
use crate::simulation::Simulation;
use gleaner_pilot::{Onboard, OnboardError, Parameters, Settings, State};
use gleaner_policy::{Policy, SelfTestError};
use gleaner_units::{BatteryUnits, Duration, Instant};
use gleaner_world::ScenarioKind;
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
    /// What the pilot was doing at the end.
    pub state: State,
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

/// The pilot is polled at 50 Hz: the rate of the physics.
const STEP: Duration = Duration::from_millis(20);
/// Estimator, climb and two heartbeats take under a minute.
const ENGAGE_LIMIT: Duration = Duration::from_secs(180);
/// After the motors have stopped, for the pilot to say so.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Long enough to see whether a passive pilot stays passive.
const TAKEN_LIMIT: Duration = Duration::from_secs(60);
/// 500 battery units of hovering take 2000 s.
const FLIGHT_LIMIT: Duration = Duration::from_secs(4000);

/// Flies a mission from boot to landing. `self_test` is the result of the policy's self-test.
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
    let mut parameters = staged.parameters();
    parameters.push(("GLN_W_DATA", wishes.preference));
    let mut operator = Operator::new(Orders {
        station_id: 255,
        system_id: staged.copter.system_id,
        component_id: settings.component_id,
        parameters,
        altitude_m: staged.altitude_m(),
        engage: true,
        switches: wishes.switches.clone(),
    });
    let mut simulation = Simulation::new(staged)?;
    let mut incidents = wishes.incidents.iter().peekable();
    let mut watch = Watch::default();
    let mut now = Instant::ZERO;
    let ending = loop {
        now = now + STEP;
        simulation.step(now);
        for frame in simulation.to_ground() {
            operator.receive(now, &frame);
        }
        for frame in operator.poll(now) {
            simulation.hear_ground(&frame);
        }
        simulation.crew(&[]);
        exchange(&mut simulation, &mut onboard, now);
        if let Some(engaged_at) = operator.engaged_at() {
            while let Some(incident) = incidents.next_if(|incident| now >= engaged_at + incident.after) {
                happen(&mut simulation, incident.kind);
            }
        }
        if let Some(ending) = watch.ending(&simulation, &operator) {
            break ending;
        }
    };
    Ok(Flown {
        state: onboard.state(),
        switches: operator.switched(),
        engaged_at: operator.engaged_at(),
        texts: operator.texts().to_vec(),
        waiting_for: operator.waiting_for(),
        simulation,
        wishes,
        ending,
    })
}

/// One poll of the pilot with everything that is due.
pub(crate) fn exchange<P: Policy>(simulation: &mut Simulation, onboard: &mut Onboard<P>, now: Instant) {
    for frame in simulation.to_companion() {
        onboard.receive_link(now, &frame);
    }
    onboard.receive_radio(now, &simulation.radio());
    onboard.poll(now);
    let mut buffer = [0; 512];
    loop {
        let length = onboard.transmit(&mut buffer);
        if length == 0 {
            break;
        }
        simulation.hear_companion(&buffer[..length]);
    }
}

fn happen(simulation: &mut Simulation, kind: IncidentKind) {
    let copter = simulation.copter_mut();
    match kind {
        IncidentKind::PilotSelects(mode) => copter.pilot_selects(mode),
        IncidentKind::Voltage(volts) => copter.set_voltage(volts),
        IncidentKind::LosesBattery(units) => copter.lose_battery(units),
        IncidentKind::Fence(radius_m) => {
            for (name, value) in [("FENCE_TYPE", 2.0), ("FENCE_RADIUS", radius_m), ("FENCE_ENABLE", 1.0)] {
                copter.set_parameter(name, value);
            }
        }
    }
}

/// Looks for the end.
#[derive(Default)]
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
