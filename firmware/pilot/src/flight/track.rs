//! The moving target: a point that runs along the decided way at a planned speed.
//!
//! A target per cell makes the aircraft brake before every cell. The target here moves, and carries its velocity: both
//! autopilots then follow it within a metre. It never leaves the decided way, and it can always stop on it:
//!
//! ```text
//!   A ------------> P ------------> Q      straight on: at P it does not brake
//!
//!   A ---------.    P
//!               \                          a turn at P: a quarter circle inside the cell of P
//!                |
//!                v
//!                Q
//! ```
//! Where nothing is decided for P yet, where the aircraft is to hover, and where it turns back, the target stops at P.

use super::leg::{Leg, Purpose};
use gleaner_link::{PositionTarget, Velocity};
use gleaner_units::Ned;

/// Acceleration of the target on the way and in turns, m/s^2. Less than ArduCopter's `WPNAV_ACCEL` of 2.5; from 8.9 m/s
/// it stops within a cell of 20 m.
const ACCELERATION_MPS2: f32 = 2.0;
/// Braking when the speed must fall at once, m/s^2.
const HARD_BRAKING_MPS2: f32 = 4.0;
/// From this distance between target and aircraft on the target slows down, m: a position is up to 0.1 s old, and PX4
/// lags by up to 0.7 m.
const LAG_M: f32 = 3.0;
/// At this distance it waits for the aircraft, m.
const LAG_MAX_M: f32 = 8.0;
/// A decision is made this long before braking would begin, s.
const REACTION_S: f32 = 0.25;
/// The autopilots answer a velocity so much late, s: a braking target sends the velocity that it will have then.
const LEAD_S: f32 = 0.3;
/// The longest time between two polls that the target moves on for, s.
const STEP_MAX_S: f32 = 0.2;
/// Cosine of the angle from which on a leg goes straight on.
const STRAIGHT: f32 = 0.99;

/// A smaller turn is a stop at the corner, m.
const TURN_MIN_M: f32 = 0.1;

/// North and east.
type Vector = [f32; 2];

fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1]
}

/// The way of one leg, up to where the next one begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Way {
    start: Ned,
    along: Vector,
    straight_m: f32,
    turn: Option<Turn>,
    /// Metres that are decided beyond the end of this leg.
    beyond_m: f32,
}

/// A quarter circle at the end of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    radius_m: f32,
    towards: Vector,
}

impl Way {
    /// The way of `leg` when `next` follows. Turns begin and end `radius_m` from the corner.
    pub(crate) fn new(leg: &Leg, next: Option<&Leg>, radius_m: f32) -> Way {
        let (along, length_m) = leg.direction();
        let mut way = Way { start: leg.start, along, straight_m: length_m, turn: None, beyond_m: 0.0 };
        let Some(next) = next.filter(|next| next.purpose == Purpose::Move) else { return way };
        let (towards, next_m) = next.direction();
        let cosine = dot(along, towards);
        if cosine > STRAIGHT {
            way.beyond_m = next_m;
        } else if cosine.abs() < 1.0 - STRAIGHT && radius_m > TURN_MIN_M {
            way.straight_m = length_m - radius_m;
            way.turn = Some(Turn { radius_m, towards });
            way.beyond_m = next_m - radius_m;
        }
        way
    }

    /// Metres from the start to where the next leg takes over.
    pub(crate) fn length_m(&self) -> f32 {
        let arc_m = self.turn.map_or(0.0, |turn| turn.radius_m * core::f32::consts::FRAC_PI_2);
        self.straight_m + arc_m
    }

    /// Metres of the next leg that are already flown when it takes over.
    pub(crate) fn entry_m(&self) -> f32 {
        self.turn.map_or(0.0, |turn| turn.radius_m)
    }

    /// Whether the target runs on into the next leg.
    pub(crate) const fn continues(&self) -> bool {
        self.beyond_m > 0.0
    }

    /// Position and direction after `travelled_m`.
    fn point(&self, travelled_m: f32) -> (Ned, Vector) {
        let ([north, east], straight_m) = (self.along, travelled_m.min(self.straight_m));
        let at = Ned {
            north_m: self.start.north_m + straight_m * north,
            east_m: self.start.east_m + straight_m * east,
            down_m: self.start.down_m,
        };
        let Some(Turn { radius_m, towards }) = self.turn.filter(|_| travelled_m > self.straight_m) else {
            return (at, self.along);
        };
        let (sine, cosine) = libm::sincosf((travelled_m - self.straight_m) / radius_m);
        let (forward_m, sideways_m) = (radius_m * sine, radius_m * (1.0 - cosine));
        let at = Ned {
            north_m: at.north_m + forward_m * north + sideways_m * towards[0],
            east_m: at.east_m + forward_m * east + sideways_m * towards[1],
            ..at
        };
        (at, [cosine * north + sine * towards[0], cosine * east + sine * towards[1]])
    }

