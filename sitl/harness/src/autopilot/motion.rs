//! Motion of the simulated quadrotor: a point with limits on speed, acceleration and jerk.

/// North, east, down.
pub(super) type Vector = [f64; 3];

/// The physics advances in ticks of this length at every polling rate, so that a flight does not depend on the rate.
pub(super) const TICK_S: f64 = 0.02;

/// How the position controller approaches a point. The horizontal numbers are fitted to flights of the autopilots' own
/// simulators with default parameters; the tests below hold the measurements.
#[derive(Clone, Copy, Debug)]
struct Shape {
    /// Commanded speed per metre of distance close to the point, 1/s.
    gain_per_s: f64,
    /// Deceleration on which the approach is planned, m/s^2.
    braking_mps2: f64,
    /// Commanded acceleration per m/s of speed error, 1/s.
    stiffness_per_s: f64,
    /// Highest acceleration, m/s^2.
    acceleration_mps2: f64,
    /// Highest rate of acceleration, m/s^3.
    jerk_mps3: f64,
}

/// The response of one autopilot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Response {
    horizontal: Shape,
    vertical: Shape,
}

const VERTICAL: Shape = Shape {
    gain_per_s: 1.0,
    braking_mps2: 0.5,
    stiffness_per_s: 2.0,
    acceleration_mps2: 1.0,
    jerk_mps3: 2.5,
};

impl Response {
    /// ArduCopter 4.6.3 with `WPNAV_ACCEL` 250.
    pub const ARDUCOPTER: Response = Response {
        horizontal: Shape {
            gain_per_s: 2.341,
            braking_mps2: 1.162,
            stiffness_per_s: 1.693,
            acceleration_mps2: 2.5,
            jerk_mps3: 3.96,
        },
        vertical: VERTICAL,
    };

    /// PX4 1.18.
    pub const PX4: Response = Response {
        horizontal: Shape {
            gain_per_s: 0.74,
            braking_mps2: 3.906,
            stiffness_per_s: 1.615,
            acceleration_mps2: 5.008,
            jerk_mps3: 17.994,
        },
        vertical: VERTICAL,
    };
}

/// Speed limits in force, m/s.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedLimits {
    pub horizontal_mps: f64,
    pub up_mps: f64,
    pub down_mps: f64,
}

/// The aircraft as a point: position (m), velocity (m/s), acceleration (m/s^2) in the local frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    response: Response,
    pub position: Vector,
    pub velocity: Vector,
    acceleration: Vector,
}

impl Body {
    /// A body at rest.
    pub const fn at(position: Vector, response: Response) -> Body {
        Body { response, position, velocity: [0.0; 3], acceleration: [0.0; 3] }
    }

    pub fn ground_speed_mps(&self) -> f64 {
        length([self.velocity[0], self.velocity[1]])
    }

    pub fn speed_squared(&self) -> f64 {
        self.velocity.iter().map(|axis| axis * axis).sum()
    }

    /// Stops at once, on the ground.
    pub fn rest(&mut self) {
        *self = Body::at(self.position, self.response);
    }

    /// One tick towards `target`, which itself moves with `feed_forward`.
    pub fn fly_to(&mut self, target: Vector, feed_forward: Vector, limits: SpeedLimits) {
        let error = [target[0] - self.position[0], target[1] - self.position[1]];
        let commanded = towards(error, approach_speed(&self.response.horizontal, length(error)));
        let commanded = [commanded[0] + feed_forward[0], commanded[1] + feed_forward[1]];
        self.steer(capped(commanded, limits.horizontal_mps));
        self.climb_to(target[2], feed_forward[2], limits);
        self.advance();
    }

    /// One tick with a commanded velocity.
    pub fn fly_with(&mut self, velocity: Vector, limits: SpeedLimits) {
        self.steer(capped([velocity[0], velocity[1]], limits.horizontal_mps));
        self.climb_with(velocity[2].clamp(-limits.up_mps, limits.down_mps));
        self.advance();
    }

    fn climb_to(&mut self, down_m: f64, feed_forward_mps: f64, limits: SpeedLimits) {
        let error_m = down_m - self.position[2];
        let speed = approach_speed(&self.response.vertical, error_m.abs()).copysign(error_m);
        self.climb_with((speed + feed_forward_mps).clamp(-limits.up_mps, limits.down_mps));
    }

    fn steer(&mut self, commanded: [f64; 2]) {
        let shape = &self.response.horizontal;
        let error = [commanded[0] - self.velocity[0], commanded[1] - self.velocity[1]];
        let demand = towards(error, shaped_acceleration(shape, length(error)));
        let change = [demand[0] - self.acceleration[0], demand[1] - self.acceleration[1]];
        let change = capped(change, shape.jerk_mps3 * TICK_S);
        self.acceleration[0] += change[0];
        self.acceleration[1] += change[1];
    }

    fn climb_with(&mut self, commanded_mps: f64) {
        let shape = &self.response.vertical;
        let error = commanded_mps - self.velocity[2];
        let demand = shaped_acceleration(shape, error.abs()).copysign(error);
        let most = shape.jerk_mps3 * TICK_S;
        self.acceleration[2] += (demand - self.acceleration[2]).clamp(-most, most);
    }

    fn advance(&mut self) {
        for axis in 0..3 {
            self.velocity[axis] += self.acceleration[axis] * TICK_S;
            self.position[axis] += self.velocity[axis] * TICK_S;
        }
    }
}

