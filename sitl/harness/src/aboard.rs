//! Who is on board: the pilot in this process, or one behind byte streams ([`crate::Wired`]).

use crate::simulation::Simulation;
use gleaner_pilot::Onboard;
use gleaner_policy::Policy;
use gleaner_radio::encode;
use gleaner_units::Instant;

/// A pilot that can be flown with.
pub trait Aboard {
    /// Takes what autopilot and radio have for it, and gives the autopilot what it says.
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant);
}

/// In this process and on virtual time.
impl<P: Policy> Aboard for Onboard<P> {
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant) {
        for frame in simulation.to_companion() {
            self.receive_link(now, &frame);
        }
        for report in simulation.radio() {
            self.receive_radio(now, &encode(&report));
        }
        self.poll(now);
        let mut buffer = [0; 512];
        loop {
            let length = self.transmit(&mut buffer);
            if length == 0 {
                break;
            }
            simulation.hear_companion(&buffer[..length]);
        }
    }
}
