//! The command line, parsed and checked. Nothing is done here.

mod city;
mod complaint;
mod order;
mod values;

pub(crate) use order::{
    BoardOrder, CityOrder, FlyOrder, ImportOrder, MissionOrder, RadioFormat, RadioOrder, SWEEP_TOURS,
    ServeOrder, SweepOrder, Task,
};

use crate::{AutopilotKind, EnergyModel, MissionPlan, Switch};
use city::{CityCommand, RadioArguments};
use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand};
use gleaner_dashboard::http_address;
use gleaner_policy::EngineKind;
use gleaner_ports::Endpoint;
use gleaner_units::{BatteryUnits, Degrees};
use gleaner_world::ScenarioKind;
use std::net::SocketAddr;
use std::path::PathBuf;
use values::{autopilot, grid_rotation, scenario, speed, speedup, switch, units, weight};

/// A simulated city with an aircraft, a radio and a referee around the unchanged pilot.
///
/// Without a command it flies one demonstration mission with the shipped policy and changes the preference in flight.
#[derive(Debug, Parser)]
#[command(name = "gleaner-sitl", version, arg_required_else_help = false)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fly one mission over real MAVLink bytes: in virtual time, or with a board on the wall clock.
    Fly(FlyArguments),
    /// Run in real time, with ports for a companion computer, its radio and a ground station.
    Serve(ServeArguments),
    /// Fly many missions in virtual time, drawn by number, each with faults: take-overs, line and radio faults,
    /// battery, wind, estimator, second stations, hostile packets. Lists every flight that broke a rule.
    Sweep(SweepArguments),
    /// Make, show or import a city.
    #[command(subcommand)]
    City(CityCommand),
    /// Run the simulated radio alone, beside an autopilot simulator of your own.
    Radio(RadioArguments),
}

#[derive(Debug, Args)]
struct SweepArguments {
    /// Number of flights.
    #[arg(long, value_name = "NUMBER", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    flights: u64,
    /// Number of the first flight; the others follow.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1_000_000_000))]
    first: u64,
    /// The simulated autopilot: ardupilot or px4.
    #[arg(long, value_name = "KIND", default_value = "ardupilot", value_parser = autopilot)]
    autopilot_kind: AutopilotKind,
    /// Fly without faults, and without the reserve for them.
    #[arg(long)]
    calm: bool,
    /// Keep only these incidents of each flight, by number: 0,2.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', num_args = 0..)]
    incidents: Option<Vec<usize>>,
    /// Number of threads [default: one per core].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    /// The model [default: the built-in one].
    #[arg(long, value_name = "PATH")]
    model: Option<PathBuf>,
    /// Engine that runs the model: native, or tract in a build with that feature.
    #[arg(long, value_name = "ENGINE", default_value = "native")]
    engine: EngineKind,
    /// 1: the pilot looks ahead in its model of the mission (GLN_LOOKAHEAD); 0: the network alone decides.
    #[arg(long, value_name = "0|1", default_value_t = 1, value_parser = clap::value_parser!(u8).range(0..=1))]
    lookahead: u8,
    /// Tours that the look-ahead flies for each decision; a companion computer flies 1000. Faults, authority and energy do
    /// not depend on them, the time of a sweep does. Each hundredth flight has 1000 whatever is set.
    #[arg(long, value_name = "NUMBER", default_value_t = SWEEP_TOURS, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    tours: u32,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Also write the table of fault classes to this file.
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Folder for trajectory.svg, flight.tlog and decisions.jsonl of each flight that broke a rule.
    #[arg(long, value_name = "DIR", default_value = "gleaner-sweep")]
    out: PathBuf,
    /// Write these files for every flight.
    #[arg(long)]
    keep: bool,
}

#[derive(Debug, Args)]
struct MissionArguments {
    /// rd: reach a destination; rb: return to base.
    #[arg(long, default_value = "rd", value_parser = scenario)]
    scenario: ScenarioKind,
    /// Random seed for devices, data and shadowing.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of devices [default: 6].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..=64))]
    devices: Option<u16>,
    /// The mission's battery budget in units [default: 80].
    #[arg(long, value_name = "UNITS", value_parser = units)]
    battery: Option<f32>,
    /// Battery units kept back on top of the way home; 0 is the paper's safety controller.
    #[arg(long, value_name = "UNITS", default_value = "0", value_parser = units)]
    reserve: f32,
    /// The simulated autopilot: ardupilot or px4.
    #[arg(long, value_name = "KIND", default_value = "ardupilot", value_parser = autopilot)]
    autopilot_kind: AutopilotKind,
    /// Use the battery consumption measured on a real ArduCopter instead of the paper's prices.
    #[arg(long)]
    measured_energy: bool,
    /// Draw the mission in this city (CSV of building heights) instead of the default one.
    #[arg(long, value_name = "FILE", conflicts_with = "mission")]
    city: Option<PathBuf>,
    /// Fly this mission file instead of a drawn mission. The aircraft starts over its start cell, or over the open
    /// cell that is farthest from the terminal within the battery.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scenario", "devices"])]
    mission: Option<PathBuf>,
    /// Rotation of the city's grid: direction of its north axis, degrees clockwise from true north, -180 to 180.
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true, value_parser = grid_rotation)]
    grid_rotation: f32,
    /// The model [default: the built-in one].
    #[arg(long, value_name = "PATH")]
    model: Option<PathBuf>,
    /// Engine that runs the model: native, or tract in a build with that feature.
    #[arg(long, value_name = "ENGINE", default_value = "native")]
    engine: EngineKind,
    /// 1: the pilot looks ahead in its model of the mission (GLN_LOOKAHEAD); 0: the network alone decides.
    #[arg(long, value_name = "0|1", default_value_t = 1, value_parser = clap::value_parser!(u8).range(0..=1))]
    lookahead: u8,
}

