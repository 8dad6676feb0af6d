//! Engaged and homing: the two states that move the aircraft.

use super::Outcome;
use super::hand_back::Left;
use super::landing::Landing;
use crate::decide::{Decider, Deliberator, Standpoint};
use crate::flight::course::Course;
use crate::flight::energy::Energy;
use crate::flight::leg::{Leg, Progress, Purpose};
use crate::flight::plan::Plan;
use crate::flight::speed::Speed;
use crate::flight::stream::Stream;
use crate::flight::watch::{Finding, Watch, origin_moved, origin_offset_m};
use crate::scene::Scene;
use crate::{Fault, Outputs, ReturnReason, State, TakeOver, Vehicle};
use gleaner_link::{Autopilot, Firmware, PositionTarget, Severity};
use gleaner_units::{Action, Cell, Decimal, Duration, Instant, Metres, Ned};

/// How long the estimator may mistrust itself before the position counts as lost.
const UNREADY: Duration = Duration::from_secs(2);
/// Legs in a row without progress after which there is nothing left to try.
const STALLS: u8 = 2;

/// A flight under our command.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Flight {
    pub(crate) plan: Plan,
    pub(crate) course: Course,
    /// `None` while the policy flies.
    pub(crate) homing: Option<ReturnReason>,
    watch: Watch,
    engaged_at: Instant,
    stepped_at: Instant,
    ready_at: Instant,
    stalls: u8,
    landing: Option<Landing>,
    speed: Speed,
    warned: Warned,
}

/// Warnings given once a flight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Warned {
    radio_silent: bool,
    short_of_home: bool,
}

impl Flight {
    pub(crate) fn new(now: Instant, plan: Plan, stream: Stream, position: Option<Ned>) -> Flight {
        let centre = plan.frame.centre(plan.cell, plan.down_m);
        let start = position.unwrap_or(centre);
        Flight {
            plan,
            course: Course::new(
                Leg::new(now, Purpose::Centre, (plan.cell, start), (plan.cell, centre)),
                stream,
            ),
            homing: None,
            watch: Watch::new(now),
            engaged_at: now,
            stepped_at: now,
            ready_at: now,
            stalls: 0,
            landing: None,
            speed: Speed::default(),
            warned: Warned::default(),
        }
    }

    /// From now on the guard flies. The moves that are decided are flown first: their ends are cells that the guard
    /// allowed, with the way home paid for. A hover is cut short.
    pub(crate) fn go_home(&mut self, reason: ReturnReason) {
        self.homing = Some(reason);
        self.course.end_hover();
    }

    pub(crate) const fn state(&self) -> State {
        if self.homing.is_some() { State::Homing } else { State::Engaged }
    }

    /// No target leaves without a recent heartbeat in our mode.
    pub(crate) fn target_due(&mut self, scene: &Scene<'_>) -> Option<PositionTarget> {
        if scene.inputs.target_reported {
            self.course.target_reported();
        }
        let firmware = scene.vehicle().firmware.filter(|_| scene.is_heard())?;
        self.course.target_due(scene.now, firmware)
    }

    /// Where the aircraft is left when this flight fails.
    pub(crate) fn left(&self, vehicle: &Vehicle) -> Left {
        let position = vehicle.position.filter(Ned::is_finite).unwrap_or(self.course.leg.target);
        let (at, coasting_m) = self.course.stopping(position);
        // After a move of the origin the last position and the next one may be in different frames.
        let frames_m = vehicle.origin.map_or(0.0, |origin| origin_offset_m(&self.plan, &origin));
        let within_m = 1.5 * self.plan.frame.grid().cell().0 + coasting_m + frames_m;
        Left { at, within_m, unheard: false }
    }

