//! How the simulated quadrotor moves: a point with limits on speed, acceleration and jerk.

/// North, east, down.
pub(crate) type Vector = [f64; 3];

/// The physics runs in steps of this length whatever the caller's rate, so that a flight is the same at every rate.
pub(crate) const TICK_S: f64 = 0.02;

/// Shape of the approach to a point. The horizontal numbers are fitted to measured flights of ArduCopter 4.6.3 with
/// default parameters; the tests below hold the measurements.
#[derive(Clone, Copy, Debug)]
struct Shape {
    /// Speed wanted per metre of distance close to the point, 1/s.
    gain_per_s: f64,
    /// Deceleration on which the approach is planned, m/s^2.
    braking_mps2: f64,
    /// Acceleration wanted per m/s of speed error, 1/s.
    stiffness_per_s: f64,
    /// Highest acceleration, m/s^2 (`WPNAV_ACCEL`, `WPNAV_ACCEL_Z`).
    acceleration_mps2: f64,
    /// Highest rate of acceleration, m/s^3.
    jerk_mps3: f64,
}

const HORIZONTAL: Shape = Shape {
    gain_per_s: 1.35,
    braking_mps2: 1.17,
    stiffness_per_s: 1.44,
    acceleration_mps2: 2.5,
    jerk_mps3: 3.1,
};

const VERTICAL: Shape = Shape {
    gain_per_s: 1.0,
    braking_mps2: 0.5,
    stiffness_per_s: 2.0,
    acceleration_mps2: 1.0,
    jerk_mps3: 2.5,
};

/// Speed limits in force, m/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpeedLimits {
    pub horizontal_mps: f64,
    pub up_mps: f64,
    pub down_mps: f64,
}

/// The aircraft as a point: position (m), velocity (m/s), acceleration (m/s^2) in the local frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Body {
    pub position: Vector,
    pub velocity: Vector,
    acceleration: Vector,
}

impl Body {
    pub fn at(position: Vector) -> Body {
        Body { position, ..Body::default() }
    }

    pub fn ground_speed_mps(&self) -> f64 {
        length([self.velocity[0], self.velocity[1]])
    }

    /// Stands still at `position` on the ground.
    pub fn rest(&mut self) {
        *self = Body::at(self.position);
    }

    /// One tick towards `target`, which itself moves with `feed_forward`.
    pub fn fly_to(&mut self, target: Vector, feed_forward: Vector, limits: SpeedLimits) {
        let error = [target[0] - self.position[0], target[1] - self.position[1]];
        let wanted = towards(error, approach_speed(&HORIZONTAL, length(error)));
        let wanted = [wanted[0] + feed_forward[0], wanted[1] + feed_forward[1]];
        self.steer(capped(wanted, limits.horizontal_mps));
        self.climb_to(target[2], feed_forward[2], limits);
        self.advance();
    }

    /// One tick with a velocity wanted.
    pub fn fly_with(&mut self, velocity: Vector, limits: SpeedLimits) {
        self.steer(capped([velocity[0], velocity[1]], limits.horizontal_mps));
        self.climb_with(velocity[2].clamp(-limits.up_mps, limits.down_mps));
        self.advance();
    }

    fn climb_to(&mut self, down_m: f64, feed_forward_mps: f64, limits: SpeedLimits) {
        let error_m = down_m - self.position[2];
        let speed = approach_speed(&VERTICAL, error_m.abs()).copysign(error_m);
        self.climb_with((speed + feed_forward_mps).clamp(-limits.up_mps, limits.down_mps));
    }

    fn steer(&mut self, wanted: [f64; 2]) {
        let error = [wanted[0] - self.velocity[0], wanted[1] - self.velocity[1]];
        let demand = towards(error, shaped_acceleration(&HORIZONTAL, length(error)));
        let change = [demand[0] - self.acceleration[0], demand[1] - self.acceleration[1]];
        let change = capped(change, HORIZONTAL.jerk_mps3 * TICK_S);
        self.acceleration[0] += change[0];
        self.acceleration[1] += change[1];
    }

    fn climb_with(&mut self, wanted_mps: f64) {
        let error = wanted_mps - self.velocity[2];
        let demand = shaped_acceleration(&VERTICAL, error.abs()).copysign(error);
        let most = VERTICAL.jerk_mps3 * TICK_S;
        self.acceleration[2] += (demand - self.acceleration[2]).clamp(-most, most);
    }

    fn advance(&mut self) {
        for axis in 0..3 {
            self.velocity[axis] += self.acceleration[axis] * TICK_S;
            self.position[axis] += self.velocity[axis] * TICK_S;
        }
    }
}

/// Proportional close by, braking with constant deceleration farther out.
fn approach_speed(shape: &Shape, distance_m: f64) -> f64 {
    soft_root(distance_m, shape.gain_per_s, shape.braking_mps2)
}

fn shaped_acceleration(shape: &Shape, error_mps: f64) -> f64 {
    soft_root(error_mps, shape.stiffness_per_s, shape.jerk_mps3).min(shape.acceleration_mps2)
}

