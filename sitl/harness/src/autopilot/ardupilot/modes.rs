//! The tick: modes, failsafes and targets.

use super::super::battery::Level;
use super::super::guidance::{Guidance, Profile, Target};
use super::super::motion::{SpeedLimits, Vector};
use super::super::{Commander, VehicleMode};
use super::ArduCopter;
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::{MavSeverity, SET_POSITION_TARGET_LOCAL_NED_DATA};

const TICK: Duration = Duration::from_micros(20_000);
/// From touching the ground to "Disarming motors" in LAND.
const LAND_DETECTION: Duration = Duration::from_millis(1_500);
/// How long the estimator may report its position as untrusted in flight.
const ESTIMATOR_FAILSAFE: Duration = Duration::from_secs(1);

impl ArduCopter {
    pub(super) fn advance(&mut self, now: Instant) {
        let now = Instant::ZERO + (now - self.booted_at);
        while !self.killed_by_nan && self.now + TICK <= now {
            self.now = self.now + TICK;
            self.tick();
            self.report();
        }
    }

    /// Whether the estimator has been untrusted for so long that the autopilot does not rely on it.
    pub(super) fn estimator_failsafe(&self) -> bool {
        self.airframe.untrusted_since(self.now).is_some_and(|from| self.now - from > ESTIMATOR_FAILSAFE)
    }

    fn check_estimator(&mut self) {
        let relies = self.mode == VehicleMode::Guided || self.mode.needs_position();
        if self.armed && !self.airframe.on_ground && relies && self.estimator_failsafe() {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, "EKF Failsafe: changed to LAND Mode");
            self.enter(VehicleMode::Land, Commander::Autopilot);
        }
    }

    fn tick(&mut self) {
        if self.airframe.home.is_none() && self.airframe.estimator_ready(self.now) {
            self.airframe.home = Some(self.airframe.estimated());
            self.say(MavSeverity::MAV_SEVERITY_INFO, "EKF3 IMU0 origin set");
            self.announce_origin_and_home();
        }
        self.airframe.tick(self.now);
        if !self.airframe.on_ground || matches!(self.guidance, Guidance::TakeOff { .. }) {
            let limits = SpeedLimits { horizontal_mps: self.cruise_mps, ..self.tuning.profile.limits };
            let profile = Profile { limits, ..self.tuning.profile };
            self.guidance = self.guidance.fly(&mut self.airframe, &profile, self.now);
        }
        self.check_battery();
        self.check_estimator();
        self.check_ground();
    }

    fn check_ground(&mut self) {
        if matches!(self.guidance, Guidance::Descend(_)) {
            self.airframe.touch_down(self.now);
        }
        if !(self.armed && self.airframe.on_ground) {
            return;
        }
        let idle = match self.guidance {
            Guidance::TakeOff { .. } => return,
            Guidance::Descend(_) => LAND_DETECTION,
            _ => self.tuning.disarm_delay,
        };
        if idle > Duration::ZERO && self.now - self.armed_at.max(self.airframe.grounded_at) >= idle {
            self.disarm();
        }
    }

    pub(super) fn disarm(&mut self) {
        self.armed = false;
        self.guidance = Guidance::Halt;
        self.say(MavSeverity::MAV_SEVERITY_INFO, "Disarming motors");
    }

    fn check_battery(&mut self) {
        if !self.armed {
            return;
        }
        let level = self.airframe.battery.check_voltage(self.now, self.tuning.thresholds);
        let Some(level) = level else { return };
        let (word, action) = match level {
            Level::Critical => ("critical", self.parameters.value("BATT_FS_CRT_ACT")),
            _ => ("low", self.parameters.value("BATT_FS_LOW_ACT")),
        };
        let (volts, used) = (self.airframe.battery.voltage_v, self.airframe.battery.consumed_mah());
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
    pub(super) fn enter(&mut self, mode: VehicleMode, by: Commander) {
        let changed = self.mode != mode;
        self.mode = mode;
        if changed {
            self.mode_by = by;
        }
        if changed || mode != VehicleMode::Guided {
            self.guidance = match mode {
                VehicleMode::Return => Guidance::Return { over_home_until: None },
                VehicleMode::Land => Guidance::Descend(self.airframe.body.position),
                _ => Guidance::Halt,
            };
        }
        if changed {
            // WPNAV_SPEED is read when a mode begins: setting it during a leg has no effect (measured).
            self.cruise_mps = self.tuning.profile.limits.horizontal_mps;
            self.send_heartbeats();
        }
    }

    /// `SET_POSITION_TARGET_LOCAL_NED`. Never answered.
    pub(super) fn take_target(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA, by: Commander) {
        let flying = !self.airframe.on_ground || matches!(self.guidance, Guidance::TakeOff { .. });
        let mask = asked.type_mask.bits();
        // Velocity-only, acceleration and attitude targets are not simulated.
        if self.mode != VehicleMode::Guided || !self.armed || !flying || mask & IGNORE_POSITION != 0 {
            self.ignored_targets += 1;
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
            1 => self.airframe.to_boot_frame(position),
            7 => self.offset(position),
            8 | 9 => self.offset(self.body_to_local(position)),
            _ => {
                self.guidance = Guidance::Halt;
                return;
            }
        };
        if self.is_outside_fence(position) {
            self.ignored_targets += 1;
            return;
        }
        self.guidance =
            Guidance::Target(Target { position, velocity, free: [false; 3], since: self.now, by });
    }

    fn offset(&self, by: Vector) -> Vector {
        let [north, east, down] = self.airframe.body.position;
        [north + by[0], east + by[1], down + by[2]]
    }

    fn body_to_local(&self, [forward, right, down]: Vector) -> Vector {
        let [north, east] = self.airframe.heading;
        [forward * north - right * east, forward * east + right * north, down]
    }

    fn is_outside_fence(&self, [north, east, down]: Vector) -> bool {
        let Some(fence) = self.tuning.fence else { return false };
        let home = self.airframe.home_in_boot_frame();
        let away = [north - home[0], east - home[1]];
        let squared = away[0] * away[0] + away[1] * away[1];
        fence.radius_m.is_some_and(|radius_m| squared > radius_m * radius_m)
            || fence.height_m.is_some_and(|height_m| home[2] - down > height_m)
    }
}

/// `POSITION_TARGET_TYPEMASK`: all three axes of the position, of the velocity.
const IGNORE_POSITION: u16 = 0b111;
const IGNORE_VELOCITY: u16 = 0b111 << 3;
