//! The referee: watches the truth and the wire, and knows nothing of how the pilot works.

use crate::autopilot::{CopterMode, Truth};
use crate::mission::Staged;
use gleaner_guard::Guard;
use gleaner_pilot::{DecisionRecord, Parameters, State};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Duration, GridFrame, Instant};
use std::fmt;

/// A rule that was broken.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// When, since the autopilot's boot.
    pub at: Instant,
    /// Which.
    pub breach: Breach,
}

/// The rules, as they are broken.
#[derive(Clone, Debug, PartialEq)]
pub enum Breach {
    /// A decision was made for a cell that the aircraft is not in.
    NotThere {
        /// The cell claimed.
        claimed: Cell,
        /// How far from its centre the aircraft is, m.
        off_m: f32,
    },
    /// The action is outside the envelope.
    NotAllowed {
        /// Where.
        cell: Cell,
        /// What was decided.
        action: Action,
        /// What is allowed there.
        allowed: ActionMask,
    },
    /// The decision counts with more battery than the actions so far have left.
    BatteryClaim {
        /// What was counted with.
        claimed: BatteryUnits,
        /// What is left.
        left: BatteryUnits,
    },
    /// Decision records are missing on the wire.
    RecordMissing {
        /// The number expected.
        expected: u32,
        /// The number that came.
        came: u32,
    },
    /// The aircraft has left the map.
    OutsideMap,
    /// The aircraft has left its altitude.
    Altitude {
        /// Above home, m.
        height_m: f32,
    },
    /// The pack is empty in flight.
    PackEmpty,
    /// The aircraft has landed by itself where it should not.
    LandedElsewhere {
        /// The cell under it, if any.
        cell: Option<Cell>,
    },
    /// Targets were sent although somebody else had the aircraft.
    TargetsAfterTakeOver,
    /// The pilot has asked for a mode in which it steers.
    AskedForMode,
    /// The pilot on board decided for the aircraft, or sent it home, after somebody else had taken it.
    TookItBack,
    /// A target was not a number.
    NotANumber,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Breach::NotThere { claimed, off_m } => {
                write!(f, "decided for cell {claimed} while {off_m:.1} m away from its centre")
            }
            Breach::NotAllowed { cell, action, allowed } => {
                let names: Vec<&str> = allowed.iter().map(Action::name).collect();
                write!(f, "{} at {cell}, where only {} is allowed", action.name(), names.join(", "))
            }
            Breach::BatteryClaim { claimed, left } => {
                write!(f, "counted with {} battery units, {} are left", claimed.0, left.0)
            }
            Breach::RecordMissing { expected, came } => {
                write!(f, "decision {came} came where {expected} was due")
            }
            Breach::OutsideMap => write!(f, "left the map"),
            Breach::Altitude { height_m } => write!(f, "left its altitude, now {height_m:.1} m"),
            Breach::PackEmpty => write!(f, "the battery is empty in flight"),
            Breach::LandedElsewhere { cell: Some(cell) } => write!(f, "landed in cell {cell}"),
            Breach::LandedElsewhere { cell: None } => write!(f, "landed outside the map"),
            Breach::TargetsAfterTakeOver => write!(f, "sent targets after the aircraft was taken over"),
            Breach::AskedForMode => write!(f, "asked the autopilot for GUIDED by itself"),
            Breach::TookItBack => write!(f, "took the aircraft back from somebody else"),
            Breach::NotANumber => write!(f, "sent a target that is not a number"),
        }
    }
}

/// The referee of one flight.
#[derive(Clone, Debug)]
pub struct Referee {
    guard: Guard,
    frame: GridFrame,
    /// The pilot's parameters as they were seen on the wire.
    parameters: Parameters,
    /// Standard deviation of the position estimate, m.
    wander_m: f32,
    take_over_grace: Duration,
    left: BatteryUnits,
    energy: BatteryUnits,
    decisions: u32,
    expected: Option<u32>,
    /// Whether the pilot's decisions are being flown now.
    flying: bool,
    /// Whether somebody else took the aircraft since it was engaged, and whether it is in their mode now.
    taken: bool,
    theirs: bool,
    /// Whether the autopilot flies home or lands.
    leaving: bool,
    ignored_targets: u32,
    other_mode_since: Option<Instant>,
    excursions: Excursions,
    landed: bool,
    violations: Vec<Violation>,
}