    /// The highest speed after `travelled_m` from which the target can turn and stop in time.
    fn speed_limit(&self, travelled_m: f32) -> f32 {
        let reach = |squared: f32, distance_m: f32| {
            libm::sqrtf(squared + 2.0 * ACCELERATION_MPS2 * distance_m.max(0.0))
        };
        let stop = reach(0.0, self.length_m() - travelled_m + self.beyond_m);
        match self.turn {
            None => stop,
            Some(turn) => stop.min(reach(ACCELERATION_MPS2 * turn.radius_m, self.straight_m - travelled_m)),
        }
    }
}

/// The target on the way of the present leg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Track {
    travelled_m: f32,
    speed_mps: f32,
    /// 0 or less: while it brakes, m/s^2.
    braking_mps2: f32,
    /// Distance of the aircraft, m.
    lag_m: f32,
}

impl Track {
    /// Moves the target on by `secs`, at `cruise_mps` or less. It slows down when the aircraft is `lag_m` away.
    pub(crate) fn advance(&mut self, way: &Way, cruise_mps: f32, lag_m: f32, secs: f32) {
        self.lag_m = lag_m;
        let secs = secs.min(STEP_MAX_S);
        let slack = ((LAG_MAX_M - lag_m) / (LAG_MAX_M - LAG_M)).clamp(0.0, 1.0);
        let allowed = cruise_mps.min(way.speed_limit(self.travelled_m)) * slack;
        let slowest = self.speed_mps - HARD_BRAKING_MPS2 * secs;
        let before = self.speed_mps;
        self.speed_mps = (before + ACCELERATION_MPS2 * secs).min(allowed).max(slowest);
        let change = if secs > 0.0 { (self.speed_mps - before) / secs } else { 0.0 };
        self.braking_mps2 = change.clamp(-ACCELERATION_MPS2, 0.0);
        self.travelled_m += self.speed_mps * secs;
        if self.travelled_m >= way.length_m() && !way.continues() {
            *self = Track { travelled_m: way.length_m(), lag_m, ..Track::default() };
        }
    }

    /// Whether the target is at the end of the way.
    pub(crate) fn is_at_end(&self, way: &Way) -> bool {
        self.travelled_m >= way.length_m()
    }

    /// The target on the next leg.
    pub(crate) fn enter_next(&mut self, way: &Way) {
        self.travelled_m += way.entry_m() - way.length_m();
    }

    /// Whether braking is about to begin because nothing is decided for the end of the way. An aircraft that lags makes the
    /// target slow down: the decision waits until it is near again.
    pub(crate) fn needs_decision(&self, way: &Way) -> bool {
        if self.lag_m > LAG_M {
            return false;
        }
        let braking_m = self.speed_mps * self.speed_mps / (2.0 * ACCELERATION_MPS2);
        way.length_m() - self.travelled_m <= braking_m + REACTION_S * self.speed_mps
    }

    /// The target now.
    pub(crate) fn target(&self, way: &Way) -> PositionTarget {
        let (position, [north, east]) = way.point(self.travelled_m);
        let speed = (self.speed_mps + LEAD_S * self.braking_mps2).max(0.0);
        let velocity = Velocity { north_mps: north * speed, east_mps: east * speed, down_mps: 0.0 };
        PositionTarget { position, velocity: Some(velocity) }
    }

    /// The direction of the target over the ground, north and east.
    pub(crate) fn direction(&self, way: &Way) -> [f32; 2] {
        way.point(self.travelled_m).1
    }

    /// Metres from the start of the leg.
    pub(crate) const fn travelled_m(&self) -> f32 {
        self.travelled_m
    }