    pub(crate) fn step<D: Deliberator>(
        &mut self,
        scene: &Scene<'_>,
        energy: &mut Energy,
        decider: &mut Decider,
        policy: &mut D,
        out: &mut Outputs,
    ) -> Outcome {
        let position = match self.judge(scene) {
            Ok(position) => position,
            Err(outcome) => return outcome,
        };
        let passed = scene.now.since(core::mem::replace(&mut self.stepped_at, scene.now)).as_secs_f32();
        self.count_energy(scene, &position, passed, energy, out);
        if let Some(landing) = &mut self.landing {
            let is_over = self.plan.frame.cell(&position) == Some(self.course.leg.cell);
            return landing.step(scene, is_over, out);
        }
        self.speed.keep(scene, out);
        if self.homing.is_none()
            && let Some(reason) = self.reason_to_return(scene, out)
        {
            return Outcome::GoHome(reason);
        }
        self.move_on(scene, &position, passed, energy);
        match self.progress(scene, &position) {
            Progress::Underway if self.looks_ahead(scene, energy) => {
                self.decide(scene, energy, decider, policy, out)
            }
            Progress::Underway => Outcome::Stay,
            Progress::Stalled => self.stalled(scene, &position, out),
            Progress::Arrived if self.is_home(scene) => {
                self.landing = Some(Landing::new(scene.now));
                match self.homing {
                    Some(_) => Outcome::Stay,
                    None => Outcome::GoHome(ReturnReason::Terminal),
                }
            }
            Progress::Arrived if self.course.begin_next(scene.now) => Outcome::Stay,
            // Nothing new is decided on old evidence.
            Progress::Arrived if !scene.is_heard() => Outcome::Stay,
            Progress::Arrived => self.decide(scene, energy, decider, policy, out),
        }
    }

    /// Moves the target on. On a missing heartbeat it stops: the aircraft may not be ours any more.
    fn move_on(&mut self, scene: &Scene<'_>, position: &Ned, secs: f32, energy: &mut Energy) {
        let is_heard = scene.heartbeat_age().is_some_and(|age| age <= Autopilot::EVIDENCE_AGE);
        let cruise_mps = if is_heard { scene.inputs.parameters.speed().0 } else { 0.0 };
        if let Some((rest, direction)) = self.course.advance(position, cruise_mps, secs * scene.pace) {
            self.stalls = 0;
            energy.burn.flew(rest, direction);
        }
    }

    /// Whether the next decision is due before the aircraft arrives: it is for the cell at the end of the leg.
    fn looks_ahead(&self, scene: &Scene<'_>, energy: &Energy) -> bool {
        let ends = self.is_home(scene) || self.lands_here(scene, energy);
        self.course.needs_decision() && !ends && scene.is_heard()
    }

    /// Whether the battery is so empty on the way home that the flight ends at the end of the present leg.
    fn lands_here(&self, scene: &Scene<'_>, energy: &Energy) -> bool {
        let (cell, ahead) = (self.course.leg.cell, self.course.units_ahead());
        self.homing.is_some()
            && !energy.reaches_home(scene, cell, ahead)
            && energy.must_land(scene)
            && scene.mission.heights.height_m(cell) == Some(0)
    }

    /// Looks, without acting. The human pilot comes first: whatever else is wrong, a mode that we did not request
    /// means that nothing of ours may leave.
    fn judge(&mut self, scene: &Scene<'_>) -> Result<Ned, Outcome> {
        let (vehicle, now) = (scene.vehicle(), scene.now);
        if vehicle.ready {
            self.ready_at = now;
        }
        if vehicle.is_taken() || scene.inputs.other_mode_seen {
            return Err(match self.landing {
                Some(_) if vehicle.is_landing_or_returning() => Outcome::Done { landed: !vehicle.armed },
                _ => Outcome::Passive(TakeOver::Mode),
            });
        }
        if vehicle.mode.is_none() {
            return Err(Outcome::Fault(Fault::AutopilotLost));
        }
        if !vehicle.armed {
            return Err(if self.landing.is_some() { Outcome::Done { landed: true } } else { Outcome::Idle });
        }
        if scene.late {
            return Err(Outcome::Fault(Fault::Late));
        }
        // A moved origin also changes the coordinates of our own targets.
        if origin_moved(&self.plan, vehicle.origin) {
            return Err(Outcome::Fault(Fault::OriginMoved));
        }
        if scene.inputs.foreign_target {
            return Err(Outcome::Passive(TakeOver::Target));
        }
        if vehicle.failsafe && vehicle.firmware == Some(Firmware::Px4) {
            return Err(Outcome::Fault(Fault::Failsafe));
        }
        let position = vehicle.position.filter(Ned::is_finite);
        let position = position.filter(|_| now.since(self.ready_at) <= UNREADY);
        let position = position.ok_or(Outcome::Fault(Fault::PositionLost))?;
        match self.watch.see(now, vehicle.boot_ms, &position, &self.plan, &self.course.leg) {
            Finding::Fine => Ok(position),
            // A landing that was requested for another place cannot be laid out anew.
            Finding::Jumped if self.landing.is_some() => Err(Outcome::Fault(Fault::PositionLost)),
            Finding::Jumped => {
                self.turn_back(scene, &position);
                match self.homing {
                    Some(_) => Ok(position),
                    None => Err(Outcome::GoHome(ReturnReason::PositionJump)),
                }
            }
            Finding::JumpedAgain => Err(Outcome::Fault(Fault::PositionLost)),
            Finding::Away => Err(Outcome::Passive(TakeOver::Place)),
            Finding::AltitudeLost => Err(Outcome::Fault(Fault::AltitudeLost)),
        }
    }