#[derive(Debug, Args)]
struct FlyArguments {
    #[command(flatten)]
    mission: MissionArguments,
    /// Weight of data, 0 to 1; energy gets the rest.
    #[arg(long, value_name = "W", default_value = "0.5", value_parser = weight)]
    preference: f32,
    /// Change the preference to W, T seconds after the first decision. May be given several times.
    #[arg(long, value_name = "T:W", value_parser = switch)]
    switch: Vec<Switch>,
    /// Fly with a pilot outside this process: a board, or QEMU with -serial tcp:HOST:PORT for this port.
    /// udpin:HOST:PORT, udpout:, tcpin:, tcpout: or serial:PATH[:BAUD].
    #[arg(long, value_name = "ENDPOINT", conflicts_with = "model")]
    board: Option<Endpoint>,
    /// The board's radio port; without it the reports travel as TUNNEL messages on the first port.
    #[arg(long, value_name = "ENDPOINT", requires = "board")]
    radio: Option<Endpoint>,
    /// Aircraft seconds per second of board time [default: 4].
    #[arg(long, alias = "haste", value_name = "FACTOR", requires = "board", value_parser = speedup)]
    speedup: Option<f32>,
    /// Write the mission file that the pilot needs, and the city beside it.
    #[arg(long, value_name = "FILE")]
    mission_out: Option<PathBuf>,
    /// Print one JSON object instead of a summary.
    #[arg(long)]
    json: bool,
    /// Folder for trajectory.svg, flight.tlog and decisions.jsonl.
    #[arg(long, value_name = "DIR", default_value = "gleaner-flight")]
    out: PathBuf,
    /// Show the flight in this terminal while it is flown: + and - change its speed, q ends the showing.
    #[arg(long, conflicts_with_all = ["board", "json"])]
    watch: bool,
    /// Also write the flight as a web page in one file: open it in a browser.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct ServeArguments {
    #[command(flatten)]
    mission: MissionArguments,
    /// The companion computer's port: udpin:HOST:PORT, udpout:, tcpin:, tcpout: or serial:PATH[:BAUD]. Port 0 lets
    /// the system choose.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcpin:127.0.0.1:5762")]
    companion: Endpoint,
    /// Where the radio's reports go.
    #[arg(long, value_name = "ENDPOINT", default_value = "udpout:127.0.0.1:14600")]
    radio: Endpoint,
    /// The ground station's port.
    #[arg(long, value_name = "ENDPOINT", default_value = "udpout:127.0.0.1:14550")]
    gcs: Endpoint,
    /// Serve the live page at this address: a port, or ADDRESS:PORT. Other computers need one of the tokens that are
    /// printed.
    #[arg(long, value_name = "ADDRESS", value_parser = http_address)]
    http: Option<SocketAddr>,
    /// Times real time. A companion outside this process runs in real time, so use it with --onboard.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed)]
    speed: f32,
    /// Run the pilot inside this process instead of waiting for a companion.
    #[arg(long)]
    onboard: bool,
    /// Arm and take off; the ground station still engages.
    #[arg(long)]
    auto_takeoff: bool,
    /// Write the mission file that `gleaner run` needs, and the city beside it.
    #[arg(long, value_name = "FILE")]
    mission_out: Option<PathBuf>,
    /// Stop after the landing, with the summary and the exit code of `fly`.
    #[arg(long)]
    until_landed: bool,
    /// Print one JSON object instead of a summary.
    #[arg(long)]
    json: bool,
    /// Folder for trajectory.svg, flight.tlog and decisions.jsonl.
    #[arg(long, value_name = "DIR", default_value = "gleaner-flight")]
    out: PathBuf,
}

/// Defaults for an empty command line: data first, then home by the cheapest way.
const DEMONSTRATION: [&str; 7] =
    ["gleaner-sitl", "fly", "--preference", "0.9", "--switch", "150:0.1", "--seed=1"];

/// A mission of six minutes then takes one and a half, and between two positions the aircraft moves no further than
/// the referee allows for.
const BOARD_SPEEDUP: f32 = 4.0;

