//! The companion computer: the pilot in this process, or one behind byte streams ([`crate::Wired`]).

use crate::script::ComputerFault;
use crate::simulation::Simulation;
use gleaner_pilot::{Deliberator, Mission, Onboard, OnboardError, ParameterId, Parameters, Settings, State};
use gleaner_policy::SelfTestError;
use gleaner_radio::encode;
use gleaner_units::Instant;

/// A companion computer in the simulation.
pub trait Companion {
    /// Delivers what autopilot and radio have sent, runs the pilot, and carries its bytes to the autopilot.
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant);

    /// A fault of the computer itself. Computers outside this process have none.
    fn inject(&mut self, _: &mut Simulation, _: Instant, _: ComputerFault) {}
}

/// On the pilot's clock and in this process.
impl<P: Deliberator> Companion for Onboard<P> {
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant) {
        for frame in simulation.to_companion() {
            simulation.delivered(now, &frame);
            self.receive_link(now, &frame);
        }
        for report in simulation.radio() {
            self.receive_radio(now, &encode(&report));
        }
        turn(self, simulation, now);
    }
}

fn turn<P: Deliberator>(onboard: &mut Onboard<P>, simulation: &mut Simulation, now: Instant) {
    onboard.poll(now);
    let mut buffer = [0; 512];
    loop {
        let length = onboard.transmit(&mut buffer);
        if length == 0 {
            break;
        }
        simulation.from_companion(&buffer[..length]);
    }
}

/// The parameters of a fresh installation on a computer with an operating system.
pub(crate) fn parameters(looks_ahead: bool) -> Parameters {
    let mut parameters = Parameters::default();
    // 0 and 1 are in the parameter's range.
    let _ = parameters.set_id(ParameterId::Lookahead, if looks_ahead { 1.0 } else { 0.0 });
    parameters
}

/// Most bytes that wait for a program that does not read: Linux's default socket buffer.
const SOCKET_BYTES: usize = 212_992;

/// A companion computer in this process whose program can stall and restart.
pub struct Computer<P> {
    mission: Mission,
    settings: Settings,
    self_test: Result<(), SelfTestError>,
    /// `None` while the program is not running. On the heap: with look-ahead over 128 x 128 cells a pilot has 200 kB,
    /// and each move of it would take that from the stack.
    onboard: Option<Box<Onboard<P>>>,
    /// The policy while the program is not running.
    policy: Option<Box<P>>,
    parameters: Parameters,
    stalled_until: Instant,
    starts_at: Instant,
    /// Frames with the time at which they arrived.
    waiting: Vec<(Instant, Vec<u8>)>,
    waiting_bytes: usize,
}

impl<P: Deliberator> Computer<P> {
    /// A computer whose program has just started.
    ///
    /// # Errors
    /// The pilot refuses its mission or settings.
    pub fn new(
        mission: Mission,
        settings: Settings,
        policy: P,
        self_test: Result<(), SelfTestError>,
    ) -> Result<Computer<P>, OnboardError> {
        let mut computer = Computer {
            mission,
            settings,
            self_test,
            onboard: None,
            policy: Some(Box::new(policy)),
            parameters: parameters(P::LOOKS_AHEAD),
            stalled_until: Instant::ZERO,
            starts_at: Instant::ZERO,
            waiting: Vec::new(),
            waiting_bytes: 0,
        };
        computer.start()?;
        Ok(computer)
    }

    fn start(&mut self) -> Result<(), OnboardError> {
        let Some(policy) = self.policy.take() else { return Ok(()) };
        let (mission, parameters) = (self.mission.clone(), self.parameters.clone());
        let onboard = Onboard::new(mission, parameters, self.settings, *policy, self.self_test)?;
        self.onboard = Some(Box::new(onboard));
        Ok(())
    }

    /// The pilot's state; `None` while the program is not running.
    #[must_use]
    pub fn state(&self) -> Option<State> {
        self.onboard.as_ref().map(|onboard| onboard.state())
    }

    fn keep(&mut self, now: Instant, frames: Vec<Vec<u8>>) {
        for frame in frames {
            if self.waiting_bytes + frame.len() <= SOCKET_BYTES {
                self.waiting_bytes += frame.len();
                self.waiting.push((now, frame));
            }
        }
    }

    fn is_stalled(&self, now: Instant) -> bool {
        now < self.stalled_until
    }
}

impl<P: Deliberator> Companion for Computer<P> {
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant) {
        if self.onboard.is_none() && now >= self.starts_at {
            // The mission was accepted at the first start.
            let _ = self.start();
        }
        let frames = simulation.to_companion();
        let reports = simulation.radio();
        if self.onboard.is_some() && self.is_stalled(now) {
            self.keep(now, frames);
            return;
        }
        // By reference: a pilot is tens of kilobytes.
        let Some(onboard) = &mut self.onboard else { return };
        for (at, frame) in self.waiting.drain(..) {
            simulation.delivered(at, &frame);
            onboard.receive_link(now, &frame);
        }
        self.waiting_bytes = 0;
        for frame in frames {
            simulation.delivered(now, &frame);
            onboard.receive_link(now, &frame);
        }
        for report in reports {
            onboard.receive_radio(now, &encode(&report));
        }
        turn(onboard, simulation, now);
    }

    fn inject(&mut self, simulation: &mut Simulation, now: Instant, fault: ComputerFault) {
        match fault {
            ComputerFault::Stall(lasts) => {
                self.stalled_until = now + lasts;
                simulation.companion_stalls_until(self.stalled_until);
            }
            ComputerFault::Restart(after) => {
                if let Some(onboard) = self.onboard.take() {
                    self.parameters = onboard.parameters().clone();
                    self.policy = Some(Box::new(onboard.into_policy()));
                }
                self.waiting.clear();
                self.waiting_bytes = 0;
                self.stalled_until = Instant::ZERO;
                self.starts_at = now + after;
                simulation.companion_restarts();
            }
        }
    }
}
