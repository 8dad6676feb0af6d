//! The referee: checks the pilot against ground truth and the bytes on the line, with arithmetic of its own.

mod custody;
mod envelope;
mod rules;
#[cfg(test)]
mod tests;

pub use rules::{Rule, Violation};

use crate::autopilot::{Commander, Truth, VehicleMode};
use crate::setup::MissionSetup;
use custody::Custody;
use envelope::Envelope;
use gleaner_link::Frame;
use gleaner_pilot::{DecisionRecord, Parameters, State};
use gleaner_units::{BatteryUnits, Cell, Duration, GridFrame, Instant, Ned};

/// The referee of one flight.
#[derive(Clone, Debug)]
pub struct Referee {
    envelope: Envelope,
    custody: Custody,
    frame: GridFrame,
    /// The pilot's parameters as they were sent.
    parameters: Parameters,
    /// Standard deviation of the position estimate, m.
    wander_m: f32,
    altitude_grace: Duration,
    left: BatteryUnits,
    /// Battery units that a flown unit takes from the pack, for the present fault.
    true_price: f32,
    /// Whether the pack covered the shortest mission at the last engagement.
    could_return: bool,
    energy: BatteryUnits,
    decisions: u32,
    expected: Option<u32>,
    /// The cell in which the last flown decision ends.
    leads_to: Option<Cell>,
    /// Whether the pilot's decisions are being flown.
    flying: bool,
    /// Whether the autopilot lands or returns by the pilot's request: GUIDED after that is somebody else's.
    ends: bool,
    /// Injected errors of the position, during which place is not judged.
    disturbed_until: Instant,
    off_altitude_since: Option<Instant>,
    excursions: Excursions,
    last_custody: Option<(Rule, Instant)>,
    landed: bool,
    violations: Vec<Violation>,
}

/// What is out of bounds now; a violation is recorded when it begins.
#[derive(Clone, Copy, Debug, Default)]
struct Excursions {
    map: bool,
    fence: bool,
    altitude: bool,
    pack: bool,
    number: bool,
}

impl Referee {
    /// Between a position and the decision that uses it lies one interval of the 10 Hz stream: a metre at 10 m/s. Half a
    /// metre more for the steps of the simulation.
    const POSITION_AGE_M: f32 = 1.5;
    /// How far the aircraft may be behind the moving target when the pilot decides ahead, m.
    const LAG_M: f32 = 3.0;
    /// How far a forbidden cell may be entered: the overshoot of a stop.
    const OVERSHOOT_M: f32 = 2.0;
    /// The pilot holds its altitude within centimetres; a climb to it ends within 3 m.
    const ALTITUDE_BAND_M: f32 = 5.0;
    /// A gust or a loss of thrust may push the aircraft out of the band for this time, s.
    const ALTITUDE_GRACE_S: f32 = 10.0;
    /// Battery units of descent and landing at the nominal price, with a margin.
    const LANDING_UNITS: f32 = 14.0;

    /// A referee for a mission that was set up, and the pilot with this component id.
    #[must_use]
    pub fn new(setup: &MissionSetup, component_id: u8) -> Referee {
        let plan = &setup.plan;
        Referee {
            envelope: Envelope::new(&setup.mission),
            custody: Custody::new(plan.autopilot, setup.aircraft.system_id, component_id, plan.speedup),
            frame: setup.frame,
            parameters: Parameters::default(),
            wander_m: plan.wander_m,
            altitude_grace: Duration::from_secs_f32(Referee::ALTITUDE_GRACE_S),
            left: setup.mission.budget,
            true_price: 1.0,
            could_return: true,
            energy: BatteryUnits(0.0),
            decisions: 0,
            expected: None,
            leads_to: None,
            flying: false,
            ends: false,
            disturbed_until: Instant::ZERO,
            off_altitude_since: None,
            excursions: Excursions::default(),
            last_custody: None,
            landed: false,
            violations: Vec::new(),
        }
    }

    /// The pilot reported one of its parameters.
    pub fn parameter(&mut self, name: &str, value: f32) {
        // Names of the autopilot's own parameters come by here too and are refused.
        let _ = self.parameters.set(name, value);
    }

    /// A frame was delivered to the pilot; it left the autopilot at `left_at`.
    pub fn delivered(&mut self, left_at: Instant, frame: &[u8]) {
        self.custody.delivered(left_at, frame);
    }

