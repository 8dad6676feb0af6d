//! Position targets of the companion and of ground stations.

use super::super::guidance::{Guidance, Target};
use super::super::motion::Vector;
use super::super::targets::{IGNORE_POSITION, IGNORE_VELOCITY};
use super::super::{Commander, VehicleMode};
use super::ArduCopter;
use mavlink::dialects::ardupilotmega::SET_POSITION_TARGET_LOCAL_NED_DATA;

impl ArduCopter {
    /// `SET_POSITION_TARGET_LOCAL_NED`. Never answered.
    pub(super) fn take_target(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA, by: Commander) {
        let mask = asked.type_mask.bits();
        // Velocity-only, acceleration and attitude targets are not simulated.
        if self.vehicle.mode != VehicleMode::Guided
            || !self.vehicle.armed
            || !self.vehicle.flies()
            || mask & IGNORE_POSITION != 0
        {
            self.vehicle.ignored_targets += 1;
            return;
        }
        let position = [asked.x, asked.y, asked.z];
        let velocity = if mask & IGNORE_VELOCITY == 0 { [asked.vx, asked.vy, asked.vz] } else { [0.0; 3] };
        if position.iter().chain(&velocity).any(|number| !number.is_finite()) {
            self.killed_by_nan = true;
            return;
        }
        let (position, velocity) = (position.map(f64::from), velocity.map(f64::from));
        let position = match asked.coordinate_frame as u32 {
            1 => self.vehicle.airframe.to_boot_frame(position),
            7 => self.offset(position),
            8 | 9 => self.offset(self.body_to_local(position)),
            _ => {
                self.vehicle.guidance = Guidance::Halt;
                return;
            }
        };
        if self.is_outside_fence(position) {
            self.vehicle.ignored_targets += 1;
            return;
        }
        self.vehicle.guidance =
            Guidance::Target(Target { position, velocity, free: [false; 3], since: self.vehicle.now, by });
    }

    fn offset(&self, by: Vector) -> Vector {
        let [north, east, down] = self.vehicle.airframe.body.position;
        [north + by[0], east + by[1], down + by[2]]
    }

    fn body_to_local(&self, [forward, right, down]: Vector) -> Vector {
        let [north, east] = self.vehicle.airframe.heading;
        [forward * north - right * east, forward * east + right * north, down]
    }

    fn is_outside_fence(&self, [north, east, down]: Vector) -> bool {
        let Some(fence) = self.tuning.fence else { return false };
        let home = self.vehicle.airframe.home_in_boot_frame();
        let away = [north - home[0], east - home[1]];
        let squared = away[0] * away[0] + away[1] * away[1];
        fence.radius_m.is_some_and(|radius_m| squared > radius_m * radius_m)
            || fence.height_m.is_some_and(|height_m| home[2] - down > height_m)
    }
}
