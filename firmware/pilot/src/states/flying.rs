//! Engaged and homing: the two states that move the aircraft, and how they give it back.

use crate::decide::decider::{Deliberation, ask};
use crate::flight::leg::{Leg, Progress, Purpose};
use crate::flight::plan::Plan;
use crate::flight::stream::Stream;
use crate::machine::{Phase, preference};
use crate::{Decision, Fault, Inputs, Machine, Outputs, ReturnReason, State};
use gleaner_link::{AutopilotCommand, Firmware, Parameters, Severity};
use gleaner_policy::Policy;
use gleaner_units::{Action, BatteryUnits, Cell, Duration, Instant, Metres, MetresPerSecond, Ned};

/// How long the estimator may mistrust itself before the position counts as lost.
const UNREADY: Duration = Duration::from_secs(2);
/// How often a command is begun that the link has already repeated three times.
const ATTEMPTS: u8 = 3;
/// Pause before the autopilot is asked again to take the aircraft back.
const ASK_AGAIN: Duration = Duration::from_secs(2);
/// And once that has failed some times.
const ASK_SELDOM: Duration = Duration::from_secs(10);
/// Legs in a row without progress after which there is nothing left to try.
const STALLS: u8 = 2;

/// A flight under our command.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Flight {
    plan: Plan,
    pub(crate) leg: Leg,
    stream: Stream,
    ready_at: Instant,
    stalls: u8,
    /// How often the landing was asked for.
    landing: Option<u8>,
    speed_asked: Option<MetresPerSecond>,
}

/// Why a flight ends at once.
enum Upset {
    /// A heartbeat shows a mode that we did not ask for.
    Taken,
    /// A heartbeat shows the landing that we asked for, or its end.
    Landing,
    Disarmed,
    Fault(Fault),
}

impl Flight {
    pub(crate) fn new(now: Instant, plan: Plan, stream: Stream) -> Flight {
        let centre = plan.frame.centre(plan.cell, plan.down_m);
        Flight {
            plan,
            leg: Leg::new(now, Purpose::Centre, plan.cell, plan.cell, centre),
            stream,
            ready_at: now,
            stalls: 0,
            landing: None,
            speed_asked: None,
        }
    }

    /// From now on the guard flies. The leg that is under way is finished first: its end is a cell that the
    /// guard allowed, with the way home paid for. A hover is cut short.
    pub(crate) fn go_home(mut self, reason: ReturnReason) -> Phase {
        self.leg.hurry();
        Phase::Homing(self, reason)
    }

    pub(crate) fn target_due(&mut self, now: Instant, firmware: Firmware) -> Option<Ned> {
        self.stream.due(now, self.leg.target, firmware)
    }

    pub(crate) fn battery(&self, inputs: &Inputs<'_>) -> BatteryUnits {
        self.plan.ledger.available(inputs.vehicle.battery_percent, inputs.parameters.full_battery())
    }

    pub(crate) const fn spent(&self) -> BatteryUnits {
        self.plan.ledger.spent()
    }

    /// Looks, without acting. The human pilot comes first: whatever else is wrong, a mode that we did not ask
    /// for means that nothing of ours may go out.
    fn judge(&mut self, now: Instant, late: bool, inputs: &Inputs<'_>) -> Result<Ned, Upset> {
        let vehicle = inputs.vehicle;
        if vehicle.ready {
            self.ready_at = now;
        }
        if vehicle.is_taken() || inputs.other_mode_seen {
            return Err(match self.landing {
                Some(_) if vehicle.is_landing_or_returning() => Upset::Landing,
                _ => Upset::Taken,
            });
        }
        if vehicle.mode.is_none() {
            return Err(Upset::Fault(Fault::AutopilotLost));
        }
        if !vehicle.armed {
            return Err(if self.landing.is_some() { Upset::Landing } else { Upset::Disarmed });
        }
        if late {
            return Err(Upset::Fault(Fault::Late));
        }
        match vehicle.position.filter(Ned::is_finite) {
            Some(position) if now.since(self.ready_at) <= UNREADY => Ok(position),
            _ => Err(Upset::Fault(Fault::PositionLost)),
        }
    }

