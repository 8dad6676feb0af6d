//! One leg: the flight to a cell centre, or the hover over it.

use gleaner_units::{BatteryUnits, Cell, Duration, Instant, Metres, Ned};

/// How long a leg may go without progress: long against a gust (a cell takes about 5 s), short against a battery.
pub(crate) const STALL: Duration = Duration::from_secs(20);

/// A smaller approach is noise of the position.
const PROGRESS_M: f32 = 0.5;

/// Cosine of the largest angle between two legs that are flown without a turn.
const STRAIGHT: f32 = 0.9;

/// Longest time that braking, a turn and accelerating add to a leg: ArduCopter flies a cell of 20 m in 2 s, and in 5.5 to 6.2 s
/// with a turn before it.
const TURN_S: f32 = 4.0;

/// Why this leg is flown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To the centre of the cell under the aircraft; not paid for.
    Centre,
    /// Over the same cell for one slot.
    Hover,
    /// To a neighbouring cell.
    Move,
}

/// A target, and the progress towards it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leg {
    pub(crate) cell: Cell,
    /// The cell that the leg began in.
    pub(crate) from: Cell,
    pub(crate) target: Ned,
    pub(crate) purpose: Purpose,
    /// Where the aircraft was sent from.
    pub(crate) start: Ned,
    /// Fraction of the way that was covered at most.
    covered: f32,
    /// Time that the turn into this leg may still take, s.
    turn_s: f32,
    /// The least time that the leg takes.
    slot: Duration,
    not_before: Instant,
    nearest_m: f32,
    progress_at: Instant,
}

/// How a leg is going.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    /// On the way, or the slot is not over.
    Underway,
    /// Inside the arrival radius, and the slot is over.
    Arrived,
    /// [`STALL`] without coming nearer; reported once, then the time starts anew.
    Stalled,
}

impl Leg {
    /// A leg to `target` in `cell`; `start` is where the aircraft was sent before, in cell `from`.
    pub(crate) fn new(
        now: Instant,
        purpose: Purpose,
        (from, start): (Cell, Ned),
        (cell, target): (Cell, Ned),
    ) -> Leg {
        Leg {
            cell,
            from,
            target,
            purpose,
            start,
            covered: 0.0,
            turn_s: 0.0,
            slot: Duration::default(),
            not_before: now,
            nearest_m: f32::INFINITY,
            progress_at: now,
        }
    }

    /// Distance over the ground between `position` and the straight way of this leg, m.
    pub(crate) fn beside(&self, position: &Ned) -> f32 {
        let along = self.along(position).clamp(0.0, 1.0);
        let nearest = Ned {
            north_m: self.start.north_m + along * (self.target.north_m - self.start.north_m),
            east_m: self.start.east_m + along * (self.target.east_m - self.start.east_m),
            down_m: position.down_m,
        };
        position.horizontal_distance(&nearest).0
    }

    /// The fraction of the way that was covered since the last call.
    pub(crate) fn cover(&mut self, position: &Ned) -> f32 {
        // `clamp` would have to panic on a low above a high.
        let covered = self.along(position).min(1.0).max(self.covered);
        covered - core::mem::replace(&mut self.covered, covered)
    }

    /// How far along the way the aircraft is: 0 at the start, 1 at the target.
    fn along(&self, position: &Ned) -> f32 {
        let way = [self.target.north_m - self.start.north_m, self.target.east_m - self.start.east_m];
        let gone = [position.north_m - self.start.north_m, position.east_m - self.start.east_m];
        let length2 = way[0] * way[0] + way[1] * way[1];
        if length2 > 0.0 { (way[0] * gone[0] + way[1] * gone[1]) / length2 } else { 1.0 }
    }

    /// The same leg, not over before `slot` has passed.
    pub(crate) fn lasting(self, slot: Duration) -> Leg {
        Leg { slot, not_before: self.not_before + slot, ..self }
    }

    /// The same leg, begun by a turn or from a hover.
    pub(crate) fn turning(self) -> Leg {
        Leg { turn_s: TURN_S, ..self }
    }

    /// Whether `before` leads straight into this leg.
    pub(crate) fn continues(&self, before: &Leg) -> bool {
        let ([north, east], _) = self.direction();
        let ([north_before, east_before], _) = before.direction();
        before.purpose == Purpose::Move && north * north_before + east * east_before > STRAIGHT
    }

    /// Of `secs`, in which this fraction of the leg was flown, the part that the turn into it took. `slot_s`: time of a cell
    /// at cruise.
    pub(crate) fn turned_s(&mut self, fraction: f32, secs: f32, slot_s: f32) -> f32 {
        let turned_s = (secs - fraction * slot_s).min(self.turn_s).max(0.0);
        self.turn_s -= turned_s;
        turned_s
    }

    /// The same leg, beginning now: a leg may be decided before the aircraft is where it begins.
    pub(crate) fn beginning(self, now: Instant) -> Leg {
        Leg { not_before: now + self.slot, progress_at: now, ..self }
    }

    /// The direction over the ground, north and east, and the length in metres. The direction of a leg without a length
    /// is north.
    pub(crate) fn direction(&self) -> ([f32; 2], f32) {
        let [north_m, east_m] =
            [self.target.north_m - self.start.north_m, self.target.east_m - self.start.east_m];
        let length_m = libm::hypotf(north_m, east_m);
        let direction = if length_m > 0.0 { [north_m / length_m, east_m / length_m] } else { [1.0, 0.0] };
        (direction, length_m)
    }

