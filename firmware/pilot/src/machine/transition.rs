//! From state to state: the operator's requests, and what the states' steps come to.

use super::{Machine, Phase};
use crate::exchange::{OnStop, collected};
use crate::scene::Scene;
use crate::states::Outcome;
use crate::states::flying::Flight;
use crate::states::hand_back::HandBack;
use crate::states::shadow::Shadow;
use crate::states::waiting::Wait;
use crate::{Fault, Inputs, Outputs, Request, ReturnReason, State};
use gleaner_link::{Firmware, Severity};
use gleaner_units::{Decimal, Instant};

impl Machine {
    pub(super) fn boot(&mut self, out: &mut Outputs) {
        if self.self_test_passed {
            self.enter(Phase::Idle, out);
        } else {
            self.enter(Phase::Fault(Fault::SelfTest, HandBack::nothing()), out);
        }
    }

    /// The operator's request comes before everything but the self-test.
    pub(super) fn answer(&mut self, now: Instant, request: Request, inputs: &Inputs<'_>, out: &mut Outputs) {
        if let Phase::Fault(Fault::SelfTest, _) = self.phase {
            out.say(Severity::Critical, format_args!("gleaner: refused, self-test failed"));
            return;
        }
        match request {
            Request::Off => {
                if self.state().flies() || self.is_handing_back() {
                    // ArduCopter hovers at the last target until its battery is empty: someone must take it.
                    out.say(Severity::Warning, format_args!("gleaner: off in flight, take over now"));
                }
                self.enter(Phase::Idle, out);
            }
            Request::Engage if self.state().flies() => {}
            Request::Engage if inputs.vehicle.failsafe => {
                out.say(Severity::Warning, format_args!("gleaner: refused, autopilot failsafe"));
            }
            Request::Engage => {
                self.decider.begin_mission();
                self.enter(Phase::Waiting(Wait::new(now, inputs.vehicle)), out);
            }
            Request::Shadow => {
                self.decider.begin_mission();
                self.enter(Phase::Shadow(Shadow::default()), out);
            }
            Request::Return => match self.state() {
                State::Engaged => self.go_home(ReturnReason::Request, out),
                State::Homing => {}
                _ => out.say(Severity::Warning, format_args!("gleaner: return refused, not engaged")),
            },
            Request::HandBack if self.state().flies() => self.give_up(now, Fault::Stopped, inputs, out),
            Request::HandBack if self.is_handing_back() => {}
            Request::HandBack => self.enter(Phase::Idle, out),
        }
    }

    pub(super) fn apply(&mut self, now: Instant, outcome: Outcome, inputs: &Inputs<'_>, out: &mut Outputs) {
        match outcome {
            Outcome::Stay => {}
            Outcome::Idle => self.enter(Phase::Idle, out),
            Outcome::Engage(plan) => {
                let stream = match &self.phase {
                    Phase::Waiting(wait) => wait.stream(),
                    _ => Default::default(),
                };
                self.energy.open(plan.battery);
                let flight = Flight::new(now, plan, stream, inputs.vehicle.position);
                self.enter(Phase::Flying(flight), out);
                self.announce_touchdown(now, inputs, out);
            }
            Outcome::GoHome(reason) => self.go_home(reason, out),
            Outcome::Done { landed } => {
                self.monitor.set_collected(collected(&self.mission, inputs.devices));
                self.enter(Phase::Done { landed }, out);
                if landed && inputs.vehicle.firmware == Some(Firmware::Px4) && inputs.vehicle.is_guided() {
                    out.say(Severity::Warning, format_args!("gleaner: leave OFFBOARD before arming again"));
                }
            }
            Outcome::Passive(take_over) => self.enter(Phase::Passive(take_over), out),
            Outcome::Fault(fault) => self.give_up(now, fault, inputs, out),
        }
    }

    fn go_home(&mut self, reason: ReturnReason, out: &mut Outputs) {
        let Phase::Flying(flight) = &mut self.phase else { return };
        flight.go_home(reason);
        match reason {
            ReturnReason::Terminal | ReturnReason::Request => {
                out.say(Severity::Notice, format_args!("gleaner: {}", reason.text()));
            }
            _ => out.say(Severity::Warning, format_args!("gleaner: going home: {}", reason.text())),
        }
    }

    fn give_up(&mut self, now: Instant, fault: Fault, inputs: &Inputs<'_>, out: &mut Outputs) {
        let Phase::Flying(flight) = &self.phase else { return };
        let on_stop = if fault == Fault::Stopped { inputs.rules.on_stop } else { OnStop::Return };
        let command = on_stop.command(inputs.vehicle.firmware);
        let hand_back = HandBack::new(now, flight.left(inputs.vehicle), command);
        self.enter(Phase::Fault(fault, hand_back), out);
    }

    /// Changes the phase, withdraws what the old one left under way, announces the new one.
    fn enter(&mut self, phase: Phase, out: &mut Outputs) {
        let before = (self.state(), self.landed());
        self.phase = phase;
        if (self.state(), self.landed()) == before {
            return;
        }
        if !self.state().flies() && (before.0.commands() || before.0 == State::Fault) {
            out.withdraw = true;
            out.command = None;
        }
        self.announce(out);
    }

    fn announce(&self, out: &mut Outputs) {
        let percent = Decimal::<0>(self.collected() * 100.0);
        match &self.phase {
            Phase::Boot => {}
            Phase::Idle => out.say(Severity::Info, format_args!("gleaner: idle")),
            Phase::Waiting(_) => out.say(Severity::Info, format_args!("gleaner: engage requested")),
            Phase::Flying(flight) => {
                out.say(Severity::Notice, format_args!("gleaner: engaged at {}", flight.course.leg.cell));
            }
            Phase::Done { landed: false } => {
                out.say(Severity::Notice, format_args!("gleaner: landing, {percent} % collected"));
            }
            Phase::Done { landed: true } => {
                out.say(Severity::Notice, format_args!("gleaner: landed, {percent} % collected"));
            }
            Phase::Passive(take_over) => {
                out.say(Severity::Warning, format_args!("gleaner: passive, {}", take_over.text()));
            }
            Phase::Fault(fault, _) => {
                out.say(Severity::Critical, format_args!("gleaner: fault: {}", fault.text()));
            }
            Phase::Shadow(_) => {
                out.say(Severity::Notice, format_args!("gleaner: shadow, commanding nothing"));
            }
        }
    }

    /// The charge expected on the ground if the mission uses everything but the reserve.
    fn announce_touchdown(&self, now: Instant, inputs: &Inputs<'_>, out: &mut Outputs) {
        let Machine { mission, guard, monitor, energy, .. } = self;
        let evidence_from = monitor.evidence_from();
        let scene = Scene { now, mission, guard, inputs, evidence_from, late: false, pace: monitor.pace() };
        if let Some(percent) = energy.least_percent(&scene) {
            let percent = Decimal::<0>(percent);
            out.say(Severity::Info, format_args!("gleaner: touchdown at {percent} % or more expected"));
        }
    }
}