/// What is out of bounds now; told when it begins.
#[derive(Clone, Copy, Debug, Default)]
struct Excursions {
    map: bool,
    altitude: bool,
    pack: bool,
    take_over: bool,
    number: bool,
}

impl Referee {
    /// Between a position and the decision made of it lies one interval of the 10 Hz stream: a metre at 10 m/s. Half a
    /// metre more for steps of the simulation.
    const POSITION_AGE_M: f32 = 1.5;
    /// The pilot holds its altitude within centimetres; a climb to it ends within 3 m.
    const ALTITUDE_BAND_M: f32 = 5.0;
    /// A heartbeat tells of a new mode at once, but a target may have been on the way. On the pilot's clock, s.
    const TAKE_OVER_GRACE_S: f32 = 1.0;

    /// A referee for a mission that was laid out, with the envelope of its reserve.
    #[must_use]
    pub fn new(staged: &Staged, guard: Guard) -> Referee {
        Referee {
            guard,
            frame: staged.frame,
            parameters: Parameters::default(),
            wander_m: staged.plan.wander_m,
            take_over_grace: Duration::from_secs_f32(Referee::TAKE_OVER_GRACE_S * staged.plan.haste),
            left: staged.mission.budget,
            energy: BatteryUnits(0.0),
            decisions: 0,
            expected: None,
            flying: false,
            taken: false,
            theirs: false,
            leaving: false,
            ignored_targets: 0,
            other_mode_since: None,
            excursions: Excursions::default(),
            landed: false,
            violations: Vec::new(),
        }
    }

    /// The pilot said on the wire what one of its parameters is.
    pub fn hear_parameter(&mut self, name: &str, value: f32) {
        // The autopilot's own parameters come by here too.
        let _ = self.parameters.set(name, value);
        // The range of the parameter is within what the guard takes.
        let _ = self.guard.set_reserve(self.parameters.reserve());
    }

    /// The operator asked for the pilot on board: it may have the aircraft.
    pub fn hear_engage_request(&mut self) {
        self.taken = false;
    }

    fn took_it_back(&mut self, now: Instant) {
        self.taken = false;
        self.violated(now, Breach::TookItBack);
    }

    /// The pilot asked the autopilot for a mode.
    pub fn hear_mode_request(&mut self, now: Instant) {
        self.violated(now, Breach::AskedForMode);
    }

    /// A decision record passed by. Whether it is one that is flown, and so begins a slot.
    pub fn hear_decision(&mut self, now: Instant, record: &DecisionRecord, truth: &Truth) -> bool {
        if let Some(expected) = self.expected.filter(|&expected| expected != record.sequence) {
            self.violated(now, Breach::RecordMissing { expected, came: record.sequence });
        }
        self.expected = Some(record.sequence.wrapping_add(1));
        if !matches!(record.state, State::Engaged | State::Homing) {
            return false;
        }
        if self.taken {
            self.took_it_back(now);
        }
        self.flying = true;
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
        let radius_m = self.parameters.arrive_radius().0.min(self.frame.grid().cell().0 / 2.0);
        if off_m > radius_m + Referee::POSITION_AGE_M + 5.0 * self.wander_m {
            self.violated(now, Breach::NotThere { claimed: record.cell, off_m });
        }
    }

    fn judge_action(&mut self, now: Instant, record: &DecisionRecord) {
        if record.battery.0 > self.left.0 {
            self.violated(now, Breach::BatteryClaim { claimed: record.battery, left: self.left });
        }
        let allowed = self.guard.mask(record.cell, record.battery);
        // A return is flown on a shortest way, which the envelope allows as long as the battery lasts at all.
        let shortens =
            self.guard.distance(record.cell.after(record.action)) < self.guard.distance(record.cell);
        let returns = record.state == State::Homing && shortens;
        if !(returns || allowed.allows(record.action)) {
            let (cell, action) = (record.cell, record.action);
            self.violated(now, Breach::NotAllowed { cell, action, allowed });
        }
    }

