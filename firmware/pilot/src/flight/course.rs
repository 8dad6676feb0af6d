//! The course: the leg under way, what is decided beyond it, and the target that runs along both.

use crate::flight::leg::{Leg, Progress, Purpose};
use crate::flight::stream::Stream;
use crate::flight::track::{Track, Way};
use gleaner_link::{Firmware, PositionTarget};
use gleaner_units::{BatteryUnits, Cell, Instant, Metres, Ned};

/// A turn of this radius passes the corner at `sqrt(2) - 1` of it.
const TURN_PASSES: f32 = core::f32::consts::SQRT_2 - 1.0;
/// The largest radius of a turn, as a fraction of the cell: the rest is for the aircraft's lag.
const TURN_CELLS: f32 = 0.4;
/// Longest flight on after the last target, s: ArduCopter moves a target with a velocity on for `GUID_TIMEOUT`.
const COASTING_S: f32 = 3.0;
/// Deceleration of an autopilot that stops, m/s^2.
const STOPPING_MPS2: f32 = 2.2;

/// The course of one flight.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Course {
    pub(crate) leg: Leg,
    /// Decided before the aircraft is at the end of `leg`.
    next: Option<Leg>,
    /// Radius of the turn into `next`, m.
    turn_m: f32,
    track: Track,
    stream: Stream,
}

impl Course {
    pub(crate) fn new(leg: Leg, stream: Stream) -> Course {
        Course { leg, next: None, turn_m: 0.0, track: Track::default(), stream }
    }

    /// Begins a leg from rest; what was decided before is dropped.
    pub(crate) fn begin(&mut self, leg: Leg) {
        *self = Course::new(leg, self.stream);
    }

    /// Flies `leg` from the end of the present one: now if the target stands there, else when it arrives. A turn passes the
    /// centre within the arrival radius, stays inside the cell and begins at the present target or later.
    pub(crate) fn follow(&mut self, leg: Leg, arrival: Metres) {
        if self.stands() {
            self.begin(leg);
            return;
        }
        let (_, length_m) = self.leg.direction();
        let left_m = length_m - self.track.travelled_m();
        self.turn_m = (arrival.0 / TURN_PASSES).min(TURN_CELLS * length_m).min(left_m);
        self.next = Some(leg);
    }

    /// Whether the target stands at the end of the leg, with nothing decided beyond it.
    fn stands(&self) -> bool {
        let way = self.way();
        self.leg.purpose != Purpose::Move || (self.track.is_at_end(&way) && !way.continues())
    }

    /// Ends a hover, under way or decided.
    pub(crate) fn end_hover(&mut self) {
        self.leg.hurry();
        self.next = self.next.filter(|next| next.purpose == Purpose::Move);
    }

    /// The cell in which everything decided so far ends.
    pub(crate) fn last_cell(&self) -> Cell {
        self.next.map_or(self.leg.cell, |next| next.cell)
    }

    /// Battery units that are decided and not flown yet.
    pub(crate) fn units_ahead(&self) -> BatteryUnits {
        self.leg.units_ahead() + self.next.map_or(BatteryUnits(0.0), |next| next.units_ahead())
    }

    /// Moves the target on. When a leg ends here: the fraction of it that was flown and not counted, and its direction
    /// towards north and east.
    pub(crate) fn advance(&mut self, position: &Ned, cruise_mps: f32, secs: f32) -> Option<(f32, [f32; 2])> {
        if self.leg.purpose != Purpose::Move {
            return None;
        }
        let way = self.way();
        let lag_m = self.track.target(&way).position.horizontal_distance(position).0;
        self.track.advance(&way, cruise_mps, lag_m, secs);
        match self.next {
            Some(next) if way.continues() && self.track.is_at_end(&way) => {
                self.track.enter_next(&way);
                self.next = None;
                let rest = (self.leg.complete(), self.leg.direction().0);
                self.leg = next;
                Some(rest)
            }
            _ => None,
        }
    }

    /// Begins the leg that was decided for where the aircraft has arrived. False if there is none.
    pub(crate) fn begin_next(&mut self, now: Instant) -> bool {
        let Some(next) = self.next.take() else { return false };
        self.begin(next.beginning(now));
        true
    }

    /// Whether the next decision is due before the aircraft arrives.
    pub(crate) fn needs_decision(&self) -> bool {
        self.leg.purpose == Purpose::Move && self.next.is_none() && self.track.needs_decision(&self.way())
    }

    /// How the leg is going. A move that is not continued ends when the target has stopped at the centre and the
    /// aircraft is there.
    pub(crate) fn progress(&mut self, now: Instant, position: &Ned, radius: Metres) -> Progress {
        let stands = self.stands();
        match self.leg.watch(now, position, radius) {
            Progress::Arrived if !stands => Progress::Underway,
            progress => progress,
        }
    }

    /// The autopilot reported the target that it follows.
    pub(crate) fn target_reported(&mut self) {
        self.stream.reported();
    }

    /// The target if it is due.
    pub(crate) fn target_due(&mut self, now: Instant, firmware: Firmware) -> Option<PositionTarget> {
        let target = match self.leg.purpose {
            // Not on a decided way: the autopilot finds its own.
            Purpose::Centre => PositionTarget::at(self.leg.target),
            Purpose::Hover => {
                PositionTarget { position: self.leg.target, velocity: Some(Default::default()) }
            }
            Purpose::Move => self.track.target(&self.way()),
        };
        self.stream.due(now, target, firmware)
    }

    /// Where an aircraft at `position` may be once it has stopped by itself: the middle of that way, and half its length
    /// in metres.
    pub(crate) fn stopping(&self, position: Ned) -> (Ned, f32) {
        let speed = self.track.speed_mps();
        let half_m = 0.5 * (speed * COASTING_S + speed * speed / (2.0 * STOPPING_MPS2));
        let [north, east] = self.track.direction(&self.way());
        let middle = Ned {
            north_m: position.north_m + half_m * north,
            east_m: position.east_m + half_m * east,
            ..position
        };
        (middle, half_m)
    }

    fn way(&self) -> Way {
        Way::new(&self.leg, self.next.as_ref(), self.turn_m)
    }
}
