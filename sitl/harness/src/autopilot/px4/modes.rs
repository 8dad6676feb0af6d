//! Modes and failsafes.

use super::super::battery::Level;
use super::super::guidance::Guidance;
use super::super::stack::FlightStack;
use super::super::{Commander, VehicleMode};
use super::Px4;
use gleaner_units::Duration;
use mavlink::dialects::ardupilotmega::MavSeverity;

/// OFFBOARD was left 1.35 s after the last target with `COM_OF_LOSS_T` 1 s.
const LOSS_MARGIN: Duration = Duration::from_millis(350);
/// `COM_OBL_RC_ACT`: hold instead of return.
const LOSS_HOLD: u32 = 5;

impl Px4 {
    /// Whether position targets arrive.
    pub(super) fn has_stream(&self) -> bool {
        self.target_at.is_some_and(|at| self.vehicle.now - at <= self.tuning.loss_time)
    }

    /// TAKEOFF ends in HOLD.
    pub(super) fn check_take_off(&mut self) {
        if let (VehicleMode::TakeOff, Guidance::TakeOff { point, .. }) =
            (self.vehicle.mode, self.vehicle.guidance)
            && !self.vehicle.airframe.on_ground
            && (self.vehicle.airframe.body.position[2] - point[2]).abs() < 0.5
        {
            self.enter(VehicleMode::Hold, Commander::Autopilot);
        }
    }

    pub(super) fn check_stream(&mut self) {
        if self.vehicle.mode != VehicleMode::Guided || !self.vehicle.armed {
            return;
        }
        let lost =
            self.target_at.is_none_or(|at| self.vehicle.now - at > self.tuning.loss_time + LOSS_MARGIN);
        if lost {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, "Failsafe activated");
            let hold = self.tuning.loss_action == LOSS_HOLD;
            self.enter(if hold { VehicleMode::Hold } else { VehicleMode::Return }, Commander::Autopilot);
            self.offboard_lost = true;
            self.failsafe = true;
        }
    }

    pub(super) fn check_battery(&mut self) {
        if !self.vehicle.armed {
            return;
        }
        let [low, critical, emergency] = self.tuning.battery_levels;
        let left = self.vehicle.airframe.battery.fraction();
        // The voltage injection stands for a pack at the critical level.
        let sags = self.vehicle.airframe.battery.voltage_v < 10.5;
        let reached = match () {
            () if left <= emergency => Level::Emergency,
            () if left <= critical || sags => Level::Critical,
            () if left <= low => Level::Low,
            () => Level::Fine,
        };
        let Some(level) = self.vehicle.airframe.battery.raise(reached) else { return };
        self.say(MavSeverity::MAV_SEVERITY_CRITICAL, "Low battery");
        let action = match (self.tuning.battery_action, level) {
            (2 | 3, Level::Emergency) => VehicleMode::Land,
            (2, Level::Critical) => VehicleMode::Land,
            (1 | 3, Level::Critical) => VehicleMode::Return,
            _ => return,
        };
        self.failsafe = true;
        self.offboard_lost = false;
        self.enter(action, Commander::Autopilot);
    }

    pub(super) fn check_estimator(&mut self) {
        if self.vehicle.needs_lost_position() {
            self.failsafe = true;
            self.offboard_lost = false;
            self.enter(VehicleMode::Land, Commander::Autopilot);
        }
    }

    /// Changes the mode; the next heartbeat reports it.
    pub(super) fn change_to(&mut self, mode: VehicleMode, by: Commander) {
        if by != Commander::Autopilot {
            // A choice of the pilot or of a command ends the failsafe and what it would return to.
            self.offboard_lost = false;
            self.failsafe = false;
        }
        if self.vehicle.mode == mode {
            return;
        }
        self.vehicle.mode = mode;
        self.vehicle.mode_by = by;
        self.vehicle.guidance = match mode {
            VehicleMode::Return => Guidance::Return { over_home_until: None },
            VehicleMode::Land => Guidance::Descend(self.vehicle.airframe.body.position),
            _ => Guidance::Halt,
        };
    }
}