    /// Looks at the aircraft; call it once per step.
    pub fn watch(&mut self, now: Instant, truth: &Truth) {
        self.watch_mode(now, truth);
        let airborne = !truth.on_ground;
        if self.flying && airborne && truth.mode == CopterMode::Guided {
            self.watch_place(now, truth);
        }
        let empty = airborne && truth.battery.0 <= 0.0;
        if empty && !self.excursions.pack {
            self.violated(now, Breach::PackEmpty);
        }
        self.excursions.pack = empty;
        if truth.killed_by_nan && !self.excursions.number {
            self.excursions.number = true;
            self.violated(now, Breach::NotANumber);
        }
        if self.flying && truth.on_ground && !truth.armed {
            self.flying = false;
            self.judge_landing(now, truth);
        }
    }

    fn watch_mode(&mut self, now: Instant, truth: &Truth) {
        match truth.mode {
            _ if !truth.speaks => self.other_mode_since = None,
            CopterMode::Guided => {
                self.other_mode_since = None;
                // Called back from its way home or down: whose it is now, a decision will tell.
                self.flying &= !std::mem::take(&mut self.leaving);
            }
            CopterMode::Land if truth.mode_is_companions => {}
            _ => {
                self.other_mode_since.get_or_insert(now);
            }
        }
        self.leaving |= matches!(truth.mode, CopterMode::Rtl | CopterMode::Land);
        let lands = truth.mode == CopterMode::Land && truth.mode_is_companions;
        if truth.mode != CopterMode::Guided && !lands {
            // Somebody else has it: where it lands is theirs.
            self.flying &= truth.mode == CopterMode::Rtl && truth.mode_is_companions;
        }
        // Given back in GUIDED, it may be sent home: whether somebody had it meanwhile, a dead line does not tell.
        let theirs = truth.mode != CopterMode::Guided && !truth.mode_is_companions && self.decisions > 0;
        if self.theirs && truth.mode != CopterMode::Guided && truth.mode_is_companions {
            self.took_it_back(now);
        }
        self.theirs = theirs && truth.speaks;
        self.taken |= self.theirs;
        let ignored = truth.ignored_targets > self.ignored_targets;
        self.ignored_targets = truth.ignored_targets;
        let taken = self.other_mode_since.is_some_and(|since| now - since > self.take_over_grace);
        if ignored && taken && !self.excursions.take_over {
            self.violated(now, Breach::TargetsAfterTakeOver);
        }
        self.excursions.take_over = taken && (ignored || self.excursions.take_over);
    }

    /// The pilot flies from cell centre to cell centre, so it keeps half a cell from the edge of the map by itself. Being
    /// half a cell *outside* is a whole cell off.
    fn watch_place(&mut self, now: Instant, truth: &Truth) {
        let (grid, point) = (self.frame.grid(), self.frame.point(&truth.position));
        let cell_m = grid.cell().0;
        let beyond = |at_m: f32, cells: u16| at_m < -0.5 * cell_m || at_m > (f32::from(cells) + 0.5) * cell_m;
        let outside = beyond(point.east_m, grid.width()) || beyond(point.north_m, grid.height());
        if outside && !self.excursions.map {
            self.violated(now, Breach::OutsideMap);
        }
        self.excursions.map = outside;
        let height_m = truth.height_m;
        let off = (height_m - self.parameters.altitude().0).abs() > Referee::ALTITUDE_BAND_M;
        if off && !self.excursions.altitude {
            self.violated(now, Breach::Altitude { height_m });
        }
        self.excursions.altitude = off;
    }

    fn judge_landing(&mut self, now: Instant, truth: &Truth) {
        let cell = self.frame.cell(&truth.position);
        if cell == Some(self.guard.terminal()) {
            self.landed = true;
        } else if truth.mode != CopterMode::Rtl {
            // Handed back to the autopilot, it may return to where it took off.
            self.violated(now, Breach::LandedElsewhere { cell });
        }
    }

    fn violated(&mut self, at: Instant, breach: Breach) {
        self.violations.push(Violation { at, breach });
    }

    /// What was broken so far.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// Decisions that were flown.
    #[must_use]
    pub const fn decisions(&self) -> u32 {
        self.decisions
    }

    /// What they cost.
    #[must_use]
    pub const fn energy(&self) -> BatteryUnits {
        self.energy
    }

    /// Whether a flight under the pilot's command has ended on the ground of the terminal cell.
    #[must_use]
    pub const fn landed(&self) -> bool {
        self.landed
    }
}
