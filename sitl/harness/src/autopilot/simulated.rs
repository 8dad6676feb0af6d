//! The simulated [`Autopilot`]: a vehicle and its flight stack, tick by tick.

use super::guidance::Guidance;
use super::stack::FlightStack;
use super::vehicle::Vehicle;
use super::{AircraftFault, AircraftSettings, Autopilot, LinkId, Truth, VehicleMode};
use super::{requests, telemetry};
use gleaner_units::{Duration, Instant};

/// Interval of the simulation.
const TICK: Duration = Duration::from_micros(20_000);

/// A simulated autopilot of this stack, switched on.
pub(super) fn power_on<S: FlightStack>(settings: AircraftSettings) -> S {
    S::boot(Vehicle::new(&S::MODEL, settings))
}

fn reboot<S: FlightStack>(stack: &mut S) {
    let settings = stack.vehicle().airframe.settings;
    // Swapped out only to move its parts into the next boot.
    let before = std::mem::replace(stack, power_on(settings)).into_vehicle();
    *stack = S::boot(before.rebooted(&S::MODEL));
}

fn tick<S: FlightStack>(stack: &mut S) {
    let vehicle = stack.vehicle_mut();
    if vehicle.airframe.home.is_none() && vehicle.airframe.estimator_ready(vehicle.now) {
        vehicle.airframe.home = Some(vehicle.airframe.estimated());
        stack.origin_set();
    }
    let profile = stack.profile();
    let vehicle = stack.vehicle_mut();
    vehicle.airframe.tick(vehicle.now);
    if vehicle.flies() {
        vehicle.guidance = vehicle.guidance.fly(&mut vehicle.airframe, &profile, vehicle.now);
    }
    stack.check();
    check_ground(stack);
}

fn check_ground<S: FlightStack>(stack: &mut S) {
    let (lands, delay) = (stack.lands(), stack.disarm_delay());
    let vehicle = stack.vehicle_mut();
    if lands {
        vehicle.airframe.touch_down(vehicle.now);
    }
    if !(vehicle.armed && vehicle.airframe.on_ground) {
        return;
    }
    let idle = match vehicle.guidance {
        Guidance::TakeOff { .. } => return,
        _ if lands => S::LAND_DETECTION,
        _ => delay,
    };
    if idle > Duration::ZERO && vehicle.now - vehicle.armed_at.max(vehicle.airframe.grounded_at) >= idle {
        requests::disarm(stack);
    }
}

impl<S: FlightStack> Autopilot for S {
    fn step(&mut self, now: Instant) {
        let now = Instant::ZERO + (now - self.vehicle().booted_at);
        while !self.killed_by_nan() && self.vehicle().now + TICK <= now {
            let vehicle = self.vehicle_mut();
            vehicle.now = vehicle.now + TICK;
            tick(self);
            telemetry::send_due(self);
        }
    }

    fn receive(&mut self, link: LinkId, mut bytes: &[u8]) {
        while let Some(frame) = self.vehicle_mut().ports.receive(link, &mut bytes) {
            if !self.killed_by_nan() {
                requests::handle(self, link, &frame);
            }
        }
    }

    fn transmit(&mut self, link: LinkId) -> Vec<Vec<u8>> {
        self.vehicle_mut().ports.transmit(link)
    }

    fn pilot_selects(&mut self, mode: VehicleMode) {
        FlightStack::pilot_selects(self, mode);
    }

    fn inject(&mut self, fault: AircraftFault) {
        let vehicle = self.vehicle_mut();
        vehicle.airframe.inject(vehicle.now, fault);
        match fault {
            AircraftFault::Reboot => reboot(self),
            AircraftFault::PilotSelects(mode) => FlightStack::pilot_selects(self, mode),
            AircraftFault::Fence(radius_m) => {
                for (name, value) in S::fence(radius_m) {
                    requests::set_parameter(self, name, value);
                }
            }
            AircraftFault::OriginShift(_) => self.origin_moved(),
            _ => {}
        }
    }

    fn set_parameter(&mut self, name: &str, value: f32) -> bool {
        requests::set_parameter(self, name, value).is_some()
    }

    fn truth(&self) -> Truth {
        Truth { killed_by_nan: self.killed_by_nan(), ..self.vehicle().truth() }
    }

    fn settings(&self) -> &AircraftSettings {
        &self.vehicle().airframe.settings
    }
}