    /// Speed of the target, m/s.
    pub(crate) const fn speed_mps(&self) -> f32 {
        self.speed_mps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::{Action, Cell, Instant};

    const CELL_M: f32 = 20.0;

    fn centre(cell: Cell) -> Ned {
        Ned { north_m: f32::from(cell.y) * CELL_M, east_m: f32::from(cell.x) * CELL_M, down_m: -60.0 }
    }

    fn leg(from: Cell, action: Action) -> Leg {
        let to = from.after(action);
        let purpose = if action == Action::Hover { Purpose::Hover } else { Purpose::Move };
        Leg::new(Instant::ZERO, purpose, (from, centre(from)), (to, centre(to)))
    }

    /// Flies `actions` with decisions in time; the targets at 20 ms and the seconds at which each leg ended.
    fn run(actions: &[Action], radius_m: f32, cruise_mps: f32) -> (Vec<PositionTarget>, Vec<f32>) {
        let (mut track, mut targets, mut ends) = (Track::default(), Vec::new(), Vec::new());
        let mut at = Cell::new(0, 0);
        let legs: Vec<Leg> = actions
            .iter()
            .map(|&action| {
                let leg = leg(at, action);
                at = leg.cell;
                leg
            })
            .collect();
        let (mut index, mut decided, mut turn_m) = (0, 0, radius_m);
        for tick in 1..20_000 {
            let next = legs.get(index + 1).filter(|_| decided > index);
            let way = Way::new(&legs[index], next, turn_m);
            track.advance(&way, cruise_mps, 0.0, 0.02);
            if decided == index && track.needs_decision(&way) {
                decided += 1;
                turn_m = radius_m.min(way.length_m() - track.travelled_m);
            }
            let next = legs.get(index + 1).filter(|_| decided > index);
            let way = Way::new(&legs[index], next, turn_m);
            if track.is_at_end(&way) {
                ends.push(tick as f32 * 0.02);
                if index + 1 == legs.len() {
                    targets.push(track.target(&way));
                    return (targets, ends);
                }
                track.enter_next(&way);
                index += 1;
                decided = decided.max(index);
            }
            let next = legs.get(index + 1).filter(|_| decided > index);
            targets.push(track.target(&Way::new(&legs[index], next, turn_m)));
        }
        panic!("never arrives");
    }

    #[test]
    fn straight_cells_are_flown_at_the_set_speed() {
        for (cruise_mps, share) in [(10.0, 0.93), (8.0, 0.999), (3.0, 0.999)] {
            let (_, ends) = run(&[Action::East; 10], 4.8, cruise_mps);
            let mean = 5.0 * CELL_M / (ends[8] - ends[3]);
            assert!(mean >= share * cruise_mps && mean <= cruise_mps * 1.001, "{mean} m/s of {cruise_mps}");
        }
    }

    #[test]
    fn the_target_never_jumps_and_stays_inside_its_limits() {
        use Action::{East, North, South, West};
        let way = [East, East, North, East, South, South, West, East, North, North];
        for radius_m in [1.2, 4.8, 8.0] {
            let (targets, _) = run(&way, radius_m, 10.0);
            for pair in targets.windows(2) {
                let moved = pair[0].position.horizontal_distance(&pair[1].position).0;
                assert!(moved <= 10.0 * 0.02 + 1e-3, "{moved} m in one step: {pair:?}, radius {radius_m}");
                let [a, b] = [0, 1].map(|at| pair[at].velocity.unwrap());
                let change = libm::hypotf(b.north_mps - a.north_mps, b.east_mps - a.east_mps) / 0.02;
                assert!(change <= 10.0 * HARD_BRAKING_MPS2, "{change} m/s^2");
            }
            let last = targets.last().unwrap();
            assert_eq!(last.velocity, Some(Velocity::default()));
        }
    }

    #[test]
    fn a_turn_stays_inside_its_cell() {
        let (targets, _) = run(&[Action::East, Action::North, Action::East], 8.0, 10.0);
        let half = CELL_M / 2.0;
        for PositionTarget { position: Ned { north_m, east_m, .. }, .. } in targets {
            let cell = Cell::new(((east_m + half) / CELL_M) as i16, ((north_m + half) / CELL_M) as i16);
            let decided = [(0, 0), (1, 0), (1, 1), (2, 1)].map(|(x, y)| Cell::new(x, y));
            assert!(decided.contains(&cell), "{cell}");
        }
    }

    #[test]
    fn without_a_decision_it_stops_at_the_centre() {
        let (targets, ends) = run(&[Action::East, Action::Hover], 4.8, 10.0);
        assert_eq!(targets.last().unwrap().position, centre(Cell::new(1, 0)));
        assert_eq!(ends.len(), 2);
    }

    #[test]
    fn it_waits_for_an_aircraft_that_lags() {
        let way = Way::new(&leg(Cell::new(0, 0), Action::East), None, 4.8);
        let mut track = Track::default();
        for _ in 0..100 {
            track.advance(&way, 10.0, 1.0, 0.02);
        }
        let (before, speed) = (track.travelled_m, track.speed_mps());
        for _ in 0..200 {
            track.advance(&way, 10.0, LAG_MAX_M, 0.02);
        }
        assert!(speed > 3.9 && track.speed_mps() == 0.0);
        assert!(track.travelled_m < before + speed * speed / (2.0 * HARD_BRAKING_MPS2) + 0.2);
    }
}
