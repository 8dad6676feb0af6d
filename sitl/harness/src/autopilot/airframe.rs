//! The aircraft below the autopilot: body, battery, ground, wind, and the errors of its estimator.
//!
//! Three frames, all north-east-down in metres:
//! - **boot frame**: the estimator's frame as it was at boot; the body is kept in it.
//! - **local frame**: what the autopilot reports and takes targets in. It differs from the boot frame after an origin
//!   shift.
//! - **truth**: the boot frame without the estimator's error, for the referee.

use super::battery::Battery;
use super::motion::{Body, Response, TICK_S, Vector};
use super::{AircraftFault, AircraftSettings, Wind};
use gleaner_units::{GeoPoint, Instant, Metres, Ned};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Correlation time of the position estimate's wander.
const WANDER_TIME_S: f64 = 8.0;
/// Correlation time of a gust.
const GUST_TIME_S: f64 = 3.0;
/// Ticks between two steps of the random processes.
const NOISE_TICKS: u32 = 10;
/// Acceleration per m/s of gust, 1/s: what the controller must compensate.
const GUST_PUSH_PER_S: f64 = 0.1;
/// Rate at which an [`AircraftFault::AltitudeLoss`] pulls the aircraft down, m/s.
const SINK_MPS: f64 = 6.0;
/// An altitude loss leaves this much height, m.
const SINK_FLOOR_M: f64 = 8.0;
/// From boot until the estimator has a position.
const ESTIMATOR_READY: Instant = Instant::from_millis(8_000);

/// The aircraft.
#[derive(Debug)]
pub(super) struct Airframe {
    pub settings: AircraftSettings,
    pub body: Body,
    pub battery: Battery,
    pub on_ground: bool,
    pub grounded_at: Instant,
    /// Unit vector of the nose.
    pub heading: [f64; 2],
    /// Take-off point in the local frame, once the estimator has a position.
    pub home: Option<Ned>,
    response: Response,
    wander: Vector,
    jump: Option<([f64; 2], Instant)>,
    /// Boot frame minus local frame.
    origin_offset: [f64; 2],
    untrusted: Option<(Instant, Instant)>,
    sink_left_m: f64,
    wind: Wind,
    gust: [f64; 2],
    noise_ticks: u32,
    rng: ChaCha8Rng,
}

impl Airframe {
    /// At rest on the ground, battery full.
    pub fn new(settings: AircraftSettings, response: Response) -> Airframe {
        let Ned { north_m, east_m, down_m } = settings.stand;
        Airframe {
            settings,
            body: Body::at([north_m, east_m, down_m].map(f64::from), response),
            battery: Battery::new(settings.pack),
            on_ground: true,
            grounded_at: Instant::ZERO,
            heading: [1.0, 0.0],
            home: None,
            response,
            wander: [0.0; 3],
            jump: None,
            origin_offset: [0.0; 2],
            untrusted: None,
            sink_left_m: 0.0,
            wind: Wind::default(),
            gust: [0.0; 2],
            noise_ticks: 0,
            rng: ChaCha8Rng::seed_from_u64(settings.seed),
        }
    }

    /// The same aircraft after its autopilot booted again: on the ground below, estimator at its beginning.
    pub fn rebooted(self) -> Airframe {
        let [north, east, _] = self.body.position;
        let ground = f64::from(self.settings.stand.down_m);
        Airframe {
            body: Body::at([north, east, ground], self.response),
            on_ground: true,
            grounded_at: Instant::ZERO,
            home: None,
            untrusted: None,
            jump: None,
            sink_left_m: 0.0,
            ..self
        }
    }

    /// Injects the faults of the aircraft and its estimator; the autopilots handle the others themselves.
    pub fn inject(&mut self, now: Instant, fault: AircraftFault) {
        match fault {
            AircraftFault::Voltage(volts) => self.battery.voltage_v = volts,
            AircraftFault::ChargeLost(units) => self.battery.lose(units),
            AircraftFault::BatteryUnknown(lasts) => self.battery.hide_until(now + lasts),
            AircraftFault::Consumption(factor) => self.battery.consumption = factor.into(),
            AircraftFault::Wind(wind) => self.wind = wind,
            AircraftFault::EstimatorUntrusted(lasts) => self.untrusted = Some((now, now + lasts)),
            AircraftFault::OriginShift(shift) => {
                for (offset, shift) in self.origin_offset.iter_mut().zip(shift) {
                    *offset += f64::from(shift);
                }
            }
            AircraftFault::PositionJump(jump, lasts) => {
                self.end_jump();
                let jump = jump.map(f64::from);
                self.move_estimate(jump, 1.0);
                self.jump = Some((jump, now + lasts));
            }
            AircraftFault::AltitudeLoss(metres) => self.sink_left_m = metres.into(),
            AircraftFault::Reboot | AircraftFault::Fence(_) | AircraftFault::PilotSelects(_) => {}
        }
    }

    fn move_estimate(&mut self, [north, east]: [f64; 2], sign: f64) {
        self.body.position[0] += sign * north;
        self.body.position[1] += sign * east;
        self.wander[0] += sign * north;
        self.wander[1] += sign * east;
    }

