//! Engaged and homing: the two states that move the aircraft.

use super::Outcome;
use super::hand_back::Left;
use super::landing::Landing;
use crate::decide::{Decider, Deliberator, Standpoint};
use crate::flight::energy::Energy;
use crate::flight::leg::{Leg, Progress, Purpose};
use crate::flight::plan::Plan;
use crate::flight::stream::Stream;
use crate::flight::watch::{Finding, Watch, origin_moved};
use crate::scene::Scene;
use crate::{Fault, Outputs, ReturnReason, State, TakeOver};
use gleaner_link::{AutopilotCommand, Firmware, Severity};
use gleaner_units::{Action, Cell, Decimal, Duration, Instant, Metres, MetresPerSecond, Ned};

/// How long the estimator may mistrust itself before the position counts as lost.
const UNREADY: Duration = Duration::from_secs(2);
/// Heartbeats come once a second. Without them no new target is decided.
const HEARTBEAT_AGE: Duration = Duration::from_millis(2_500);
/// Legs in a row without progress after which there is nothing left to try.
const STALLS: u8 = 2;

/// A flight under our command.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Flight {
    pub(crate) plan: Plan,
    pub(crate) leg: Leg,
    /// `None` while the policy flies.
    pub(crate) homing: Option<ReturnReason>,
    stream: Stream,
    watch: Watch,
    engaged_at: Instant,
    stepped_at: Instant,
    ready_at: Instant,
    stalls: u8,
    landing: Option<Landing>,
    speed: Speed,
    warned: Warned,
}

