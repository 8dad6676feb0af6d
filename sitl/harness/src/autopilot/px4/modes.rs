//! The tick: modes, failsafes and targets.

use super::super::battery::Level;
use super::super::guidance::{Guidance, Target};
use super::super::{Commander, VehicleMode};
use super::Px4;
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::{MavSeverity, SET_POSITION_TARGET_LOCAL_NED_DATA};

const TICK: Duration = Duration::from_micros(20_000);
/// From touching the ground to disarming.
const LAND_DETECTION: Duration = Duration::from_millis(2_000);
/// OFFBOARD was left 1.35 s after the last target with `COM_OF_LOSS_T` 1 s.
const LOSS_MARGIN: Duration = Duration::from_millis(350);
/// A position that the estimator does not trust for this long ends the modes that need one.
const ESTIMATOR_FAILSAFE: Duration = Duration::from_secs(1);
/// `COM_OBL_RC_ACT`: hold instead of return.
const LOSS_HOLD: u32 = 5;

/// `POSITION_TARGET_TYPEMASK`: all three axes of the position, of the velocity.
const IGNORE_POSITION: u16 = 0b111;
const IGNORE_VELOCITY: u16 = 0b111 << 3;

impl Px4 {
    pub(super) fn advance(&mut self, now: Instant) {
        let now = Instant::ZERO + (now - self.booted_at);
        while self.now + TICK <= now {
            self.now = self.now + TICK;
            self.tick();
            self.report();
        }
    }

    /// Whether position targets arrive.
    pub(super) fn has_stream(&self) -> bool {
        self.target_at.is_some_and(|at| self.now - at <= self.tuning.loss_time)
    }

    fn tick(&mut self) {
        if self.airframe.home.is_none() && self.airframe.estimator_ready(self.now) {
            self.airframe.home = Some(self.airframe.estimated());
        }
        self.airframe.tick(self.now);
        let spins_up = matches!(self.guidance, Guidance::TakeOff { .. });
        if !self.airframe.on_ground || spins_up {
            self.guidance = self.guidance.fly(&mut self.airframe, &self.tuning.profile, self.now);
        }
        self.check_take_off();
        self.check_stream();
        self.check_battery();
        self.check_estimator();
        self.check_ground();
    }

    /// TAKEOFF ends in HOLD.
    fn check_take_off(&mut self) {
        if let (VehicleMode::TakeOff, Guidance::TakeOff { point, .. }) = (self.mode, self.guidance)
            && !self.airframe.on_ground
            && (self.airframe.body.position[2] - point[2]).abs() < 0.5
        {
            self.enter(VehicleMode::Hold, Commander::Autopilot);
        }
    }