    fn follow(&mut self, now: Instant, action: Action, slot: Duration) {
        let (from, to) = (self.leg.cell, self.leg.cell.after(action));
        let target = self.plan.frame.centre(to, self.plan.down_m);
        self.plan.ledger.pay(action);
        self.leg = match action {
            Action::Hover => Leg::new(now, Purpose::Hover, from, to, target).lasting(slot),
            _ => Leg::new(now, Purpose::Move, from, to, target),
        };
    }

    /// Turns back to the cell under the aircraft, when the target cannot be reached.
    fn turn_back(&mut self, now: Instant, position: &Ned, may_be: impl Fn(Cell) -> bool) {
        let here = self.plan.frame.cell(position).filter(|&cell| may_be(cell)).unwrap_or(self.leg.from);
        let target = self.plan.frame.centre(here, self.plan.down_m);
        self.leg = Leg::new(now, Purpose::Centre, here, here, target);
    }

    fn watch(&mut self, now: Instant, position: &Ned, parameters: &Parameters) -> Progress {
        // A radius beyond half a cell would let the aircraft arrive in one cell while it is in the next.
        let half_cell_m = self.plan.frame.grid().cell().0 / 2.0;
        let radius = Metres(parameters.arrive_radius().0.min(half_cell_m));
        let progress = self.leg.watch(now, position, radius);
        if progress == Progress::Arrived && self.leg.purpose == Purpose::Move {
            self.stalls = 0;
        }
        progress
    }

    /// `WPNAV_SPEED` has no effect on a guided leg that is under way, the command has. PX4 accepts it without
    /// effect in OFFBOARD, so it is not asked.
    fn keep_speed(&mut self, inputs: &Inputs<'_>, out: &mut Outputs) {
        let speed = inputs.parameters.speed();
        if inputs.vehicle.firmware == Some(Firmware::ArduPilot) && self.speed_asked != Some(speed) {
            self.speed_asked = Some(speed);
            out.command = Some(AutopilotCommand::ChangeSpeed(speed));
        }
        if inputs.ended.iter().any(|end| matches!(end, (AutopilotCommand::ChangeSpeed(_), false))) {
            out.say(Severity::Warning, format_args!("gleaner: speed not accepted by the autopilot"));
        }
    }
}

impl Machine {
    // This, `homing` and `shadow` each hold a decision of two kilobytes, but never at the same time: out of line, the
    // stack holds one of them, not three.
    #[inline(never)]
    pub(crate) fn engaged<P: Policy>(
        &mut self,
        now: Instant,
        mut flight: Flight,
        late: bool,
        inputs: &Inputs<'_>,
        policy: &mut P,
        out: &mut Outputs,
    ) -> Phase {
        let position = match flight.judge(now, late, inputs) {
            Ok(position) => position,
            Err(upset) => return give_up(now, &flight, upset, inputs, out),
        };
        flight.keep_speed(inputs, out);
        if inputs.vehicle.failsafe {
            return flight.go_home(ReturnReason::Failsafe);
        }
        match flight.watch(now, &position, inputs.parameters) {
            Progress::Underway => Phase::Engaged(flight),
            Progress::Arrived if flight.leg.purpose == Purpose::Move && self.is_terminal(&flight) => {
                land(flight, ReturnReason::Terminal, out)
            }
            Progress::Arrived => self.decide(now, flight, inputs, policy, out),
            Progress::Stalled => {
                flight.stalls = 1;
                flight.turn_back(now, &position, |cell| self.guard.distance(cell).is_some());
                flight.go_home(ReturnReason::NoProgress)
            }
        }
    }