/// Proportional near the target, constant deceleration farther out.
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
    const RADII_M: [f64; 5] = [5.0, 2.0, 1.0, 0.5, 0.2];

    struct StepResponse {
        top_speed_mps: f64,
        overshoot_m: f64,
        first_within_s: [f64; 5],
        end_error_m: f64,
    }

    fn fly_east(response: Response, step_m: f64, seconds: f64) -> StepResponse {
        let mut body = Body::at([0.0, 0.0, -60.0], response);
        let mut flown = StepResponse {
            top_speed_mps: 0.0,
            overshoot_m: 0.0,
            first_within_s: [f64::INFINITY; 5],
            end_error_m: 0.0,
        };
        for tick in 1..=(seconds / TICK_S) as u32 {
            body.fly_to([0.0, step_m, -60.0], [0.0; 3], LIMITS);
            flown.top_speed_mps = flown.top_speed_mps.max(body.ground_speed_mps());
            flown.overshoot_m = flown.overshoot_m.max(body.position[1] - step_m);
            flown.end_error_m = (body.position[1] - step_m).abs();
            for (first, radius) in flown.first_within_s.iter_mut().zip(RADII_M) {
                if flown.end_error_m < radius {
                    *first = first.min(f64::from(tick) * TICK_S);
                }
            }
        }
        flown
    }

    #[test]
    fn a_step_of_one_cell_matches_the_measurement() {
        let measured = [
            (Response::ARDUCOPTER, 5.4, [4.4, 5.2, 5.6, 5.8, 6.0]),
            (Response::PX4, 8.0, [2.9, 3.5, 3.9, 4.1, 4.3]),
        ];
        for (response, top_mps, times_s) in measured {
            let flown = fly_east(response, 20.0, 12.0);
            assert!((flown.top_speed_mps - top_mps).abs() < 0.3, "{}", flown.top_speed_mps);
            for (seen, measured) in flown.first_within_s.iter().zip(times_s) {
                assert!((seen - measured).abs() < 0.2, "{:?}", flown.first_within_s);
            }
            assert!((0.3..0.7).contains(&flown.overshoot_m), "{}", flown.overshoot_m);
            assert!(flown.end_error_m < 0.05, "{}", flown.end_error_m);
        }
    }

    #[test]
    fn a_long_leg_reaches_the_measured_speed() {
        let flown = fly_east(Response::ARDUCOPTER, 60.0, 15.0);
        assert!((flown.top_speed_mps - 9.1).abs() < 0.4, "{}", flown.top_speed_mps);
        assert!((flown.first_within_s[2] - 10.2).abs() < 0.4, "{:?}", flown.first_within_s);
    }

    /// Targets one cell apart, the next sent when a 10 Hz position shows the last within 2 m: seconds a cell, lowest
    /// and highest speed.
    fn saw_tooth(response: Response) -> [f64; 3] {
        let mut body = Body::at([0.0, 0.0, -60.0], response);
        let (mut target, mut arrivals) = (20.0, Vec::new());
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        for tick in 1..2000 {
            body.fly_to([0.0, target, -60.0], [0.0; 3], LIMITS);
            if tick % 5 == 0 && target - body.position[1] < 2.0 {
                arrivals.push(f64::from(tick) * TICK_S);
                target += 20.0;
            }
            if arrivals.len() > 1 {
                low = low.min(body.ground_speed_mps());
                high = high.max(body.ground_speed_mps());
            }
        }
        let cells = arrivals.len() - 1;
        [(arrivals[cells] - arrivals[0]) / cells as f64, low, high]
    }

    #[test]
    fn targets_one_cell_apart_make_the_measured_saw_tooth() {
        for (response, measured) in
            [(Response::ARDUCOPTER, [4.80, 2.2, 5.5]), (Response::PX4, [3.32, 3.2, 8.2])]
        {
            let [seconds, low, high] = saw_tooth(response);
            assert!((seconds - measured[0]).abs() < 0.12, "{seconds} s a cell");
            assert!((low - measured[1]).abs() < 0.4 && (high - measured[2]).abs() < 0.3, "{low} to {high}");
        }
    }

    #[test]
    fn stopping_from_cruise_takes_the_measured_distance() {
        let mut body = Body::at([0.0, 0.0, -60.0], Response::ARDUCOPTER);
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
        let (seconds, distance_m) = (f64::from(ticks) * TICK_S, body.position[0] - from);
        assert!((3.3..5.6).contains(&seconds), "{seconds}");
        assert!((19.0..25.0).contains(&distance_m), "{distance_m}");
    }

    #[test]
    fn feed_forward_removes_the_lag_behind_a_moving_target() {
        let lag = |response: Response, feed_forward: f64| {
            let mut body = Body::at([0.0, 0.0, -60.0], response);
            let mut target = 0.0;
            for _ in 0..1000 {
                target += 4.0 * TICK_S;
                body.fly_to([target, 0.0, -60.0], [feed_forward, 0.0, 0.0], LIMITS);
            }
            target - body.position[0]
        };
        // Measured with targets resent at 5 Hz: 7.8 m and 5 to 6 m; with feed-forward 0.07 m and 0 to 0.7 m.
        for (response, range_m) in [(Response::ARDUCOPTER, 5.0..9.0), (Response::PX4, 4.5..7.0)] {
            assert!(range_m.contains(&lag(response, 0.0)), "{}", lag(response, 0.0));
            assert!(lag(response, 4.0).abs() < 0.2, "{}", lag(response, 4.0));
        }
    }
}