    fn check_stream(&mut self) {
        if self.mode != VehicleMode::Guided || !self.armed {
            return;
        }
        let lost = self.target_at.is_none_or(|at| self.now - at > self.tuning.loss_time + LOSS_MARGIN);
        if lost {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, "Failsafe activated");
            let hold = self.tuning.loss_action == LOSS_HOLD;
            self.enter(if hold { VehicleMode::Hold } else { VehicleMode::Return }, Commander::Autopilot);
            self.offboard_lost = true;
            self.failsafe = true;
        }
    }

    fn check_battery(&mut self) {
        if !self.armed {
            return;
        }
        let [low, critical, emergency] = self.tuning.battery_levels;
        let left = self.airframe.battery.fraction();
        // The voltage injection stands for a pack at the critical level.
        let sags = self.airframe.battery.voltage_v < 10.5;
        let reached = match () {
            () if left <= emergency => Level::Emergency,
            () if left <= critical || sags => Level::Critical,
            () if left <= low => Level::Low,
            () => Level::Fine,
        };
        let Some(level) = self.airframe.battery.raise(reached) else { return };
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

    fn check_estimator(&mut self) {
        let lost = self.airframe.untrusted_since(self.now);
        let relies = self.mode == VehicleMode::Guided || self.mode.needs_position();
        if self.armed
            && !self.airframe.on_ground
            && relies
            && lost.is_some_and(|from| self.now - from > ESTIMATOR_FAILSAFE)
        {
            self.failsafe = true;
            self.offboard_lost = false;
            self.enter(VehicleMode::Land, Commander::Autopilot);
        }
    }

    fn check_ground(&mut self) {
        let lands = match self.guidance {
            Guidance::Descend(_) => true,
            // An OFFBOARD target below the ground lands too.
            Guidance::Target(target) => target.position[2] >= f64::from(self.airframe.settings.stand.down_m),
            _ => false,
        };
        if lands {
            self.airframe.touch_down(self.now);
        }
        if !(self.armed && self.airframe.on_ground) {
            return;
        }
        let idle = match self.guidance {
            Guidance::TakeOff { .. } => return,
            _ if lands => LAND_DETECTION,
            _ => self.tuning.disarm_delay,
        };
        if self.now - self.armed_at.max(self.airframe.grounded_at) >= idle {
            self.disarm();
        }
    }

    /// The mode stays as it is.
    pub(super) fn disarm(&mut self) {
        self.armed = false;
        self.guidance = Guidance::Halt;
        self.failsafe = false;
        self.offboard_lost = false;
        self.say(MavSeverity::MAV_SEVERITY_INFO, "Disarmed by landing");
    }

    /// Changes the mode; the next heartbeat reports it.
    pub(super) fn enter(&mut self, mode: VehicleMode, by: Commander) {
        if by != Commander::Autopilot {
            // A choice of the pilot or of a command ends the failsafe and what it would return to.
            self.offboard_lost = false;
            self.failsafe = false;
        }
        if self.mode == mode {
            return;
        }
        self.mode = mode;
        self.mode_by = by;
        self.guidance = match mode {
            VehicleMode::Return => Guidance::Return { over_home_until: None },
            VehicleMode::Land => Guidance::Descend(self.airframe.body.position),
            _ => Guidance::Halt,
        };
    }

    /// `SET_POSITION_TARGET_LOCAL_NED`. Never answered. A target counts as stream in every mode.
    pub(super) fn take_target(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA, by: Commander) {
        if asked.coordinate_frame as u32 != 1 {
            let frame = asked.coordinate_frame as u32;
            let text = format!("coordinate frame {frame} unsupported");
            self.say(MavSeverity::MAV_SEVERITY_ERROR, &text);
            if self.mode == VehicleMode::Guided {
                self.guidance = Guidance::Halt;
            }
            return;
        }
        let mask = asked.type_mask.bits();
        if mask & IGNORE_POSITION == IGNORE_POSITION {
            // Velocity-only, acceleration and attitude targets are not simulated.
            self.ignored_targets += 1;
            return;
        }
        self.target_at = Some(self.now);
        if self.offboard_lost && self.armed {
            self.offboard_lost = false;
            self.failsafe = false;
            self.enter(VehicleMode::Guided, by);
        }
        if self.mode != VehicleMode::Guided || !self.armed {
            self.ignored_targets += u32::from(self.armed);
            return;
        }
        self.follow(asked, mask & IGNORE_VELOCITY == 0, by);
    }

    fn follow(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA, with_velocity: bool, by: Commander) {
        let numbers = [asked.x, asked.y, asked.z].map(f64::from);
        let free = numbers.map(|number| !number.is_finite());
        let mut position = self.airframe.to_boot_frame(numbers);
        for axis in 0..3 {
            if free[axis] {
                position[axis] = match self.guidance {
                    // The drift goes on from where the last such target left it.
                    Guidance::Target(last) if last.free[axis] => last.position[axis],
                    _ => self.airframe.body.position[axis],
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
        let home = self.airframe.home_in_boot_frame();
        let away = [position[0] - home[0], position[1] - home[1]];
        if radius_m > 0.0 && away[0] * away[0] + away[1] * away[1] > radius_m * radius_m {
            // The geofence holds the aircraft inside; the target is not followed.
            self.ignored_targets += 1;
            return;
        }
        if self.airframe.on_ground {
            if position[2] < self.airframe.body.position[2] - 1.0
                && !matches!(self.guidance, Guidance::TakeOff { .. })
            {
                // Armed in OFFBOARD with a target above: it takes off.
                self.guidance = Guidance::TakeOff { point: position, since: self.now };
            }
            return;
        }
        self.guidance = Guidance::Target(Target { position, velocity, free, since: self.now, by });
    }
}
