//! The rules that the referee checks.

use gleaner_units::{Action, BatteryUnits, Cell, Instant};
use std::fmt;

/// A broken rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// When, since the autopilot's boot.
    pub at: Instant,
    /// Which rule.
    pub rule: Rule,
}

/// The rules, by how they are broken.
#[derive(Clone, Debug, PartialEq)]
pub enum Rule {
    /// A decision was made for a cell that the aircraft is neither in nor about to reach.
    NotThere {
        /// The cell of the decision.
        claimed: Cell,
        /// Distance of the aircraft from its centre, m.
        off_m: f32,
    },
    /// The action is outside the safety envelope.
    NotAllowed {
        /// Where.
        cell: Cell,
        /// The action.
        action: Action,
        /// Battery that the decision counted with.
        battery: BatteryUnits,
    },
    /// The decision counts with more battery than the decisions so far have left.
    BatteryClaim {
        /// Battery of the decision.
        claimed: BatteryUnits,
        /// Battery left by the referee's account.
        left: BatteryUnits,
    },
    /// Decision records are missing on the line.
    RecordMissing {
        /// The sequence number expected.
        expected: u32,
        /// The one that came.
        came: u32,
    },
    /// The aircraft left the map while the pilot flew it.
    OutsideMap,
    /// The aircraft was over a cell outside the fence while the pilot flew it.
    OverForbiddenCell {
        /// The cell under it, if any.
        cell: Option<Cell>,
    },
    /// The aircraft left its altitude for longer than a correction takes while the pilot flew it.
    Altitude {
        /// Above home, m.
        height_m: f32,
    },
    /// The pack is empty in flight although it held enough for the shortest mission when the pilot engaged.
    PackEmpty,
    /// The aircraft landed under the pilot's command outside the terminal.
    LandedElsewhere {
        /// The cell under it, if any.
        cell: Option<Cell>,
    },
    /// A position target was sent after another mode had been delivered to the pilot, without a new request to engage.
    TargetAfterTakeOver,
    /// A command that moves the aircraft was sent in the same situation.
    CommandAfterTakeOver,
    /// A position target replaced those of another station, which had been in force for seconds.
    OverwroteTarget,
    /// Targets were streamed while PX4 reported a failsafe: they would end it.
    StreamInFailsafe,
    /// A command that moves the aircraft was sent without a recent heartbeat in GUIDED or OFFBOARD.
    StaleEvidence,
    /// The pilot asked the autopilot for GUIDED or OFFBOARD.
    AskedForGuided,
    /// The pilot decided for the aircraft after a take-over.
    TookItBack,
    /// The pilot moved the aircraft without any request to engage.
    NeverAsked,
    /// The pilot engaged on a request that was older than a minute.
    RequestExpired,
    /// A position target was not finite.
    NotANumber,
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Rule::NotThere { claimed, off_m } => {
                write!(f, "decided for cell {claimed} at {off_m:.1} m from its centre")
            }
            Rule::NotAllowed { cell, action, battery } => {
                write!(f, "{} at {cell} with {} battery units is not allowed", action.name(), battery.0)
            }
            Rule::BatteryClaim { claimed, left } => {
                write!(f, "decided with {} battery units where {} are left", claimed.0, left.0)
            }
            Rule::RecordMissing { expected, came } => {
                write!(f, "decision {came} came where {expected} was due")
            }
            Rule::OutsideMap => write!(f, "left the map"),
            Rule::OverForbiddenCell { cell: Some(cell) } => write!(f, "flew over the forbidden cell {cell}"),
            Rule::OverForbiddenCell { cell: None } => write!(f, "flew over a forbidden cell"),
            Rule::Altitude { height_m } => write!(f, "left its altitude, now {height_m:.1} m"),
            Rule::PackEmpty => write!(f, "the battery is empty in flight"),
            Rule::LandedElsewhere { cell: Some(cell) } => write!(f, "landed in cell {cell}"),
            Rule::LandedElsewhere { cell: None } => write!(f, "landed outside the map"),
            Rule::TargetAfterTakeOver => write!(f, "sent a target after another mode was received"),
            Rule::CommandAfterTakeOver => write!(f, "sent a command after another mode was received"),
            Rule::OverwroteTarget => write!(f, "replaced the targets of another station"),
            Rule::StreamInFailsafe => write!(f, "streamed targets during a failsafe"),
            Rule::StaleEvidence => write!(f, "sent a command without a recent heartbeat in our mode"),
            Rule::AskedForGuided => write!(f, "asked the autopilot for GUIDED by itself"),
            Rule::TookItBack => write!(f, "decided for an aircraft that was taken over"),
            Rule::NeverAsked => write!(f, "moved the aircraft without a request to engage"),
            Rule::RequestExpired => write!(f, "engaged on an expired request"),
            Rule::NotANumber => write!(f, "sent a target that is not a number"),
        }
    }
}