    fn count_energy(
        &mut self,
        scene: &Scene<'_>,
        position: &Ned,
        passed_s: f32,
        energy: &mut Energy,
        out: &mut Outputs,
    ) {
        let leg = &mut self.course.leg;
        match leg.purpose {
            Purpose::Move => {
                let cells = leg.cover(position);
                energy.burn.flew(cells, leg.direction().0);
                energy.burn.hovered(leg.turned_s(cells, passed_s, scene.slot().as_secs_f32()));
            }
            Purpose::Hover | Purpose::Centre => energy.burn.hovered(passed_s),
        }
        if energy.read(scene) {
            out.say(Severity::Warning, format_args!("gleaner: battery percentage jumped"));
        }
    }

    fn reason_to_return(&mut self, scene: &Scene<'_>, out: &mut Outputs) -> Option<ReturnReason> {
        let inputs = scene.inputs;
        if inputs.vehicle.failsafe {
            return Some(ReturnReason::Failsafe);
        }
        if inputs.vehicle.battery_percent.is_none() {
            return Some(ReturnReason::BatteryUnknown);
        }
        let heard_at = inputs.radio.heard_at.map_or(self.engaged_at, |at| at.max(self.engaged_at));
        let silent = scene.now.since(heard_at);
        if silent <= inputs.parameters.snr_age() {
            self.warned.radio_silent = false;
        } else if !core::mem::replace(&mut self.warned.radio_silent, true) {
            let (bytes, reports) = (inputs.radio.bytes, inputs.radio.reports);
            out.say(
                Severity::Warning,
                format_args!("gleaner: radio silent, {bytes} bytes {reports} reports"),
            );
        }
        (silent > inputs.rules.blind_return).then_some(ReturnReason::RadioSilent)
    }

    /// The arrival radius. Beyond half a cell the aircraft would arrive in one cell while it is in the next.
    fn arrival(&self, scene: &Scene<'_>) -> Metres {
        let half_cell_m = self.plan.frame.grid().cell().0 / 2.0;
        Metres(scene.inputs.parameters.arrive_radius().0.min(half_cell_m))
    }

    fn progress(&mut self, scene: &Scene<'_>, position: &Ned) -> Progress {
        let arrival = self.arrival(scene);
        let progress = self.course.progress(scene.now, position, arrival);
        if progress == Progress::Arrived && self.course.leg.purpose == Purpose::Move {
            self.stalls = 0;
        }
        progress
    }

    /// Whether the mission ends here: homing over the terminal, or by a move of the policy into it.
    fn is_home(&self, scene: &Scene<'_>) -> bool {
        let leg = &self.course.leg;
        let ends = self.homing.is_some() || leg.purpose == Purpose::Move;
        ends && leg.cell == scene.mission.terminal
    }