/// `gain * x` up to where its slope meets that of `sqrt(2 * limit * x)`, then that root.
fn soft_root(x: f64, gain: f64, limit: f64) -> f64 {
    let linear_until = limit / (gain * gain);
    if x <= linear_until { gain * x } else { (2.0 * limit * (x - 0.5 * linear_until)).sqrt() }
}

fn length([north, east]: [f64; 2]) -> f64 {
    // Not hypot: square roots are exact on every platform, hypot is not.
    (north * north + east * east).sqrt()
}

fn towards(direction: [f64; 2], size: f64) -> [f64; 2] {
    let length = length(direction);
    if length > 0.0 { direction.map(|axis| axis / length * size) } else { [0.0; 2] }
}

fn capped(vector: [f64; 2], most: f64) -> [f64; 2] {
    if length(vector) > most { towards(vector, most) } else { vector }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: SpeedLimits = SpeedLimits { horizontal_mps: 10.0, up_mps: 2.5, down_mps: 1.5 };

    struct Flown {
        top_speed_mps: f64,
        overshoot_m: f64,
        first_within_s: Vec<f64>,
        end_error_m: f64,
    }

    fn fly_east(step_m: f64, seconds: f64, radii_m: &[f64]) -> Flown {
        let mut body = Body::at([0.0, 0.0, -60.0]);
        let mut flown = Flown {
            top_speed_mps: 0.0,
            overshoot_m: 0.0,
            first_within_s: vec![f64::INFINITY; radii_m.len()],
            end_error_m: 0.0,
        };
        for tick in 1..=(seconds / TICK_S) as u32 {
            body.fly_to([0.0, step_m, -60.0], [0.0; 3], LIMITS);
            flown.top_speed_mps = flown.top_speed_mps.max(body.ground_speed_mps());
            flown.overshoot_m = flown.overshoot_m.max(body.position[1] - step_m);
            flown.end_error_m = (body.position[1] - step_m).abs();
            for (first, radius) in flown.first_within_s.iter_mut().zip(radii_m) {
                if flown.end_error_m < *radius {
                    *first = first.min(f64::from(tick) * TICK_S);
                }
            }
        }
        flown
    }

    #[test]
    fn a_step_of_one_cell_looks_like_the_measured_one() {
        let flown = fly_east(20.0, 12.0, &[5.0, 2.0, 1.0, 0.5, 0.2]);
        assert!((flown.top_speed_mps - 5.4).abs() < 0.2, "{}", flown.top_speed_mps);
        for (seen, measured) in flown.first_within_s.iter().zip([4.4, 5.2, 5.6, 5.8, 6.0]) {
            assert!((seen - measured).abs() < 0.15, "{:?}", flown.first_within_s);
        }
        assert!((0.3..0.6).contains(&flown.overshoot_m), "{}", flown.overshoot_m);
        assert!(flown.end_error_m < 0.05, "{}", flown.end_error_m);
    }

    #[test]
    fn a_long_leg_reaches_the_measured_speed() {
        let flown = fly_east(60.0, 15.0, &[1.0]);
        assert!((flown.top_speed_mps - 9.1).abs() < 0.4, "{}", flown.top_speed_mps);
        assert!((flown.first_within_s[0] - 10.2).abs() < 0.4, "{:?}", flown.first_within_s);
    }

    #[test]
    fn stopping_from_cruise_takes_the_measured_way() {
        let mut body = Body::at([0.0, 0.0, -60.0]);
        while body.ground_speed_mps() < 9.4 {
            body.fly_with([10.0, 0.0, 0.0], LIMITS);
        }
        // The measured flight was in steady cruise when the pilot took over.
        body.acceleration = [0.0; 3];
        let from = body.position[0];
        let mut ticks = 0;
        while body.ground_speed_mps() > 0.3 {
            body.fly_with([0.0; 3], LIMITS);
            ticks += 1;
        }
        let (seconds, way_m) = (f64::from(ticks) * TICK_S, body.position[0] - from);
        assert!((3.3..5.6).contains(&seconds), "{seconds}");
        assert!((19.0..25.0).contains(&way_m), "{way_m}");
    }

    #[test]
    fn feed_forward_removes_the_lag_behind_a_moving_target() {
        let lag = |feed_forward: f64| {
            let mut body = Body::at([0.0, 0.0, -60.0]);
            let mut target = 0.0;
            for _ in 0..1000 {
                target += 4.0 * TICK_S;
                body.fly_to([target, 0.0, -60.0], [feed_forward, 0.0, 0.0], LIMITS);
            }
            target - body.position[0]
        };
        // Measured: 7.8 m behind a target resent at 5 Hz, 0.07 m with velocity.
        assert!((5.0..9.0).contains(&lag(0.0)), "{}", lag(0.0));
        assert!(lag(4.0).abs() < 0.2, "{}", lag(4.0));
    }
}
