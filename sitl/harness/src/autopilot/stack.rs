//! What a flight stack adds to the [`Vehicle`], and the [`Autopilot`] that both make together.

use super::guidance::{Guidance, Profile};
use super::motion::Response;
use super::parameters::{Defaults, Parameter};
use super::telemetry::Telemetry;
use super::vehicle::Vehicle;
use super::{AircraftFault, AircraftSettings, Autopilot, Commander, LinkId, Truth, VehicleMode};
use super::{requests, telemetry};
use gleaner_link::Frame;
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::{MavProtocolCapability, MavResult, MavSeverity};
use std::fmt;

/// Interval of the simulation.
const TICK: Duration = Duration::from_micros(20_000);

/// Modes, refusals and failsafes of one flight stack.
pub(super) trait FlightStack: Telemetry + fmt::Debug + Send + Sized {
    /// Parameters with their default values.
    const DEFAULTS: Defaults;
    /// Parameter of the MAVLink system id.
    const SYSTEM_ID: &'static str;
    /// How the aircraft follows a target.
    const RESPONSE: Response;
    /// Messages that are sent at a rate or on request.
    const STREAMABLE: &'static [u32];
    /// Mode after a boot, and who is said to have selected it.
    const FIRST_MODE: (VehicleMode, Commander);
    /// Links that `STATUSTEXT` leaves on.
    const TEXT_LINKS: &'static [LinkId];
    /// Answer to a command that the present state forbids.
    const REFUSED: MavResult;
    /// Answer to `REQUEST_MESSAGE` for a message that is not there.
    const NO_MESSAGE: MavResult;
    /// From touching the ground in a landing to disarming.
    const LAND_DETECTION: Duration;
    /// Text on disarming.
    const DISARMED: &'static str;
    /// `AUTOPILOT_VERSION`: release, as major, minor, patch and type.
    const VERSION: u32;
    /// `AUTOPILOT_VERSION`: capabilities.
    const CAPABILITIES: MavProtocolCapability;

    /// The stack at a boot of this vehicle.
    fn boot(vehicle: Vehicle) -> Self;
    fn vehicle(&self) -> &Vehicle;
    fn vehicle_mut(&mut self) -> &mut Vehicle;
    fn into_vehicle(self) -> Vehicle;

    /// Reads the parameters again after one of them changed.
    fn read_parameters(&mut self);
    /// The number of a parameter as `PARAM_VALUE` carries it.
    fn on_wire(parameter: &Parameter) -> f32;

    /// Handles a frame in the way of this stack. Whether it did.
    fn handle(&mut self, link: LinkId, frame: &Frame) -> bool;
    /// `DO_SET_MODE` with its main and sub mode.
    fn set_mode(&mut self, by: Commander, main: f32, sub: f32) -> MavResult;
    /// A request for a mode.
    fn request_mode(&mut self, by: Commander, mode: VehicleMode) -> MavResult;
    /// `NAV_TAKEOFF` with its altitude.
    fn take_off(&mut self, by: Commander, altitude_m: f32) -> MavResult;
    /// `DO_CHANGE_SPEED`.
    fn change_speed(&mut self, kind: f32, speed_mps: f32) -> MavResult;
    /// `SET_MESSAGE_INTERVAL`. Whether the message exists.
    fn set_interval(&mut self, link: LinkId, message_id: u32, interval_us: f32) -> bool;
    /// Why the motors cannot be armed now.
    fn arming_refusal(&self) -> Option<String>;
    /// The motors were armed.
    fn armed(&mut self) {}
    /// The motors were disarmed.
    fn disarmed(&mut self) {}

    /// The estimator has its first position since the boot.
    fn origin_set(&mut self) {}
    /// The estimator's origin moved.
    fn origin_moved(&mut self) {}
    /// How targets, climbs and landings are flown.
    fn profile(&self) -> Profile;
    /// Failsafes, and modes that end by themselves.
    fn check(&mut self);
    /// Whether the present guidance ends on the ground.
    fn lands(&self) -> bool;
    /// From arming to disarming when the aircraft stays on the ground; zero for never.
    fn disarm_delay(&self) -> Duration;
    /// Changes the mode.
    fn enter(&mut self, mode: VehicleMode, by: Commander);
    /// The human pilot turns the mode switch.
    fn pilot_selects(&mut self, mode: VehicleMode) {
        self.enter(mode, Commander::Operator);
    }
    /// Parameters of a circular fence around home.
    fn fence(radius_m: f32) -> Vec<(&'static str, f32)>;
    /// Whether the simulation ended by a target that was not a number.
    fn killed_by_nan(&self) -> bool {
        false
    }

    /// `STATUSTEXT`.
    fn say(&mut self, severity: MavSeverity, text: &str) {
        self.vehicle_mut().ports.say(Self::TEXT_LINKS, severity, text);
    }
}

/// A simulated autopilot of this stack, switched on.
pub(super) fn power_on<S: FlightStack>(settings: AircraftSettings) -> S {
    S::boot(Vehicle::new::<S>(settings))
}

fn reboot<S: FlightStack>(stack: &mut S) {
    let settings = stack.vehicle().airframe.settings;
    // Swapped out only to move its parts into the next boot.
    let before = std::mem::replace(stack, power_on(settings)).into_vehicle();
    *stack = S::boot(before.rebooted::<S>());
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
        loop {
            let (rest, frame) = self.vehicle_mut().ports.receive(link, bytes);
            let Some(frame) = frame else { return };
            bytes = rest;
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
