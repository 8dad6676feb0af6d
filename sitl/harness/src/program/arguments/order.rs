//! Checked orders: what the program is to do, without the spelling of the command line.

use crate::city::placement::BoundingBox;
use crate::{AutopilotKind, MissionPlan, Switch};
use gleaner_policy::EngineKind;
use gleaner_ports::Endpoint;
use std::fmt::Write as _;
use std::net::SocketAddr;
use std::path::PathBuf;

/// The task of this run.
#[derive(Debug)]
pub(crate) enum Task {
    Fly(FlyOrder),
    Serve(ServeOrder),
    Sweep(SweepOrder),
    City(CityOrder),
    Radio(RadioOrder),
}

/// Work on city files.
#[derive(Debug)]
pub(crate) enum CityOrder {
    Make { seed: u64, out: PathBuf },
    Show { path: PathBuf },
    Import(ImportOrder),
}

/// Import of building outlines, devices, fence and rally points.
#[derive(Debug)]
pub(crate) struct ImportOrder {
    pub footprints: PathBuf,
    pub out: PathBuf,
    pub cell_m: f32,
    /// `None`: derived from the outlines.
    pub rotation_deg: Option<f64>,
    pub bounds: Option<BoundingBox>,
    pub level_m: f32,
    pub default_m: f32,
    pub devices: Option<PathBuf>,
    pub plan: Option<PathBuf>,
    /// Latitude and longitude, degrees.
    pub terminal: Option<[f64; 2]>,
    pub battery: f32,
    pub mission_out: Option<PathBuf>,
}

/// The simulated radio beside another autopilot simulator.
#[derive(Debug)]
pub(crate) struct RadioOrder {
    pub mission: PathBuf,
    pub seed: u64,
    /// Where the vehicle's positions come from.
    pub vehicle: Endpoint,
    pub reports: Endpoint,
    pub format: RadioFormat,
}

/// How the radio reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RadioFormat {
    /// Postcard in COBS frames, as the modem on board.
    Cobs,
    /// One JSON object a line.
    JsonLines,
    /// The Semtech UDP packet forwarder protocol.
    SemtechUdp,
}

/// Many missions in virtual time.
#[derive(Debug)]
pub(crate) struct SweepOrder {
    pub autopilot: AutopilotKind,
    pub flights: u64,
    pub first: u64,
    pub calm: bool,
    /// Only these incidents of each flight.
    pub incidents: Option<Vec<usize>>,
    pub jobs: Option<usize>,
    pub model: Option<PathBuf>,
    pub engine: EngineKind,
    /// Whether the pilot looks ahead.
    pub lookahead: bool,
    /// Tours per decision.
    pub tours: u32,
    pub json: bool,
    pub table: Option<PathBuf>,
    pub out: PathBuf,
    pub keep: bool,
}

/// Tours per decision in a sweep.
pub(crate) const SWEEP_TOURS: u32 = 40;

impl SweepOrder {
    /// The command that repeats one flight, with only some of its incidents where they are given.
    pub fn replay(&self, flight: u64, incidents: Option<&[usize]>) -> String {
        let mut command = format!("gleaner-sitl sweep --first {flight} --flights 1");
        // Writing to a string cannot fail.
        if self.autopilot != AutopilotKind::default() {
            let _ = write!(command, " --autopilot-kind {}", self.autopilot);
        }
        if self.calm {
            command.push_str(" --calm");
        }
        if let Some(incidents) = incidents {
            let numbers: Vec<String> = incidents.iter().map(usize::to_string).collect();
            let _ = write!(command, " --incidents {}", numbers.join(","));
        }
        if let Some(path) = &self.model {
            let _ = write!(command, " --model {}", path.display());
        }
        if self.engine != EngineKind::Native {
            command.push_str(" --engine tract");
        }
        if !self.lookahead {
            command.push_str(" --lookahead 0");
        }
        if self.tours != SWEEP_TOURS {
            let _ = write!(command, " --tours {}", self.tours);
        }
        command
    }
}

/// The mission of a flight.
#[derive(Debug)]
pub(crate) struct MissionOrder {
    pub plan: MissionPlan,
    /// A city file in place of the default city.
    pub city: Option<PathBuf>,
    /// A mission file in place of a drawn mission.
    pub mission: Option<PathBuf>,
}

/// One mission: in virtual time without a board.
#[derive(Debug)]
pub(crate) struct FlyOrder {
    pub mission: MissionOrder,
    pub preference: f32,
    pub switches: Vec<Switch>,
    pub model: Option<PathBuf>,
    pub engine: EngineKind,
    /// Whether the pilot looks ahead.
    pub lookahead: bool,
    pub board: Option<BoardOrder>,
    pub mission_out: Option<PathBuf>,
    pub json: bool,
    pub out: PathBuf,
    /// The flight as a page.
    pub html: Option<PathBuf>,
    /// Show the flight in the terminal.
    pub watch: bool,
}

/// The ports of the board.
#[derive(Debug)]
pub(crate) struct BoardOrder {
    pub autopilot: Endpoint,
    pub radio: Option<Endpoint>,
}

/// The simulation in real time. With the pilot in this process there is no companion port and no radio port.
#[derive(Debug)]
pub(crate) struct ServeOrder {
    pub mission: MissionOrder,
    /// `None`: the pilot is in this process.
    pub companion: Option<Endpoint>,
    pub radio: Option<Endpoint>,
    pub ground: Endpoint,
    /// Where the live page is served.
    pub http: Option<SocketAddr>,
    pub speed: f32,
    pub auto_takeoff: bool,
    pub mission_out: Option<PathBuf>,
    pub until_landed: bool,
    pub model: Option<PathBuf>,
    pub engine: EngineKind,
    /// Whether the pilot in this process looks ahead.
    pub lookahead: bool,
    pub json: bool,
    pub out: PathBuf,
}