    fn stalled(&mut self, scene: &Scene<'_>, position: &Ned, out: &mut Outputs) -> Outcome {
        if self.homing.is_none() {
            self.stalls = 1;
            self.turn_back(scene, position);
            return Outcome::GoHome(ReturnReason::NoProgress);
        }
        self.stalls += 1;
        if self.stalls >= STALLS {
            return Outcome::Fault(Fault::NoProgress);
        }
        out.say(Severity::Warning, format_args!("gleaner: {}", ReturnReason::NoProgress.text()));
        Outcome::Stay
    }

    /// Turns back to the cell under the aircraft, when the target cannot be reached.
    fn turn_back(&mut self, scene: &Scene<'_>, position: &Ned) {
        let may_be = |&cell: &Cell| scene.guard.distance(cell).is_some();
        let here = self.plan.frame.cell(position).filter(may_be).unwrap_or(self.course.leg.from);
        let target = self.plan.frame.centre(here, self.plan.down_m);
        self.course.begin(Leg::new(scene.now, Purpose::Centre, (here, *position), (here, target)));
    }

    /// One decision for the end of the present leg, which the aircraft has reached or will reach: of the policy, of the
    /// guard on the way home, or the reason why the guard continues without the policy.
    fn decide<D: Deliberator>(
        &mut self,
        scene: &Scene<'_>,
        energy: &mut Energy,
        decider: &mut Decider,
        policy: &mut D,
        out: &mut Outputs,
    ) -> Outcome {
        if self.homing.is_some() {
            return self.fly_home(scene, energy, decider, out);
        }
        let cell = self.course.leg.cell;
        let battery = energy.available(scene, self.course.units_ahead());
        if !scene.guard.is_feasible(cell, battery) {
            return Outcome::GoHome(ReturnReason::Battery);
        }
        let at = Standpoint { state: State::Engaged, cell, battery };
        match decider.ask(scene, at, policy, out) {
            Ok(action) => {
                self.follow(scene, energy, action);
                Outcome::Stay
            }
            Err(reason) => Outcome::GoHome(reason),
        }
    }

    /// One move on the shortest way home. When the charge no longer covers it, the operator is warned once, and the
    /// flight goes on until little more than the landing is left; then it lands over open ground.
    fn fly_home(
        &mut self,
        scene: &Scene<'_>,
        energy: &mut Energy,
        decider: &mut Decider,
        out: &mut Outputs,
    ) -> Outcome {
        let (cell, ahead) = (self.course.leg.cell, self.course.units_ahead());
        if !energy.reaches_home(scene, cell, ahead) {
            if !core::mem::replace(&mut self.warned.short_of_home, true) {
                let needed = Decimal::<0>(energy.touchdown_percent(scene, cell, ahead).unwrap_or(0.0));
                out.say(Severity::Critical, format_args!("gleaner: battery short of home, {needed} % there"));
            }
            if self.lands_here(scene, energy) {
                out.say(Severity::Critical, format_args!("gleaner: battery empty, landing at {cell}"));
                self.landing = Some(Landing::new(scene.now));
                return Outcome::Stay;
            }
        }
        let at = Standpoint { state: State::Homing, cell, battery: energy.available(scene, ahead) };
        match decider.homeward(scene, at, out) {
            Some(action) => {
                self.follow(scene, energy, action);
                Outcome::Stay
            }
            None => Outcome::Fault(Fault::NoWayHome),
        }
    }

    /// Flies an action from the end of the present leg: now if the aircraft is there, else when it will be.
    fn follow(&mut self, scene: &Scene<'_>, energy: &mut Energy, action: Action) {
        let Leg { cell: from, target, .. } = self.course.leg;
        let to = from.after(action);
        let ends = ((from, target), (to, self.plan.frame.centre(to, self.plan.down_m)));
        energy.pay(action);
        let leg = match action {
            Action::Hover => Leg::new(scene.now, Purpose::Hover, ends.0, ends.1).lasting(scene.slot()),
            _ => {
                let leg = Leg::new(scene.now, Purpose::Move, ends.0, ends.1);
                if leg.continues(&self.course.leg) { leg } else { leg.turning() }
            }
        };
        self.course.follow(leg, self.arrival(scene));
    }
}