    /// A frame left the pilot.
    pub fn sent(&mut self, now: Instant, frame: &Frame) {
        let Some(rule) = self.custody.sent(now, frame) else { return };
        // Targets stream at 10 Hz: the same rule is recorded once in half a minute.
        let repeats = self
            .last_custody
            .as_ref()
            .is_some_and(|(last, at)| *last == rule && now - *at < Duration::from_secs(30));
        if !repeats {
            self.last_custody = Some((rule.clone(), now));
            self.violated(now, rule);
        }
    }

    /// The pilot's program ended.
    pub fn companion_restarts(&mut self) {
        self.custody.restarted();
        self.expected = None;
        self.leads_to = None;
        self.flying = false;
    }

    /// The pilot's program does not run until then.
    pub fn companion_stalls_until(&mut self, until: Instant) {
        self.custody.stalled_until(until);
    }

    /// Bytes on the line to the pilot are damaged until then.
    pub fn noisy_until(&mut self, until: Instant) {
        self.custody.noisy_until(until);
    }

    /// The position estimate is wrong until then: place, map and altitude are not judged.
    pub fn disturbed_until(&mut self, until: Instant) {
        self.disturbed_until = self.disturbed_until.max(until);
    }

    /// From now on a flown unit takes this many units from the pack. At a higher price the charge may no longer cover
    /// the way home; the pilot is not judged by that.
    pub fn price_changes(&mut self, factor: f32, truth: &Truth) {
        self.true_price = self.true_price.max(factor);
        self.could_return &= self.covers_return(truth);
    }

    /// The pack lost charge that no decision pays for.
    pub fn charge_lost(&mut self, truth: &Truth) {
        self.could_return &= self.covers_return(truth);
    }

    fn covers_return(&self, truth: &Truth) -> bool {
        let cell = self.frame.cell(&truth.position);
        let moves = cell.and_then(|cell| self.envelope.moves(cell)).unwrap_or(0.0).max(2.0);
        let needed = (moves + Referee::LANDING_UNITS) * self.true_price;
        // A quarter more: until the pilot has learned the new price, it plans with the old one.
        truth.battery.0 >= 1.25 * needed + self.parameters.reserve().0
    }

    /// A decision record was sent. Whether the decision is flown, and so begins a slot.
    pub fn decided(&mut self, now: Instant, record: &DecisionRecord, truth: &Truth) -> bool {
        if let Some(expected) = self.expected.filter(|&expected| expected != record.sequence) {
            self.violated(now, Rule::RecordMissing { expected, came: record.sequence });
        }
        self.expected = Some(record.sequence.wrapping_add(1));
        if !matches!(record.state, State::Engaged | State::Homing) {
            return false;
        }
        if let Some(rule) = self.custody.decided(now) {
            self.violated(now, rule);
        }
        if !self.flying {
            self.could_return = self.covers_return(truth);
        }
        (self.flying, self.ends) = (true, false);
        self.decisions += 1;
        self.judge_place(now, record, truth);
        self.judge_action(now, record);
        self.left = self.left - record.action.cost();
        self.energy = self.energy + record.action.cost();
        true
    }

    fn judge_place(&mut self, now: Instant, record: &DecisionRecord, truth: &Truth) {
        let centre = self.frame.centre(record.cell, truth.position.down_m);
        let off_m = truth.position.horizontal_distance(&centre).0;
        let cell_m = self.frame.grid().cell().0;
        let radius_m = self.parameters.arrive_radius().0.min(cell_m / 2.0);
        // The decision for the cell that the last one leads to may be made on the way there: one cell ahead.
        let is_ahead = self.leads_to == Some(record.cell);
        let reach_m = if is_ahead { cell_m + Referee::LAG_M } else { radius_m };
        let allowed_m = reach_m + Referee::POSITION_AGE_M + 5.0 * self.wander_m;
        self.leads_to = Some(record.cell.after(record.action));
        if off_m > allowed_m && now >= self.disturbed_until {
            self.violated(now, Rule::NotThere { claimed: record.cell, off_m });
        }
    }

    fn judge_action(&mut self, now: Instant, record: &DecisionRecord) {
        let &DecisionRecord { cell, action, battery, .. } = record;
        if battery.0 > self.left.0 {
            self.violated(now, Rule::BatteryClaim { claimed: battery, left: self.left });
        }
        let returns = record.state == State::Homing;
        if !self.envelope.permits(cell, action, battery, self.parameters.reserve(), returns) {
            self.violated(now, Rule::NotAllowed { cell, action, battery });
        }
    }

