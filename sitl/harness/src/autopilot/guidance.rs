//! Modes and the motion that they make.

use super::battery::{Level, Thresholds};
use super::motion::{SpeedLimits, TICK_S, Vector};
use super::{Copter, CopterMode};
use gleaner_units::{Duration, Instant, Ned};
use mavlink::dialects::ardupilotmega::{MavSeverity, SET_POSITION_TARGET_LOCAL_NED_DATA};
use rand::RngExt;

/// What the aircraft is doing, within its mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Guidance {
    /// Stops, then holds the point where it stopped.
    Halt,
    /// Holds a point.
    Hold(Vector),
    /// Climbs straight up after the motors have spun up.
    TakeOff { point: Vector, since: Instant },
    /// A position target of GUIDED.
    Target(Target),
    /// Flies home, waits until the moment given, lands.
    Return { over_home_until: Option<Instant> },
    /// Goes down over this point.
    Descend(Vector),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Target {
    pub position: Vector,
    pub velocity: Vector,
    pub since: Instant,
}

const TICK: Duration = Duration::from_micros(20_000);
/// From `NAV_TAKEOFF` to the first centimetre: 29.0 s to 59 m were measured at 2.5 m/s.
const SPIN_UP: Duration = Duration::from_millis(3_300);
/// From touching the ground to "Disarming motors" in LAND.
const LAND_DETECTION: Duration = Duration::from_millis(1_500);
/// The estimator has found itself.
const ESTIMATOR_READY: Instant = Instant::from_millis(8_000);
/// How long it may mistrust itself in flight.
const ESTIMATOR_FAILSAFE: Duration = Duration::from_secs(1);
/// How long the position estimate's wander remembers itself.
const WANDER_TIME_S: f64 = 8.0;

impl Copter {
    /// Lets time pass until `now`, in ticks of 20 ms.
    pub fn step(&mut self, now: Instant) {
        let now = Instant::ZERO + (now - self.booted_at);
        while !self.killed_by_nan && self.now + TICK <= now {
            self.now = self.now + TICK;
            self.tick();
            self.report();
        }
    }

    pub(super) fn estimator_ready(&self) -> bool {
        let is_lost = self.estimator_lost.is_some_and(|(from, to)| (from..to).contains(&self.now));
        self.now >= ESTIMATOR_READY && !is_lost
    }

    /// Whether the estimator has mistrusted itself for so long that the autopilot does not rely on it.
    pub(super) fn estimator_failsafe(&self) -> bool {
        let since = self.estimator_lost.map(|(from, _)| from).filter(|_| !self.estimator_ready());
        since.is_some_and(|from| self.now - from > ESTIMATOR_FAILSAFE)
    }