impl Arguments {
    /// Reads the command line of this process.
    ///
    /// # Errors
    /// The exit code, after help was printed or the error was reported in one line.
    pub fn read() -> Result<Arguments, u8> {
        Arguments::try_parse().map_err(|error| match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // Without a standard output there is nothing left to do.
                let _ = error.print();
                0
            }
            _ => {
                eprintln!("gleaner-sitl: {}", complaint::of(&error));
                2
            }
        })
    }

    /// The task.
    pub(crate) fn task(self) -> Task {
        let command = self.command.or_else(|| Arguments::try_parse_from(DEMONSTRATION).ok()?.command);
        match command {
            Some(Command::Fly(arguments)) => Task::Fly(arguments.order()),
            Some(Command::Serve(arguments)) => Task::Serve(arguments.order()),
            Some(Command::Sweep(arguments)) => Task::Sweep(arguments.order()),
            Some(Command::City(command)) => Task::City(command.order()),
            Some(Command::Radio(arguments)) => Task::Radio(arguments.order()),
            None => unreachable!("the demonstration is a command; a test parses it"),
        }
    }
}

impl MissionArguments {
    fn order(&self, speedup: f32) -> MissionOrder {
        let energy = if self.measured_energy { EnergyModel::Measured } else { EnergyModel::Nominal };
        let plan = MissionPlan {
            devices: self.devices.map(usize::from),
            battery: self.battery.map(BatteryUnits),
            reserve: BatteryUnits(self.reserve),
            autopilot: self.autopilot_kind,
            energy,
            speedup,
            rotation: Degrees(self.grid_rotation),
            ..MissionPlan::new(self.scenario, self.seed)
        };
        MissionOrder { plan, city: self.city.clone(), mission: self.mission.clone() }
    }
}

impl FlyArguments {
    fn order(self) -> FlyOrder {
        let mut switches = self.switch;
        switches.sort_by_key(|switch| switch.after);
        let speedup = if self.board.is_some() { self.speedup.unwrap_or(BOARD_SPEEDUP) } else { 1.0 };
        FlyOrder {
            mission: self.mission.order(speedup),
            preference: self.preference,
            switches,
            model: self.mission.model,
            engine: self.mission.engine,
            lookahead: self.mission.lookahead == 1,
            board: self.board.map(|autopilot| BoardOrder { autopilot, radio: self.radio }),
            mission_out: self.mission_out,
            json: self.json,
            out: self.out,
            html: self.html,
            watch: self.watch,
        }
    }
}

impl ServeArguments {
    fn order(self) -> ServeOrder {
        let outside = !self.onboard;
        // A pilot in this process shares the aircraft's clock at every speed.
        let speedup = if outside { self.speed.max(1.0) } else { 1.0 };
        ServeOrder {
            mission: self.mission.order(speedup),
            companion: outside.then_some(self.companion),
            radio: outside.then_some(self.radio),
            ground: self.gcs,
            http: self.http,
            speed: self.speed,
            auto_takeoff: self.auto_takeoff,
            mission_out: self.mission_out,
            until_landed: self.until_landed,
            model: self.mission.model,
            engine: self.mission.engine,
            lookahead: self.mission.lookahead == 1,
            json: self.json,
            out: self.out,
        }
    }
}

impl SweepArguments {
    fn order(self) -> SweepOrder {
        SweepOrder {
            autopilot: self.autopilot_kind,
            flights: self.flights,
            first: self.first,
            calm: self.calm,
            incidents: self.incidents,
            jobs: self.jobs.map(usize::from),
            model: self.model,
            engine: self.engine,
            lookahead: self.lookahead == 1,
            tours: self.tours,
            json: self.json,
            table: self.table,
            out: self.out,
            keep: self.keep,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn order(words: &[&str]) -> FlyOrder {
        let all = ["gleaner-sitl", "fly"].iter().chain(words);
        match Arguments::try_parse_from(all).unwrap().task() {
            Task::Fly(order) => order,
            _ => panic!("fly was given"),
        }
    }

    #[test]
    fn the_demonstration_switches_the_preference() {
        Arguments::command().debug_assert();
        let Task::Fly(order) = Arguments::try_parse_from(["gleaner-sitl"]).unwrap().task() else {
            panic!("the demonstration flies");
        };
        assert_eq!((order.preference, order.switches.len()), (0.9, 1));
    }

    #[test]
    fn switches_are_sorted_and_mistakes_are_refused() {
        let order = order(&["--switch", "60:0.2", "--switch", "30:1", "--scenario", "RB", "--devices", "9"]);
        assert_eq!(order.switches.iter().map(|switch| switch.w_data).collect::<Vec<_>>(), [1.0, 0.2]);
        let plan = order.mission.plan;
        assert_eq!((plan.kind, plan.devices), (ScenarioKind::ReturnBase, Some(9)));
        for wrong in [
            ["--preference", "2"],
            ["--preference", "NaN"],
            ["--switch", "10"],
            ["--switch", "10:-1"],
            ["--switch", "x:0.5"],
            ["--scenario", "rx"],
            ["--devices", "0"],
            ["--battery", "inf"],
            ["--radio", "tcpin:127.0.0.1:0"],
            ["--speedup", "4"],
            ["--autopilot-kind", "inav"],
        ] {
            let words = ["gleaner-sitl", "fly"].iter().chain(&wrong);
            assert!(Arguments::try_parse_from(words).is_err(), "{wrong:?}");
        }
    }
}