    #[inline(never)]
    pub(crate) fn homing(
        &mut self,
        now: Instant,
        mut flight: Flight,
        reason: ReturnReason,
        late: bool,
        inputs: &Inputs<'_>,
        out: &mut Outputs,
    ) -> Phase {
        let position = match flight.judge(now, late, inputs) {
            Ok(position) => position,
            Err(upset) => return give_up(now, &flight, upset, inputs, out),
        };
        if flight.landing.is_some() {
            return landing(now, flight, reason, inputs, out);
        }
        flight.keep_speed(inputs, out);
        match flight.watch(now, &position, inputs.parameters) {
            Progress::Underway => Phase::Homing(flight, reason),
            Progress::Arrived if self.is_terminal(&flight) => land(flight, reason, out),
            Progress::Arrived => {
                let decision = self.deliberation(now, State::Homing, &flight, inputs).homeward();
                let Some(decision) = decision else {
                    return fault(now, &flight, Fault::NoWayHome, inputs, out);
                };
                self.follow(now, &mut flight, decision, inputs, out);
                Phase::Homing(flight, reason)
            }
            Progress::Stalled => {
                flight.stalls += 1;
                if flight.stalls >= STALLS {
                    return fault(now, &flight, Fault::NoProgress, inputs, out);
                }
                out.say(Severity::Warning, format_args!("gleaner: {}", ReturnReason::NoProgress.text()));
                Phase::Homing(flight, reason)
            }
        }
    }

    /// One decision of the policy, or the reason why the guard goes on alone.
    fn decide<P: Policy>(
        &mut self,
        now: Instant,
        mut flight: Flight,
        inputs: &Inputs<'_>,
        policy: &mut P,
        out: &mut Outputs,
    ) -> Phase {
        if !self.guard.is_feasible(flight.leg.cell, flight.battery(inputs)) {
            return flight.go_home(ReturnReason::Battery);
        }
        let mut decision = self.deliberation(now, State::Engaged, &flight, inputs).open();
        match ask(policy, &mut decision) {
            Err(reason) => flight.go_home(reason),
            Ok(()) => {
                self.follow(now, &mut flight, decision, inputs, out);
                Phase::Engaged(flight)
            }
        }
    }

    fn follow(
        &mut self,
        now: Instant,
        flight: &mut Flight,
        decision: Decision,
        inputs: &Inputs<'_>,
        out: &mut Outputs,
    ) {
        flight.follow(now, decision.action, slot(self.mission.grid().cell(), inputs.parameters));
        self.keep(decision, out);
    }

    fn deliberation<'a>(
        &'a self,
        now: Instant,
        state: State,
        flight: &Flight,
        inputs: &Inputs<'a>,
    ) -> Deliberation<'a> {
        Deliberation {
            mission: &self.mission,
            guard: &self.guard,
            devices: inputs.devices,
            preference: preference(inputs.parameters),
            collected: self.collected,
            sequence: self.sequence,
            now,
            state,
            cell: flight.leg.cell,
            battery: flight.battery(inputs),
            altitude: inputs.parameters.altitude(),
        }
    }

    fn is_terminal(&self, flight: &Flight) -> bool {
        flight.leg.cell == self.mission.terminal
    }
}

/// The time that a move takes.
pub(crate) fn slot(cell: Metres, parameters: &Parameters) -> Duration {
    Duration::from_secs_f32(cell.0 / parameters.speed().0)
}

fn land(mut flight: Flight, reason: ReturnReason, out: &mut Outputs) -> Phase {
    flight.landing = Some(1);
    out.command = Some(AutopilotCommand::Land);
    Phase::Homing(flight, reason)
}

/// Over the terminal, until the autopilot confirms that it lands. The target stays: on PX4 a silent stream
/// would be a failsafe.
fn landing(
    now: Instant,
    mut flight: Flight,
    reason: ReturnReason,
    inputs: &Inputs<'_>,
    out: &mut Outputs,
) -> Phase {
    let answer = |accepted| inputs.ended.contains(&(AutopilotCommand::Land, accepted));
    if answer(true) {
        return Phase::Done { landed: false };
    }
    if answer(false) {
        let attempts = flight.landing.unwrap_or(0);
        if attempts >= ATTEMPTS {
            return fault(now, &flight, Fault::LandingRefused, inputs, out);
        }
        flight.landing = Some(attempts + 1);
        out.command = Some(AutopilotCommand::Land);
    }
    Phase::Homing(flight, reason)
}

fn give_up(now: Instant, flight: &Flight, upset: Upset, inputs: &Inputs<'_>, out: &mut Outputs) -> Phase {
    match upset {
        Upset::Taken => Phase::Passive,
        Upset::Landing => Phase::Done { landed: !inputs.vehicle.armed },
        Upset::Disarmed => Phase::Idle,
        Upset::Fault(kind) => fault(now, flight, kind, inputs, out),
    }
}

