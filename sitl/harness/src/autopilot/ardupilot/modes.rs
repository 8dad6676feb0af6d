//! Modes and failsafes.

use super::super::battery::Level;
use super::super::guidance::Guidance;
use super::super::stack::FlightStack;
use super::super::{Commander, VehicleMode, telemetry};
use super::ArduCopter;
use mavlink::dialects::ardupilotmega::MavSeverity;

impl ArduCopter {
    pub(super) fn check_estimator(&mut self) {
        if self.vehicle.needs_lost_position() {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, "EKF Failsafe: changed to LAND Mode");
            self.enter(VehicleMode::Land, Commander::Autopilot);
        }
    }

    pub(super) fn check_battery(&mut self) {
        if !self.vehicle.armed {
            return;
        }
        let level = self.vehicle.airframe.battery.check_voltage(self.vehicle.now, self.tuning.thresholds);
        let Some(level) = level else { return };
        let (word, action) = match level {
            Level::Critical => ("critical", self.vehicle.parameters.value("BATT_FS_CRT_ACT")),
            _ => ("low", self.vehicle.parameters.value("BATT_FS_LOW_ACT")),
        };
        let (volts, used) =
            (self.vehicle.airframe.battery.voltage_v, self.vehicle.airframe.battery.consumed_mah());
        let text = format!("Battery 1 is {word} {volts:.2}V used {used} mAh");
        self.say(MavSeverity::MAV_SEVERITY_WARNING, &text);
        self.say(MavSeverity::MAV_SEVERITY_WARNING, "Battery Failsafe");
        match action as u8 {
            1 => self.enter(VehicleMode::Land, Commander::Autopilot),
            2 => self.enter(VehicleMode::Return, Commander::Autopilot),
            _ => {}
        }
    }

    /// Changes the mode; a heartbeat reports it at once. A request for the present mode changes nothing.
    pub(super) fn change_to(&mut self, mode: VehicleMode, by: Commander) {
        let changed = self.vehicle.mode != mode;
        self.vehicle.mode = mode;
        if changed {
            self.vehicle.mode_by = by;
        }
        if changed || mode != VehicleMode::Guided {
            self.vehicle.guidance = match mode {
                VehicleMode::Return => Guidance::Return { over_home_until: None },
                VehicleMode::Land => Guidance::Descend(self.vehicle.airframe.body.position),
                _ => Guidance::Halt,
            };
        }
        if changed {
            // WPNAV_SPEED is read when a mode begins: setting it during a leg has no effect (measured).
            self.cruise_mps = self.tuning.profile.limits.horizontal_mps;
            telemetry::send_heartbeats(self);
        }
    }
}
