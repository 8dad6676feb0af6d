//! What the position controller is doing, and how it moves the airframe.

use super::Commander;
use super::airframe::Airframe;
use super::motion::{SpeedLimits, TICK_S, Vector};
use gleaner_units::{Duration, Instant};

/// The present manoeuvre. Points are in the boot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Guidance {
    /// Stops, then holds the point where it stopped.
    Halt,
    /// Holds a point.
    Hold(Vector),
    /// Climbs straight up after the motors have spun up.
    TakeOff { point: Vector, since: Instant },
    /// Flies to a position target.
    Target(Target),
    /// Flies home, waits there until the given time, then lands.
    Return { over_home_until: Option<Instant> },
    /// Descends over this point.
    Descend(Vector),
}

/// A position target of a companion or a ground station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Target {
    pub position: Vector,
    pub velocity: Vector,
    /// Axes without control, on which the aircraft drifts.
    pub free: [bool; 3],
    pub since: Instant,
    pub by: Commander,
}

/// Speed of the drift on an uncontrolled axis, m/s: 2.8 m in 4 s were measured on PX4.
const DRIFT_MPS: f64 = 0.7;

/// Constants of the manoeuvres, from the autopilot's parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    pub limits: SpeedLimits,
    /// From the take-off command to leaving the ground.
    pub spin_up: Duration,
    /// A target with a velocity stops moving when it is older than this.
    pub target_timeout: Duration,
    /// Lowest height of a return, m.
    pub return_height_m: f64,
    /// Wait over home before landing.
    pub return_wait: Duration,
    /// Below this height, m, a landing descends at `land_mps`.
    pub land_slow_below_m: f64,
    pub land_mps: f64,
    /// Whether the nose turns to the course.
    pub turns_to_course: bool,
}

impl Guidance {
    /// Who sent the target in force.
    pub const fn target_by(&self) -> Option<Commander> {
        match self {
            Guidance::Target(target) => Some(target.by),
            _ => None,
        }
    }

    /// One tick in the air, or of spinning up. The next guidance.
    pub fn fly(self, airframe: &mut Airframe, profile: &Profile, now: Instant) -> Guidance {
        let limits = profile.limits;
        let next = match self {
            Guidance::Halt => {
                airframe.body.fly_with([0.0; 3], limits);
                if airframe.body.speed_squared() < 0.01 {
                    Guidance::Hold(airframe.body.position)
                } else {
                    Guidance::Halt
                }
            }
            Guidance::Hold(point) => {
                airframe.body.fly_to(point, [0.0; 3], limits);
                self
            }
            Guidance::TakeOff { point, since } => {
                if now - since >= profile.spin_up {
                    airframe.on_ground = false;
                    airframe.body.fly_to(point, [0.0; 3], limits);
                }
                self
            }
            Guidance::Target(target) => Guidance::Target(target.fly(airframe, profile, now)),
            Guidance::Return { over_home_until } => fly_home(over_home_until, airframe, profile, now),
            Guidance::Descend(point) => {
                let slow = airframe.height_m() < profile.land_slow_below_m;
                let down_mps = if slow { profile.land_mps } else { limits.down_mps };
                let below = [point[0], point[1], airframe.body.position[2] + 10.0];
                airframe.body.fly_to(below, [0.0; 3], SpeedLimits { down_mps, ..limits });
                self
            }
        };
        let speed = airframe.body.ground_speed_mps();
        if profile.turns_to_course && speed > 1.0 {
            airframe.heading = [airframe.body.velocity[0] / speed, airframe.body.velocity[1] / speed];
        }
        next
    }
}

impl Target {
    fn fly(mut self, airframe: &mut Airframe, profile: &Profile, now: Instant) -> Target {
        let moving = self.velocity != [0.0; 3];
        if moving && now - self.since > profile.target_timeout {
            // The stream of targets with velocities has ended: the target stops.
            self.velocity = [0.0; 3];
        }
        for axis in 0..3 {
            let drift = if self.free[axis] { DRIFT_MPS } else { 0.0 };
            self.position[axis] += (self.velocity[axis] + drift) * TICK_S;
        }
        airframe.body.fly_to(self.position, self.velocity, profile.limits);
        self
    }
}

fn fly_home(
    over_home_until: Option<Instant>,
    airframe: &mut Airframe,
    profile: &Profile,
    now: Instant,
) -> Guidance {
    let home = airframe.home_in_boot_frame();
    let height_m = (home[2] - airframe.body.position[2]).max(profile.return_height_m);
    let point = [home[0], home[1], home[2] - height_m];
    airframe.body.fly_to(point, [0.0; 3], profile.limits);
    let [north, east, _] = airframe.body.position;
    let away = [north - point[0], east - point[1]];
    let over_home = away[0] * away[0] + away[1] * away[1] < 4.0 && airframe.body.ground_speed_mps() < 0.5;
    match over_home_until {
        None if over_home => Guidance::Return { over_home_until: Some(now + profile.return_wait) },
        Some(until) if now >= until => Guidance::Descend(point),
        _ => Guidance::Return { over_home_until },
    }
}