fn fault(now: Instant, flight: &Flight, fault: Fault, inputs: &Inputs<'_>, out: &mut Outputs) -> Phase {
    let cell_m = flight.plan.frame.grid().cell().0;
    let left = Left { at: flight.leg.target, within_m: 1.5 * cell_m, unheard: false };
    HandBack { left: Some(left), ask_at: now, waiting: false, failures: 0 }.step(now, fault, inputs, out)
}

/// After a fault in flight: the aircraft is given back to the autopilot by a request to return to launch.
///
/// ArduCopter never forgets a position target: without this it would hover until its battery is empty. So the request
/// is repeated until it is accepted, however long the line is bad. PX4 returns by itself one second after the targets
/// stop. The request goes out only while heartbeats show that the aircraft is ours (armed, GUIDED or OFFBOARD); any
/// other mode ends it for good, since then someone else has the aircraft. Who was not heard for a while may have changed
/// hands and be in GUIDED again: then it is ours only where we left it. It is the same safe way out for all faults: the
/// estimator's failsafe overrides it where a position is needed and missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HandBack {
    /// `None` once there is nothing to give back.
    left: Option<Left>,
    /// When it may be asked again.
    ask_at: Instant,
    waiting: bool,
    failures: u16,
}

/// Where the aircraft was left.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Left {
    /// The last target.
    at: Ned,
    /// So far from it, it may still be on its way.
    within_m: f32,
    /// Whether the autopilot fell silent since.
    unheard: bool,
}

impl HandBack {
    /// There is nothing to give back.
    pub(crate) const fn nothing() -> HandBack {
        HandBack { left: None, ask_at: Instant::ZERO, waiting: false, failures: 0 }
    }

    /// Whether the aircraft still has to be given back.
    pub(crate) const fn is_pending(&self) -> bool {
        self.left.is_some()
    }

    pub(crate) fn step(
        mut self,
        now: Instant,
        fault: Fault,
        inputs: &Inputs<'_>,
        out: &mut Outputs,
    ) -> Phase {
        let vehicle = inputs.vehicle;
        let returns = inputs.ended.iter().filter(|(command, _)| *command == AutopilotCommand::ReturnToLaunch);
        for (_, accepted) in returns {
            self = if *accepted { HandBack::nothing() } else { self.failed(now, out) };
        }
        if vehicle.is_taken() || inputs.other_mode_seen || (vehicle.mode.is_some() && !vehicle.armed) {
            out.withdraw |= self.waiting;
            self = HandBack::nothing();
        }
        let Some(left) = &mut self.left else { return Phase::Fault(fault, self) };
        left.unheard |= vehicle.mode.is_none();
        let is_ours = match vehicle.position.filter(|_| left.unheard) {
            None => !left.unheard,
            Some(position) if position.horizontal_distance(&left.at).0 <= left.within_m => true,
            Some(_) if !vehicle.is_guided() => false,
            Some(_) => {
                out.say(Severity::Critical, format_args!("gleaner: moved by another, left to you"));
                out.withdraw |= self.waiting;
                return Phase::Fault(fault, HandBack::nothing());
            }
        };
        if vehicle.is_guided() && is_ours && !self.waiting && now >= self.ask_at {
            self.waiting = true;
            out.command = Some(AutopilotCommand::ReturnToLaunch);
        }
        Phase::Fault(fault, self)
    }

    /// Refused, or three times not answered.
    fn failed(self, now: Instant, out: &mut Outputs) -> HandBack {
        if self.left.is_none() {
            return self;
        }
        let failures = self.failures.wrapping_add(1);
        if failures.is_multiple_of(u16::from(ATTEMPTS)) {
            out.say(Severity::Critical, format_args!("gleaner: autopilot does not return, take over"));
        }
        let pause = if failures < u16::from(ATTEMPTS) { ASK_AGAIN } else { ASK_SELDOM };
        HandBack { ask_at: now + pause, waiting: false, failures, ..self }
    }
}