    fn end_jump(&mut self) {
        if let Some((jump, _)) = self.jump.take() {
            self.move_estimate(jump, -1.0);
        }
    }

    /// One tick of everything that is not commanded: estimator error, gusts, altitude loss, battery.
    pub fn tick(&mut self, now: Instant) {
        if self.jump.is_some_and(|(_, until)| now >= until) {
            self.end_jump();
        }
        self.noise_ticks += 1;
        if self.noise_ticks == NOISE_TICKS {
            self.noise_ticks = 0;
            self.advance_noise();
        }
        let airborne = !self.on_ground;
        if airborne {
            for axis in 0..2 {
                self.body.velocity[axis] += self.gust[axis] * GUST_PUSH_PER_S * TICK_S;
            }
            if self.sink_left_m > 0.0 {
                let down = SINK_MPS * TICK_S;
                let floor = f64::from(self.settings.stand.down_m) - SINK_FLOOR_M;
                self.body.position[2] = (self.body.position[2] + down).min(floor.max(self.body.position[2]));
                self.sink_left_m -= down;
            }
        }
        let descends = self.body.velocity[2] > 0.3;
        self.battery.draw(airborne.then(|| self.airspeed_squared()), descends);
    }

    fn airspeed_squared(&self) -> f64 {
        let [north, east, _] = self.body.velocity;
        let air = |speed: f64, axis: usize| speed - f64::from(self.wind.velocity_mps[axis]) - self.gust[axis];
        air(north, 0) * air(north, 0) + air(east, 1) * air(east, 1)
    }

    /// First-order Gauss-Markov processes.
    fn advance_noise(&mut self) {
        let interval_s = TICK_S * f64::from(NOISE_TICKS);
        if self.settings.wander_m > 0.0 {
            let step = f64::from(self.settings.wander_m) * (2.0 * interval_s / WANDER_TIME_S).sqrt();
            let held = self.jump.map_or([0.0; 2], |(jump, _)| jump);
            for axis in 0..3 {
                let free = self.wander[axis] - held.get(axis).copied().unwrap_or(0.0);
                let change = step * self.normal() - free * interval_s / WANDER_TIME_S;
                self.wander[axis] += change;
            }
        }
        if self.wind.gust_mps > 0.0 {
            let step = f64::from(self.wind.gust_mps) * (2.0 * interval_s / GUST_TIME_S).sqrt();
            for axis in 0..2 {
                let change = step * self.normal() - self.gust[axis] * interval_s / GUST_TIME_S;
                self.gust[axis] += change;
            }
        }
    }

    /// Nearly normal: the sum of twelve uniform numbers.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Whether the estimator has a position and trusts it.
    pub fn estimator_ready(&self, now: Instant) -> bool {
        let lost = self.untrusted.is_some_and(|(from, to)| (from..to).contains(&now));
        now >= ESTIMATOR_READY && !lost
    }

    /// Since when the estimator does not trust its position, in flight.
    pub fn untrusted_since(&self, now: Instant) -> Option<Instant> {
        self.untrusted.map(|(from, _)| from).filter(|_| !self.estimator_ready(now))
    }

    /// The estimated position in the local frame.
    pub fn estimated(&self) -> Ned {
        let [north, east, down] = self.body.position;
        let [north_offset, east_offset] = self.origin_offset;
        Ned {
            north_m: (north - north_offset) as f32,
            east_m: (east - east_offset) as f32,
            down_m: down as f32,
        }
    }

    /// A point of the local frame in the boot frame.
    pub fn to_boot_frame(&self, [north, east, down]: Vector) -> Vector {
        [north + self.origin_offset[0], east + self.origin_offset[1], down]
    }

    /// A point of the boot frame in the local frame.
    pub fn to_local(&self, [north, east, down]: Vector) -> Vector {
        [north - self.origin_offset[0], east - self.origin_offset[1], down]
    }

    /// Where the local frame's origin is now.
    pub fn origin(&self) -> GeoPoint {
        let [north, east] = self.origin_offset;
        self.settings.origin.offset_by(Metres(north as f32), Metres(east as f32))
    }

    /// Home in the boot frame; the stand before there is one.
    pub fn home_in_boot_frame(&self) -> Vector {
        let Ned { north_m, east_m, down_m } = self.home.unwrap_or(self.settings.stand);
        self.to_boot_frame([north_m, east_m, down_m].map(f64::from))
    }

    /// The true position.
    pub fn true_position(&self) -> Ned {
        let [north_m, east_m, down_m] =
            [0, 1, 2].map(|axis| (self.body.position[axis] - self.wander[axis]) as f32);
        Ned { north_m, east_m, down_m }
    }

    /// Height above the take-off point, m, as the body is.
    pub fn height_m(&self) -> f64 {
        f64::from(self.settings.stand.down_m) - self.body.position[2]
    }

    /// Sets the aircraft on the ground if it has reached it; whether it has.
    pub fn touch_down(&mut self, now: Instant) -> bool {
        let ground = f64::from(self.settings.stand.down_m);
        let touches = !self.on_ground && self.body.position[2] >= ground;
        if touches {
            self.on_ground = true;
            self.grounded_at = now;
            self.body.position[2] = ground;
            self.body.rest();
        }
        touches
    }
}
