//! ArduPilot's side of the simulated autopilot.

use super::super::battery::Level;
use super::super::guidance::{Guidance, Profile};
use super::super::motion::{Response, SpeedLimits};
use super::super::parameters::Parameter;
use super::super::stack::FlightStack;
use super::super::vehicle::{Vehicle, VehicleModel};
use super::super::{Commander, LinkId, VehicleMode};
use super::requests::{REQUEST_DATA_STREAM, SET_MODE, name};
use super::{ArduCopter, DEFAULTS, telemetry, tuning};
use crate::wire;
use gleaner_link::Frame;
use gleaner_units::Duration;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::*;

impl FlightStack for ArduCopter {
    const MODEL: VehicleModel = VehicleModel {
        defaults: DEFAULTS,
        system_id: "SYSID_THISMAV",
        response: Response::ARDUCOPTER,
        streamable: telemetry::STREAMABLE,
        first_mode: (VehicleMode::Stabilize, Commander::Operator),
    };
    const TEXT_LINKS: &'static [LinkId] = &LinkId::ALL;
    const REFUSED: MavResult = MAV_RESULT_FAILED;
    const NO_MESSAGE: MavResult = MAV_RESULT_FAILED;
    const LAND_DETECTION: Duration = Duration::from_millis(1_500);
    const DISARMED: &'static str = "Disarming motors";
    // 4.6.3, official release.
    const VERSION: u32 = 0x0406_03FF;
    const CAPABILITIES: MavProtocolCapability = MavProtocolCapability::from_bits_retain(
        MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2.bits()
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED.bits()
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT.bits(),
    );

    fn boot(vehicle: Vehicle) -> ArduCopter {
        let tuning = tuning(&vehicle.parameters);
        let cruise_mps = tuning.profile.limits.horizontal_mps;
        ArduCopter { vehicle, tuning, cruise_mps, killed_by_nan: false }
    }

    fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    fn vehicle_mut(&mut self) -> &mut Vehicle {
        &mut self.vehicle
    }

    fn into_vehicle(self) -> Vehicle {
        self.vehicle
    }

    fn read_parameters(&mut self) {
        self.tuning = tuning(&self.vehicle.parameters);
    }

    /// ArduPilot sends integers by C cast: the float field holds the number.
    fn on_wire(parameter: &Parameter) -> f32 {
        parameter.value
    }

    fn handle(&mut self, link: LinkId, frame: &Frame) -> bool {
        match frame.message_id {
            SET_POSITION_TARGET_LOCAL_NED_DATA::ID => match wire::parse(frame) {
                Some(target) => self.take_target(&target, link.commander()),
                // An unknown frame number: it stops and holds.
                None if self.vehicle.mode == VehicleMode::Guided => self.vehicle.guidance = Guidance::Halt,
                None => {}
            },
            SET_MODE => self.set_mode_by_message(link, frame),
            REQUEST_DATA_STREAM => self.set_all_streams(link, frame),
            _ => return false,
        }
        true
    }

    fn set_mode(&mut self, by: Commander, main: f32, _: f32) -> MavResult {
        self.select_mode(by, main as u32)
    }

    fn request_mode(&mut self, by: Commander, mode: VehicleMode) -> MavResult {
        if mode.needs_position() && !self.vehicle.airframe.estimator_ready(self.vehicle.now) {
            let text = format!("Mode change to {} failed: requires position", name(mode));
            self.say(MavSeverity::MAV_SEVERITY_WARNING, &text);
            return MAV_RESULT_FAILED;
        }
        self.enter(mode, by);
        MAV_RESULT_ACCEPTED
    }

    fn take_off(&mut self, _: Commander, height_m: f32) -> MavResult {
        let possible =
            self.vehicle.mode == VehicleMode::Guided && self.vehicle.armed && self.vehicle.airframe.on_ground;
        if self.vehicle.airframe.home.is_none() || !possible || height_m.is_nan() || height_m <= 0.0 {
            return MAV_RESULT_FAILED;
        }
        let [north, east, _] = self.vehicle.airframe.body.position;
        let point = [north, east, self.vehicle.airframe.home_in_boot_frame()[2] - f64::from(height_m)];
        self.vehicle.guidance = Guidance::TakeOff { point, since: self.vehicle.now };
        MAV_RESULT_ACCEPTED
    }

    /// Kinds 0 and 1 are the same to a multicopter. It takes effect at once, also during a leg.
    fn change_speed(&mut self, kind: f32, speed_mps: f32) -> MavResult {
        if (kind == 0.0 || kind == 1.0) && speed_mps > 0.0 && speed_mps.is_finite() {
            self.cruise_mps = speed_mps.into();
            MAV_RESULT_ACCEPTED
        } else {
            MAV_RESULT_DENIED
        }
    }

    fn set_interval(&mut self, link: LinkId, message_id: u32, interval_us: f32) -> bool {
        self.vehicle.ports.streams(link).set(self.vehicle.now, message_id, interval_us)
    }

    fn arming_refusal(&self) -> Option<String> {
        let Vehicle { mode, now, airframe, .. } = &self.vehicle;
        let reason = if !airframe.estimator_ready(*now) {
            "Need Position Estimate".to_owned()
        } else if matches!(mode, VehicleMode::Return | VehicleMode::Land | VehicleMode::Brake) {
            format!("{} mode not armable", name(*mode))
        } else if airframe.battery.level > Level::Fine {
            "Battery 1 low voltage failsafe".to_owned()
        } else {
            return None;
        };
        Some(format!("Arm: {reason}"))
    }

    fn armed(&mut self) {
        self.say(MavSeverity::MAV_SEVERITY_INFO, "Arming motors");
        self.announce_origin_and_home();
    }

    fn origin_set(&mut self) {
        self.say(MavSeverity::MAV_SEVERITY_INFO, "EKF3 IMU0 origin set");
        self.announce_origin_and_home();
    }

    fn origin_moved(&mut self) {
        self.announce_origin_and_home();
    }

    fn profile(&self) -> Profile {
        let limits = SpeedLimits { horizontal_mps: self.cruise_mps, ..self.tuning.profile.limits };
        Profile { limits, ..self.tuning.profile }
    }

    fn check(&mut self) {
        self.check_battery();
        self.check_estimator();
    }

    fn lands(&self) -> bool {
        matches!(self.vehicle.guidance, Guidance::Descend(_))
    }

    fn disarm_delay(&self) -> Duration {
        self.tuning.disarm_delay
    }

    fn enter(&mut self, mode: VehicleMode, by: Commander) {
        self.change_to(mode, by);
    }

    fn pilot_selects(&mut self, mode: VehicleMode) {
        // Without a take-off mode the switch position does nothing.
        if mode != VehicleMode::TakeOff {
            self.enter(mode, Commander::Operator);
        }
    }

    fn fence(radius_m: f32) -> Vec<(&'static str, f32)> {
        vec![("FENCE_TYPE", 2.0), ("FENCE_RADIUS", radius_m), ("FENCE_ENABLE", 1.0)]
    }

    fn killed_by_nan(&self) -> bool {
        self.killed_by_nan
    }
}