    fn check_estimator(&mut self) {
        let relies = self.mode == CopterMode::Guided || self.mode.needs_position();
        if self.armed && !self.on_ground && relies && self.estimator_failsafe() {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, "EKF Failsafe: changed to LAND Mode");
            self.enter(CopterMode::Land, false);
        }
    }

    fn tick(&mut self) {
        if self.home.is_none() && self.estimator_ready() {
            self.estimator_finds_itself();
        }
        self.wander();
        if !self.on_ground || matches!(self.guidance, Guidance::TakeOff { .. }) {
            self.fly();
        }
        self.battery.draw((!self.on_ground).then(|| self.body.ground_speed_mps()));
        self.check_battery();
        self.check_estimator();
        self.check_ground();
    }

    fn estimator_finds_itself(&mut self) {
        self.home = Some(self.estimated());
        self.say(MavSeverity::MAV_SEVERITY_INFO, "EKF3 IMU0 origin set");
        self.announce_origin_and_home();
    }

    /// Where the autopilot believes to be.
    pub(super) fn estimated(&self) -> Ned {
        let [north_m, east_m, down_m] = self.body.position.map(|metres| metres as f32);
        Ned { north_m, east_m, down_m }
    }

    fn wander(&mut self) {
        if self.settings.wander_m <= 0.0 {
            return;
        }
        // A first-order Gauss-Markov process; the sum of twelve uniform numbers stands in for a normal one.
        let step = f64::from(self.settings.wander_m) * (2.0 * TICK_S / WANDER_TIME_S).sqrt();
        for axis in 0..3 {
            let normal: f64 = (0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0;
            self.wander[axis] += step * normal - self.wander[axis] * TICK_S / WANDER_TIME_S;
        }
    }

    fn limits(&self) -> SpeedLimits {
        let metres = |name| self.parameters.value(name) / 100.0;
        SpeedLimits {
            horizontal_mps: self.cruise_mps,
            up_mps: metres("WPNAV_SPEED_UP"),
            down_mps: metres("WPNAV_SPEED_DN"),
        }
    }

    fn fly(&mut self) {
        let limits = self.limits();
        match self.guidance {
            Guidance::Halt => {
                self.body.fly_with([0.0; 3], limits);
                let [north, east, down] = self.body.velocity;
                if north * north + east * east + down * down < 0.01 {
                    self.guidance = Guidance::Hold(self.body.position);
                }
            }
            Guidance::Hold(point) => self.body.fly_to(point, [0.0; 3], limits),
            Guidance::TakeOff { point, since } => {
                if self.now - since >= SPIN_UP {
                    self.on_ground = false;
                    self.body.fly_to(point, [0.0; 3], limits);
                }
            }
            Guidance::Target(target) => self.fly_to_target(target, limits),
            Guidance::Return { over_home_until } => self.fly_home(over_home_until, limits),
            Guidance::Descend(point) => self.descend(point, limits),
        }
        self.turn_to_course();
    }

    fn fly_to_target(&mut self, target: Target, limits: SpeedLimits) {
        let timeout = Duration::from_secs_f32(self.parameters.value("GUID_TIMEOUT") as f32);
        let moving = target.velocity != [0.0; 3];
        let mut next = target;
        if moving && self.now - target.since > timeout {
            // A stream with velocities has ended: the target stands.
            next.velocity = [0.0; 3];
        }
        for axis in 0..3 {
            next.position[axis] += next.velocity[axis] * TICK_S;
        }
        self.guidance = Guidance::Target(next);
        self.body.fly_to(next.position, next.velocity, limits);
    }

    fn fly_home(&mut self, over_home_until: Option<Instant>, limits: SpeedLimits) {
        let home = self.home.unwrap_or(self.settings.stand);
        let height_m = self.height_above(home).max(self.parameters.value("RTL_ALT") / 100.0);
        let point = [home.north_m.into(), home.east_m.into(), f64::from(home.down_m) - height_m];
        self.body.fly_to(point, [0.0; 3], limits);
        let [north, east, _] = self.body.position;
        let away = [north - point[0], east - point[1]];
        let over_home = away[0] * away[0] + away[1] * away[1] < 4.0 && self.body.ground_speed_mps() < 0.5;
        match over_home_until {
            None if over_home => {
                let wait = Duration::from_secs_f32(self.parameters.value("RTL_LOIT_TIME") as f32 / 1000.0);
                self.guidance = Guidance::Return { over_home_until: Some(self.now + wait) };
            }
            Some(until) if self.now >= until => self.guidance = Guidance::Descend(point),
            _ => {}
        }
    }

    fn height_above(&self, home: Ned) -> f64 {
        f64::from(home.down_m) - self.body.position[2]
    }

    fn descend(&mut self, point: Vector, limits: SpeedLimits) {
        let height_m = f64::from(self.settings.stand.down_m) - self.body.position[2];
        let slow = height_m < self.parameters.value("LAND_ALT_LOW") / 100.0;
        let down_mps = if slow { self.parameters.value("LAND_SPEED") / 100.0 } else { limits.down_mps };
        let below = [point[0], point[1], self.body.position[2] + 10.0];
        self.body.fly_to(below, [0.0; 3], SpeedLimits { down_mps, ..limits });
    }

    /// `WP_YAW_BEHAVIOR` 2: the nose turns to the course. At once here.
    fn turn_to_course(&mut self) {
        let speed = self.body.ground_speed_mps();
        if speed > 1.0 {
            self.heading = [self.body.velocity[0] / speed, self.body.velocity[1] / speed];
        }
    }

    fn check_ground(&mut self) {
        let ground_down_m = f64::from(self.settings.stand.down_m);
        let descending = matches!(self.guidance, Guidance::Descend(_));
        if !self.on_ground && descending && self.body.position[2] >= ground_down_m {
            self.on_ground = true;
            self.grounded_at = self.now;
            self.body.position[2] = ground_down_m;
            self.body.rest();
        }
        if !(self.armed && self.on_ground) {
            return;
        }
        let idle = match self.guidance {
            Guidance::TakeOff { .. } => return,
            Guidance::Descend(_) => LAND_DETECTION,
            // Measured 10.4 s with the default of 10.
            _ => Duration::from_secs_f32(self.parameters.value("DISARM_DELAY") as f32 + 0.4),
        };
        if idle > Duration::ZERO && self.now - self.armed_at.max(self.grounded_at) >= idle {
            self.disarm();
        }
    }

    pub(super) fn disarm(&mut self) {
        self.armed = false;
        self.guidance = Guidance::Halt;
        self.say(MavSeverity::MAV_SEVERITY_INFO, "Disarming motors");
    }

    fn check_battery(&mut self) {
        let thresholds = Thresholds {
            low_v: self.parameters.value("BATT_LOW_VOLT") as f32,
            critical_v: self.parameters.value("BATT_CRT_VOLT") as f32,
            timer: Duration::from_secs_f32(self.parameters.value("BATT_LOW_TIMER") as f32),
        };
        if !self.armed {
            return;
        }
        let Some(level) = self.battery.check(self.now, thresholds) else { return };
        let (word, action) = match level {
            Level::Critical => ("critical", self.parameters.value("BATT_FS_CRT_ACT")),
            _ => ("low", self.parameters.value("BATT_FS_LOW_ACT")),
        };
        let (volts, used) = (self.battery.voltage_v, self.battery.consumed_mah());
        let text = format!("Battery 1 is {word} {volts:.2}V used {used} mAh");
        self.say(MavSeverity::MAV_SEVERITY_WARNING, &text);
        self.say(MavSeverity::MAV_SEVERITY_WARNING, "Battery Failsafe");
        match action as u8 {
            1 => self.enter(CopterMode::Land, false),
            2 => self.enter(CopterMode::Rtl, false),
            _ => {}
        }
    }

    /// Changes the mode, whoever asks; the heartbeat says so at once. Who asks for what is so already changes nothing.
    pub(super) fn enter(&mut self, mode: CopterMode, by_companion: bool) {
        let changed = self.mode != mode;
        self.mode = mode;
        if changed {
            self.mode_is_companions = by_companion;
        }
        if changed || mode != CopterMode::Guided {
            self.guidance = match mode {
                CopterMode::Rtl => Guidance::Return { over_home_until: None },
                CopterMode::Land => Guidance::Descend(self.body.position),
                _ => Guidance::Halt,
            };
        }
        if changed {
            // The parameter is read when a mode begins: setting it in mid-leg has no effect (measured).
            self.cruise_mps = self.parameters.value("WPNAV_SPEED") / 100.0;
            self.send_heartbeats();
        }
    }

    /// `SET_POSITION_TARGET_LOCAL_NED`. Never answered.
    pub(super) fn take_target(&mut self, asked: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        let in_the_air = !self.on_ground || matches!(self.guidance, Guidance::TakeOff { .. });
        if self.mode != CopterMode::Guided || !self.armed || !in_the_air {
            self.ignored_targets += 1;
            return;
        }
        let mask = asked.type_mask.bits();
        if mask & IGNORE_POSITION != 0 {
            // Velocity-only, acceleration and attitude flight are not simulated; a real one would fly them.
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
            1 => position,
            7 => self.offset(position),
            8 | 9 => self.offset(self.body_to_local(position)),
            _ => {
                self.guidance = Guidance::Halt;
                return;
            }
        };
        if self.is_beyond_fence(position) {
            self.ignored_targets += 1;
            return;
        }
        self.guidance = Guidance::Target(Target { position, velocity, since: self.now });
    }

    fn offset(&self, by: Vector) -> Vector {
        let [north, east, down] = self.body.position;
        [north + by[0], east + by[1], down + by[2]]
    }

    fn body_to_local(&self, [forward, right, down]: Vector) -> Vector {
        let [north, east] = self.heading;
        [forward * north - right * east, forward * east + right * north, down]
    }

    fn is_beyond_fence(&self, [north, east, down]: Vector) -> bool {
        let home = self.home.unwrap_or(self.settings.stand);
        let kinds = self.parameters.value("FENCE_TYPE") as u32;
        if self.parameters.value("FENCE_ENABLE") == 0.0 {
            return false;
        }
        let away = [north - f64::from(home.north_m), east - f64::from(home.east_m)];
        let radius_m = self.parameters.value("FENCE_RADIUS");
        let too_far = kinds & 2 != 0 && away[0] * away[0] + away[1] * away[1] > radius_m * radius_m;
        let too_high =
            kinds & 1 != 0 && f64::from(home.down_m) - down > self.parameters.value("FENCE_ALT_MAX");
        too_far || too_high
    }
}

/// `POSITION_TARGET_TYPEMASK`: all three axes of the position, of the velocity.
const IGNORE_POSITION: u16 = 0b111;
const IGNORE_VELOCITY: u16 = 0b111 << 3;
