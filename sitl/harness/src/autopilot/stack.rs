//! What a flight stack adds to the [`Vehicle`].

use super::guidance::Profile;
use super::parameters::Parameter;
use super::vehicle::{Vehicle, VehicleModel};
use super::{Commander, LinkId, VehicleMode};
use gleaner_link::Frame;
use gleaner_units::Duration;
use mavlink::dialects::ardupilotmega::{
    BATTERY_STATUS_DATA, EXTENDED_SYS_STATE_DATA, HEARTBEAT_DATA, MavProtocolCapability, MavResult,
    MavSeverity, RC_CHANNELS_DATA, SYS_STATUS_DATA,
};
use std::fmt;

/// The messages that each flight stack fills in its own way.
pub(super) trait Telemetry {
    fn heartbeat(&self) -> HEARTBEAT_DATA;
    fn sys_status(&self) -> SYS_STATUS_DATA;
    fn battery_status(&self) -> BATTERY_STATUS_DATA;
    fn landed(&self) -> EXTENDED_SYS_STATE_DATA;
    fn rc(&self) -> RC_CHANNELS_DATA;
    /// Sends a message that only this stack has. Whether there is one of this kind.
    fn send_own(&mut self, link: LinkId, message_id: u32) -> bool;
}

/// Modes, refusals and failsafes of one flight stack.
pub(super) trait FlightStack: Telemetry + fmt::Debug + Send + Sized {
    /// Constants of the vehicle.
    const MODEL: VehicleModel;
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
