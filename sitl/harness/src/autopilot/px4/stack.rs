//! PX4's side of the simulated autopilot.

use super::super::battery::Level;
use super::super::guidance::{Guidance, Profile};
use super::super::messages::ORIGIN_AMSL_MM;
use super::super::motion::Response;
use super::super::parameters::Parameter;
use super::super::stack::FlightStack;
use super::super::vehicle::{Vehicle, VehicleModel};
use super::super::{AutopilotKind, Commander, LinkId, VehicleMode};
use super::{DEFAULTS, Px4, telemetry, tuning};
use crate::wire;
use gleaner_link::Frame;
use gleaner_units::Duration;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::MavResult::{self, *};
use mavlink::dialects::ardupilotmega::*;

impl FlightStack for Px4 {
    const MODEL: VehicleModel = VehicleModel {
        defaults: DEFAULTS,
        system_id: "MAV_SYS_ID",
        response: Response::PX4,
        streamable: telemetry::STREAMABLE,
        first_mode: (VehicleMode::Hold, Commander::Autopilot),
    };
    // No text reached the companion link in measured runs.
    const TEXT_LINKS: &'static [LinkId] = &[LinkId::GROUND, LinkId::CREW];
    const REFUSED: MavResult = MAV_RESULT_TEMPORARILY_REJECTED;
    const NO_MESSAGE: MavResult = MAV_RESULT_DENIED;
    const LAND_DETECTION: Duration = Duration::from_millis(2_000);
    const DISARMED: &'static str = "Disarmed by landing";
    // 1.18.0, official release.
    const VERSION: u32 = 0x0112_00FF;
    const CAPABILITIES: MavProtocolCapability = MavProtocolCapability::from_bits_retain(
        MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2.bits()
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED.bits(),
    );

    fn boot(vehicle: Vehicle) -> Px4 {
        let tuning = tuning(&vehicle.parameters);
        let mut px4 = Px4 { vehicle, tuning, target_at: None, offboard_lost: false, failsafe: false };
        px4.start_streams();
        px4
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

    /// The raw bits of an int32 in the float field.
    fn on_wire(parameter: &Parameter) -> f32 {
        match parameter.kind {
            MavParamType::MAV_PARAM_TYPE_INT32 => f32::from_bits((parameter.value as i32).cast_unsigned()),
            _ => parameter.value,
        }
    }

    fn handle(&mut self, link: LinkId, frame: &Frame) -> bool {
        match frame.message_id {
            SET_POSITION_TARGET_LOCAL_NED_DATA::ID => {
                if let Some(target) = wire::parse(frame) {
                    self.take_target(&target, link.commander());
                }
            }
            PARAM_SET_DATA::ID => {
                if let Some(set) = wire::parse::<PARAM_SET_DATA>(frame) {
                    self.set_parameter_from_wire(&set);
                }
            }
            _ => return false,
        }
        true
    }

    fn set_mode(&mut self, by: Commander, main: f32, sub: f32) -> MavResult {
        let custom_mode = (main as u32) << 16 | (sub as u32) << 24;
        match VehicleMode::from_custom_mode(AutopilotKind::Px4, custom_mode) {
            Some(mode) => self.request_mode(by, mode),
            None => MAV_RESULT_DENIED,
        }
    }

    fn request_mode(&mut self, by: Commander, mode: VehicleMode) -> MavResult {
        let ready = self.vehicle.airframe.estimator_ready(self.vehicle.now);
        let missing_stream = mode == VehicleMode::Guided && self.vehicle.armed && !self.has_stream();
        if missing_stream || (mode.needs_position() && !ready) {
            return MAV_RESULT_TEMPORARILY_REJECTED;
        }
        self.enter(mode, by);
        MAV_RESULT_ACCEPTED
    }

    /// The altitude is above mean sea level; NaN is the default height of 2.5 m.
    fn take_off(&mut self, by: Commander, altitude_amsl_m: f32) -> MavResult {
        if self.vehicle.airframe.home.is_none() || !self.vehicle.airframe.estimator_ready(self.vehicle.now) {
            return MAV_RESULT_TEMPORARILY_REJECTED;
        }
        let [north, east, down] = self.vehicle.airframe.body.position;
        let asked = f64::from(ORIGIN_AMSL_MM) * 1e-3 - f64::from(altitude_amsl_m);
        let target = if altitude_amsl_m.is_finite() { asked } else { down - 2.5 };
        self.enter(VehicleMode::TakeOff, by);
        // A target below the ground: it stays there, in TAKEOFF, as a wrong altitude does on the real one.
        self.vehicle.guidance =
            Guidance::TakeOff { point: [north, east, target.min(down)], since: self.vehicle.now };
        MAV_RESULT_ACCEPTED
    }

    /// Accepted, without effect in OFFBOARD.
    fn change_speed(&mut self, _: f32, _: f32) -> MavResult {
        MAV_RESULT_ACCEPTED
    }

    fn set_interval(&mut self, link: LinkId, message_id: u32, interval_us: f32) -> bool {
        self.set_interval_or_default(link, message_id, interval_us)
    }

    fn arming_refusal(&self) -> Option<String> {
        let Vehicle { mode, now, airframe, .. } = &self.vehicle;
        let reason = if !airframe.estimator_ready(*now) {
            "global position required"
        } else if *mode == VehicleMode::Guided && !self.has_stream() {
            "no offboard signal"
        } else if matches!(mode, VehicleMode::Return | VehicleMode::Land) {
            "switch to another mode first"
        } else if airframe.battery.level > Level::Low {
            "low battery"
        } else {
            return None;
        };
        Some(format!("Arming denied: {reason}"))
    }

    fn disarmed(&mut self) {
        self.failsafe = false;
        self.offboard_lost = false;
    }

    fn profile(&self) -> Profile {
        self.tuning.profile
    }

    fn check(&mut self) {
        self.check_take_off();
        self.check_stream();
        self.check_battery();
        self.check_estimator();
    }

    fn lands(&self) -> bool {
        match self.vehicle.guidance {
            Guidance::Descend(_) => true,
            // An OFFBOARD target below the ground lands too.
            Guidance::Target(target) => {
                target.position[2] >= f64::from(self.vehicle.airframe.settings.stand.down_m)
            }
            _ => false,
        }
    }

    fn disarm_delay(&self) -> Duration {
        self.tuning.disarm_delay
    }

    fn enter(&mut self, mode: VehicleMode, by: Commander) {
        self.change_to(mode, by);
    }

    fn fence(radius_m: f32) -> Vec<(&'static str, f32)> {
        vec![("GF_MAX_HOR_DIST", radius_m)]
    }
}
