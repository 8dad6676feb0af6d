//! Everything that a state looks at in one poll.

use crate::{Inputs, Mission, Vehicle};
use gleaner_guard::Guard;
use gleaner_link::Autopilot;
use gleaner_policy::Preference;
use gleaner_units::{Cell, Duration, GridFrame, Instant, Metres};

/// Heartbeats come once a second: two may be lost.
const HEARTBEAT_AGE: Duration = Duration::from_millis(2_500);

/// The facts of one poll.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub(crate) now: Instant,
    pub(crate) mission: &'a Mission,
    pub(crate) guard: &'a Guard,
    pub(crate) inputs: &'a Inputs<'a>,
    /// Heartbeats that arrived up to here may be old: they waited in a queue while the program did not run.
    pub(crate) evidence_from: Option<Instant>,
    /// Whether this poll came too late after the last one.
    pub(crate) late: bool,
    /// Seconds of the vehicle per second of ours.
    pub(crate) pace: f32,
}

impl<'a> Scene<'a> {
    pub(crate) fn vehicle(&self) -> &'a Vehicle {
        self.inputs.vehicle
    }

    /// Whether heartbeats are evidence again after a late poll.
    pub(crate) fn hears(&self) -> bool {
        let at = self.vehicle().heartbeat_at;
        at.is_some_and(|at| self.evidence_from.is_none_or(|from| at > from))
    }

    /// Whether a heartbeat is recent enough to act on: nothing new is decided and no target leaves without one.
    pub(crate) fn is_heard(&self) -> bool {
        self.hears() && self.heartbeat_age().is_some_and(|age| age <= HEARTBEAT_AGE)
    }

    /// Time since the last heartbeat.
    pub(crate) fn heartbeat_age(&self) -> Option<Duration> {
        self.vehicle().heartbeat_at.map(|at| self.now.since(at))
    }

    /// Whether a fresh heartbeat that arrived after `reason` shows that the aircraft is ours: armed and in GUIDED or
    /// OFFBOARD. Nothing that moves the aircraft is requested without it. The heartbeat's age counts too: a request may
    /// wait for something else after the heartbeat came, such as a position.
    pub(crate) fn is_ours_since(&self, reason: Instant) -> bool {
        let vehicle = self.vehicle();
        let is_fresh = |at: Instant| at > reason && self.now.since(at) <= Autopilot::EVIDENCE_AGE;
        let heard_since = vehicle.heartbeat_at.is_some_and(is_fresh);
        heard_since && self.hears() && vehicle.armed && vehicle.is_guided() && !self.inputs.other_mode_seen
    }

    /// The operator's preference.
    pub(crate) fn preference(&self) -> Preference {
        // The parameter's range is the preference's.
        Preference::new(self.inputs.parameters.data_weight()).unwrap_or(Preference::ENERGY)
    }

    /// The time that a move takes at `GLN_SPEED`, and that a hover lasts.
    pub(crate) fn slot(&self) -> Duration {
        Duration::from_secs_f32(self.mission.grid().cell().0 / self.inputs.parameters.speed().0)
    }

    /// How far the aircraft is outside the grid; `None` over the grid, and when origin or position is unknown.
    pub(crate) fn outside_grid(&self) -> Option<Metres> {
        let vehicle = self.vehicle();
        let grid = self.mission.grid();
        let point = self.frame()?.point(&vehicle.position?);
        let beyond = |at_m: f32, cells: u16| (-at_m).max(at_m - f32::from(cells) * grid.cell().0).max(0.0);
        let (east_m, north_m) = (beyond(point.east_m, grid.width()), beyond(point.north_m, grid.height()));
        let outside_m = libm::hypotf(east_m, north_m);
        (outside_m > 0.0).then_some(Metres(outside_m))
    }

    /// The mission's grid in the autopilot's local frame, when its origin is known.
    fn frame(&self) -> Option<GridFrame> {
        Some(GridFrame::new(self.mission.grid(), self.mission.pose, self.vehicle().origin?))
    }

    /// The cell under the aircraft and its offset from the centre in metres, when both are known.
    pub(crate) fn cell_under(&self) -> Option<(Cell, f32)> {
        let (frame, position) = (self.frame()?, self.vehicle().position?);
        let cell = frame.cell(&position)?;
        Some((cell, position.horizontal_distance(&frame.centre(cell, position.down_m)).0))
    }

    /// The cell under the aircraft, and the displacement from the aircraft to the terminal's centre towards north and east, in
    /// cells.
    pub(crate) fn homeward(&self) -> Option<(Cell, [f32; 2])> {
        let (frame, position) = (self.frame()?, self.vehicle().position?);
        let home = frame.centre(self.mission.terminal, position.down_m);
        let to_cells = |from_m: f32, to_m: f32| (to_m - from_m) / self.mission.grid().cell().0;
        let net = [to_cells(position.north_m, home.north_m), to_cells(position.east_m, home.east_m)];
        Some((frame.cell(&position)?, net))
    }
}