    /// Checks the aircraft; call it once per step.
    pub fn watch(&mut self, now: Instant, truth: &Truth) {
        self.custody.watch(now, truth);
        let airborne = !truth.on_ground;
        let flies = self.flies(truth);
        self.flying &= flies;
        if self.flying && airborne && truth.mode == VehicleMode::Guided && now >= self.disturbed_until {
            self.watch_place(now, truth);
        }
        let empty = airborne && truth.battery.0 <= 0.0;
        if empty && !self.excursions.pack && self.could_return && self.flying {
            self.violated(now, Rule::PackEmpty);
        }
        self.excursions.pack = empty;
        if truth.killed_by_nan && !self.excursions.number {
            self.excursions.number = true;
            self.violated(now, Rule::NotANumber);
        }
        if self.flying && truth.on_ground && !truth.armed {
            self.flying = false;
            self.judge_landing(now, truth);
        }
    }

    /// Whether the aircraft follows the pilot: GUIDED, or the LAND or RTL that the pilot requested.
    fn flies(&mut self, truth: &Truth) -> bool {
        match truth.mode {
            VehicleMode::Guided => !self.ends && !self.custody.is_revoked(),
            VehicleMode::Land | VehicleMode::Return => {
                self.ends = truth.mode_by == Commander::Companion;
                self.ends
            }
            _ => false,
        }
    }

    /// The pilot flies from cell centre to cell centre, so it keeps half a cell from the edge of the map and from forbidden
    /// cells by itself. Half a cell outside the map is a whole cell off.
    fn watch_place(&mut self, now: Instant, truth: &Truth) {
        let (grid, point) = (self.frame.grid(), self.frame.point(&truth.position));
        let cell_m = grid.cell().0;
        let beyond = |at_m: f32, cells: u16| at_m < -0.5 * cell_m || at_m > (f32::from(cells) + 0.5) * cell_m;
        let outside = beyond(point.east_m, grid.width()) || beyond(point.north_m, grid.height());
        if outside && !self.excursions.map {
            self.violated(now, Rule::OutsideMap);
        }
        self.excursions.map = outside;
        self.watch_fence(now, &truth.position);
        let height_m = truth.height_m;
        let off = (height_m - self.parameters.altitude().0).abs() > Referee::ALTITUDE_BAND_M;
        self.off_altitude_since = if off { self.off_altitude_since.or(Some(now)) } else { None };
        let too_long = self.off_altitude_since.is_some_and(|since| now - since > self.altitude_grace);
        if too_long && !self.excursions.altitude {
            self.violated(now, Rule::Altitude { height_m });
        }
        self.excursions.altitude = too_long;
    }

    /// Forbidden cells inside the map, less an overshoot at the edge.
    fn watch_fence(&mut self, now: Instant, position: &Ned) {
        let margin_m = Referee::OVERSHOOT_M + 5.0 * self.wander_m;
        let reach = [(0.0, 0.0), (margin_m, 0.0), (-margin_m, 0.0), (0.0, margin_m), (0.0, -margin_m)];
        let is_allowed = |(north_m, east_m): (f32, f32)| {
            let near =
                Ned { north_m: position.north_m + north_m, east_m: position.east_m + east_m, ..*position };
            self.frame.cell(&near).is_none_or(|cell| self.envelope.moves(cell).is_some())
        };
        let forbidden = !reach.into_iter().any(is_allowed);
        if forbidden && !self.excursions.fence {
            self.violated(now, Rule::OverForbiddenCell { cell: self.frame.cell(position) });
        }
        self.excursions.fence = forbidden;
    }

    fn judge_landing(&mut self, now: Instant, truth: &Truth) {
        let cell = self.frame.cell(&truth.position);
        if cell == Some(self.envelope.terminal) {
            self.landed = true;
        } else if truth.mode != VehicleMode::Return && self.could_return && now >= self.disturbed_until {
            // Handed back to the autopilot, it may return to where it took off. With too little energy for the way,
            // it may land at once.
            self.violated(now, Rule::LandedElsewhere { cell });
        }
    }

    fn violated(&mut self, at: Instant, rule: Rule) {
        self.violations.push(Violation { at, rule });
    }

    /// Rules broken so far.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// Whether the aircraft was taken over since the last request to engage.
    #[must_use]
    pub fn is_revoked(&self) -> bool {
        self.custody.is_revoked()
    }

    /// Decisions that were flown.
    #[must_use]
    pub const fn decisions(&self) -> u32 {
        self.decisions
    }

    /// Their cost.
    #[must_use]
    pub const fn energy(&self) -> BatteryUnits {
        self.energy
    }

    /// Whether a flight under the pilot's command ended on the ground of the terminal cell.
    #[must_use]
    pub const fn landed(&self) -> bool {
        self.landed
    }
}
