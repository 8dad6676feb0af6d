//! Position targets of the companion and of ground stations.

use super::super::guidance::{Guidance, Target};
use super::super::stack::FlightStack;
use super::super::targets::{IGNORE_POSITION, IGNORE_VELOCITY};
use super::super::{Commander, VehicleMode};
use super::Px4;
use mavlink::dialects::ardupilotmega::{MavSeverity, SET_POSITION_TARGET_LOCAL_NED_DATA};

impl Px4 {
    /// `SET_POSITION_TARGET_LOCAL_NED`. Never answered. A target counts as stream in every mode.
    pub(super) fn take_target(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA, by: Commander) {
        if asked.coordinate_frame as u32 != 1 {
            let frame = asked.coordinate_frame as u32;
            let text = format!("coordinate frame {frame} unsupported");
            self.say(MavSeverity::MAV_SEVERITY_ERROR, &text);
            if self.vehicle.mode == VehicleMode::Guided {
                self.vehicle.guidance = Guidance::Halt;
            }
            return;
        }
        let mask = asked.type_mask.bits();
        if mask & IGNORE_POSITION == IGNORE_POSITION {
            // Velocity-only, acceleration and attitude targets are not simulated.
            self.vehicle.ignored_targets += 1;
            return;
        }
        self.target_at = Some(self.vehicle.now);
        if self.offboard_lost && self.vehicle.armed {
            self.offboard_lost = false;
            self.failsafe = false;
            self.enter(VehicleMode::Guided, by);
        }
        if self.vehicle.mode != VehicleMode::Guided || !self.vehicle.armed {
            self.vehicle.ignored_targets += u32::from(self.vehicle.armed);
            return;
        }
        self.follow(asked, mask & IGNORE_VELOCITY == 0, by);
    }

    fn follow(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA, with_velocity: bool, by: Commander) {
        let numbers = [asked.x, asked.y, asked.z].map(f64::from);
        let free = numbers.map(|number| !number.is_finite());
        let mut position = self.vehicle.airframe.to_boot_frame(numbers);
        for axis in 0..3 {
            if free[axis] {
                position[axis] = match self.vehicle.guidance {
                    // The drift continues from the position that the last such target had.
                    Guidance::Target(last) if last.free[axis] => last.position[axis],
                    _ => self.vehicle.airframe.body.position[axis],
                };
            }
        }
        let velocity = match with_velocity {
            true => {
                [asked.vx, asked.vy, asked.vz].map(|speed| if speed.is_finite() { speed.into() } else { 0.0 })
            }
            false => [0.0; 3],
        };
        let radius_m = self.tuning.fence_radius_m;
        let home = self.vehicle.airframe.home_in_boot_frame();
        let away = [position[0] - home[0], position[1] - home[1]];
        if radius_m > 0.0 && away[0] * away[0] + away[1] * away[1] > radius_m * radius_m {
            // The geofence holds the aircraft inside; the target is not followed.
            self.vehicle.ignored_targets += 1;
            return;
        }
        if self.vehicle.airframe.on_ground {
            if position[2] < self.vehicle.airframe.body.position[2] - 1.0
                && !matches!(self.vehicle.guidance, Guidance::TakeOff { .. })
            {
                // Armed in OFFBOARD with a target above: it takes off.
                self.vehicle.guidance = Guidance::TakeOff { point: position, since: self.vehicle.now };
            }
            return;
        }
        self.vehicle.guidance =
            Guidance::Target(Target { position, velocity, free, since: self.vehicle.now, by });
    }
}