    /// Battery units of this leg that are still to be flown.
    pub(crate) fn units_ahead(&self) -> BatteryUnits {
        match self.purpose {
            Purpose::Centre | Purpose::Hover => BatteryUnits(0.0),
            Purpose::Move => BatteryUnits(1.0 - self.covered),
        }
    }

    /// The leg is flown: the fraction of it that was not counted.
    pub(crate) fn complete(&mut self) -> f32 {
        1.0 - core::mem::replace(&mut self.covered, 1.0)
    }

    /// Ends the wait for the slot.
    pub(crate) fn hurry(&mut self) {
        self.not_before = Instant::ZERO;
    }

    /// Neither autopilot reports arrival at a position target, and both drop a target outside their own fence without a
    /// message. So arrival and the lack of progress are judged here.
    pub(crate) fn watch(&mut self, now: Instant, position: &Ned, radius: Metres) -> Progress {
        let distance_m = position.horizontal_distance(&self.target).0;
        if distance_m < radius.0 {
            self.progress_at = now;
            self.nearest_m = f32::INFINITY;
            return if now >= self.not_before { Progress::Arrived } else { Progress::Underway };
        }
        if distance_m < self.nearest_m - PROGRESS_M {
            self.nearest_m = distance_m;
            self.progress_at = now;
        } else if now.since(self.progress_at) >= STALL {
            self.progress_at = now;
            return Progress::Stalled;
        }
        Progress::Underway
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: Metres = Metres(2.0);

    fn at(north_m: f32) -> Ned {
        Ned { north_m, east_m: 0.0, down_m: -60.0 }
    }

    fn leg(purpose: Purpose) -> Leg {
        Leg::new(Instant::ZERO, purpose, (Cell::new(0, 0), at(0.0)), (Cell::new(0, 1), at(20.0)))
    }

    fn after_s(secs: f32) -> Instant {
        Instant::ZERO + Duration::from_secs_f32(secs)
    }

    #[test]
    fn a_move_arrives_inside_the_radius_and_a_hover_not_before_its_slot() {
        let mut leg_ = leg(Purpose::Move);
        assert_eq!(leg_.watch(after_s(1.0), &at(17.9), RADIUS), Progress::Underway);
        assert_eq!(leg_.watch(after_s(1.1), &at(18.1), RADIUS), Progress::Arrived);
        let mut hover = leg(Purpose::Hover).lasting(Duration::from_secs(4));
        assert_eq!(hover.watch(after_s(3.9), &at(20.0), RADIUS), Progress::Underway);
        assert_eq!(hover.watch(after_s(4.0), &at(23.0), RADIUS), Progress::Underway, "blown away");
        assert_eq!(hover.watch(after_s(4.1), &at(20.0), RADIUS), Progress::Arrived);
        let mut hurried = leg(Purpose::Hover).lasting(Duration::from_secs(4));
        hurried.hurry();
        assert_eq!(hurried.watch(after_s(0.1), &at(20.0), RADIUS), Progress::Arrived);
    }

    #[test]
    fn the_way_is_covered_once_and_measured_sideways() {
        let mut leg = leg(Purpose::Move);
        assert_eq!(leg.cover(&at(5.0)), 0.25);
        assert_eq!(leg.cover(&at(3.0)), 0.0, "back is not covered again");
        assert_eq!(leg.cover(&at(30.0)), 0.75);
        assert_eq!(leg.beside(&Ned { east_m: -7.0, ..at(12.0) }), 7.0);
        assert_eq!(leg.beside(&at(50.0)), 30.0);
    }

    #[test]
    fn a_turn_takes_time_once_and_a_straight_leg_none() {
        let straight = leg(Purpose::Move);
        assert!(
            leg(Purpose::Move).continues(&straight) && !leg(Purpose::Move).continues(&leg(Purpose::Hover))
        );
        let east = Leg { target: Ned { east_m: 20.0, ..at(0.0) }, ..straight };
        assert!(!east.continues(&straight));
        assert_eq!(leg(Purpose::Move).turned_s(0.1, 3.0, 2.0), 0.0, "a strong wind makes cells dear");
        let mut turning = leg(Purpose::Move).turning();
        assert_eq!(turning.turned_s(0.5, 1.0, 2.0), 0.0, "at cruise");
        assert_eq!(turning.turned_s(0.25, 3.5, 2.0), 3.0);
        assert_eq!(turning.turned_s(0.0, 3.0, 2.0), 1.0, "the longest turn is over");
        assert_eq!(turning.turned_s(0.0, 3.0, 2.0), 0.0);
    }

    #[test]
    fn slow_progress_is_progress_and_none_is_a_stall() {
        let mut slow = leg(Purpose::Move);
        for second in 0..150 {
            let position = at(second as f32 * 0.1);
            assert_eq!(slow.watch(after_s(second as f32), &position, RADIUS), Progress::Underway);
        }
        let mut stuck = leg(Purpose::Move);
        assert_eq!(stuck.watch(after_s(0.0), &at(0.0), RADIUS), Progress::Underway);
        assert_eq!(stuck.watch(after_s(19.9), &at(0.4), RADIUS), Progress::Underway);
        assert_eq!(stuck.watch(after_s(20.0), &at(0.3), RADIUS), Progress::Stalled);
        assert_eq!(stuck.watch(after_s(39.9), &at(0.3), RADIUS), Progress::Underway, "the time starts anew");
        assert_eq!(stuck.watch(after_s(40.0), &at(0.3), RADIUS), Progress::Stalled);
    }
}