/// The speed requested of the autopilot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Speed {
    requested: Option<MetresPerSecond>,
    /// When another speed was wanted.
    wanted_at: Option<Instant>,
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
            leg: Leg::new(now, Purpose::Centre, (plan.cell, start), (plan.cell, centre)),
            homing: None,
            stream,
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

    /// From now on the guard flies. The leg that is under way is finished first: its end is a cell that the
    /// guard allowed, with the way home paid for. A hover is cut short.
    pub(crate) fn go_home(&mut self, reason: ReturnReason) {
        self.homing = Some(reason);
        self.leg.hurry();
    }

    pub(crate) const fn state(&self) -> State {
        if self.homing.is_some() { State::Homing } else { State::Engaged }
    }

    pub(crate) fn target_due(&mut self, now: Instant, firmware: Firmware) -> Option<Ned> {
        self.stream.due(now, self.leg.target, firmware)
    }

    /// Where the aircraft is left when this flight fails.
    pub(crate) fn left(&self, position: Option<Ned>) -> Left {
        let within_m = 1.5 * self.plan.frame.grid().cell().0;
        Left { at: position.filter(Ned::is_finite).unwrap_or(self.leg.target), within_m, unheard: false }
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
        self.count_energy(scene, &position, energy, out);
        if let Some(landing) = &mut self.landing {
            return landing.step(scene, out);
        }
        self.keep_speed(scene, out);
        if self.homing.is_none()
            && let Some(reason) = self.reason_to_return(scene, out)
        {
            return Outcome::GoHome(reason);
        }
        match self.progress(scene, &position) {
            Progress::Underway => Outcome::Stay,
            Progress::Stalled => self.stalled(scene, &position, out),
            Progress::Arrived if self.is_home(scene) => {
                self.landing = Some(Landing::new(scene.now));
                match self.homing {
                    Some(_) => Outcome::Stay,
                    None => Outcome::GoHome(ReturnReason::Terminal),
                }
            }
            // Nothing new is decided on old evidence.
            Progress::Arrived if !self.is_heard(scene) => Outcome::Stay,
            Progress::Arrived if self.homing.is_some() => self.fly_home(scene, energy, decider, out),
            Progress::Arrived => self.decide(scene, energy, decider, policy, out),
        }
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
        if scene.inputs.foreign_target {
            return Err(Outcome::Passive(TakeOver::Target));
        }
        if vehicle.failsafe && vehicle.firmware == Some(Firmware::Px4) {
            return Err(Outcome::Fault(Fault::Failsafe));
        }
        if origin_moved(&self.plan, vehicle.origin) {
            return Err(Outcome::Fault(Fault::OriginMoved));
        }
        let position = vehicle.position.filter(Ned::is_finite);
        let position = position.filter(|_| now.since(self.ready_at) <= UNREADY);
        let position = position.ok_or(Outcome::Fault(Fault::PositionLost))?;
        match self.watch.see(now, vehicle.boot_ms, &position, &self.plan, &self.leg) {
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

    fn count_energy(&mut self, scene: &Scene<'_>, position: &Ned, energy: &mut Energy, out: &mut Outputs) {
        let passed = scene.now.since(self.stepped_at);
        self.stepped_at = scene.now;
        match self.leg.purpose {
            Purpose::Move => energy.burn.flew(self.leg.cover(position)),
            Purpose::Hover | Purpose::Centre => energy.burn.hovered(passed.as_secs_f32()),
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

    fn progress(&mut self, scene: &Scene<'_>, position: &Ned) -> Progress {
        // A radius beyond half a cell would let the aircraft arrive in one cell while it is in the next.
        let half_cell_m = self.plan.frame.grid().cell().0 / 2.0;
        let radius = Metres(scene.inputs.parameters.arrive_radius().0.min(half_cell_m));
        let progress = self.leg.watch(scene.now, position, radius);
        if progress == Progress::Arrived && self.leg.purpose == Purpose::Move {
            self.stalls = 0;
        }
        progress
    }

    /// Whether the mission ends here: homing over the terminal, or by a move of the policy into it.
    fn is_home(&self, scene: &Scene<'_>) -> bool {
        let ends = self.homing.is_some() || self.leg.purpose == Purpose::Move;
        ends && self.leg.cell == scene.mission.terminal
    }

    fn is_heard(&self, scene: &Scene<'_>) -> bool {
        let at = scene.vehicle().heartbeat_at;
        scene.hears() && at.is_some_and(|at| scene.now.since(at) <= HEARTBEAT_AGE)
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
        let here = self.plan.frame.cell(position).filter(may_be).unwrap_or(self.leg.from);
        let target = self.plan.frame.centre(here, self.plan.down_m);
        self.leg = Leg::new(scene.now, Purpose::Centre, (here, *position), (here, target));
    }

    /// One decision of the policy, or the reason why the guard goes on alone.
    fn decide<D: Deliberator>(
        &mut self,
        scene: &Scene<'_>,
        energy: &mut Energy,
        decider: &mut Decider,
        policy: &mut D,
        out: &mut Outputs,
    ) -> Outcome {
        let battery = energy.available(scene);
        if !scene.guard.is_feasible(self.leg.cell, battery) {
            return Outcome::GoHome(ReturnReason::Battery);
        }
        let at = Standpoint { state: State::Engaged, cell: self.leg.cell, battery };
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
        let cell = self.leg.cell;
        if !energy.reaches_home(scene, cell) {
            if !core::mem::replace(&mut self.warned.short_of_home, true) {
                let needed = Decimal::<0>(energy.touchdown_percent(scene, cell).unwrap_or(0.0));
                out.say(Severity::Critical, format_args!("gleaner: battery short of home, {needed} % there"));
            }
            if energy.must_land(scene) && scene.mission.heights.height_m(cell) == Some(0) {
                out.say(Severity::Critical, format_args!("gleaner: battery empty, landing at {cell}"));
                self.landing = Some(Landing::new(scene.now));
                return Outcome::Stay;
            }
        }
        let at = Standpoint { state: State::Homing, cell, battery: energy.available(scene) };
        match decider.homeward(scene, at, out) {
            Some(action) => {
                self.follow(scene, energy, action);
                Outcome::Stay
            }
            None => Outcome::Fault(Fault::NoWayHome),
        }
    }

    fn follow(&mut self, scene: &Scene<'_>, energy: &mut Energy, action: Action) {
        let (from, to) = (self.leg.cell, self.leg.cell.after(action));
        let ends = ((from, self.leg.target), (to, self.plan.frame.centre(to, self.plan.down_m)));
        energy.pay(action);
        self.leg = match action {
            Action::Hover => Leg::new(scene.now, Purpose::Hover, ends.0, ends.1).lasting(scene.slot()),
            _ => Leg::new(scene.now, Purpose::Move, ends.0, ends.1),
        };
    }

    /// `WPNAV_SPEED` has no effect on a guided leg that is under way, the command has. PX4 accepts it without
    /// effect in OFFBOARD, so it is not requested there.
    fn keep_speed(&mut self, scene: &Scene<'_>, out: &mut Outputs) {
        let wanted = scene.inputs.parameters.speed();
        if scene.vehicle().firmware == Some(Firmware::ArduPilot) && self.speed.requested != Some(wanted) {
            let wanted_at = *self.speed.wanted_at.get_or_insert(scene.now);
            if scene.is_ours_since(wanted_at) {
                self.speed = Speed { requested: Some(wanted), wanted_at: None };
                out.command = Some(AutopilotCommand::ChangeSpeed(wanted));
            }
        }
        let refused =
            |end: &(AutopilotCommand, bool)| matches!(end, (AutopilotCommand::ChangeSpeed(_), false));
        if scene.inputs.ended.iter().any(refused) {
            out.say(Severity::Warning, format_args!("gleaner: speed not accepted by the autopilot"));
        }
    }
}
