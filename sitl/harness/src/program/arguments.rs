//! What was typed, checked. Nothing is done here.

use crate::{MissionPlan, Switch};
use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand};
use gleaner_policy::EngineKind;
use gleaner_ports::Endpoint;
use gleaner_units::{BatteryUnits, Degrees, Duration};
use gleaner_world::ScenarioKind;
use std::path::PathBuf;

/// A simulated city with an aircraft, a radio and a referee around the unchanged pilot.
///
/// Without a command it flies one demonstration mission with the shipped policy and switches the preference in
/// mid-flight.
#[derive(Debug, Parser)]
#[command(name = "gleaner-sitl", version, arg_required_else_help = false)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fly one mission over real MAVLink bytes: in virtual time, or with a board in the wall's time.
    Fly(FlyArguments),
    /// Run in real time, with ports for a companion computer, its radio and a ground station.
    Serve(ServeArguments),
    /// Fly many missions in virtual time, drawn by number, in which things go wrong: the pilot takes over, charge is
    /// lost, the autopilot reboots, lines are cut or noisy, the radio is silent. Says which flight broke a rule.
    Sweep(SweepArguments),
}

#[derive(Debug, Args)]
struct SweepArguments {
    /// How many flights.
    #[arg(long, value_name = "NUMBER", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    flights: u64,
    /// Number of the first flight; the others follow.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1_000_000_000))]
    first: u64,
    /// Missions in which nothing goes wrong, without the reserve for it.
    #[arg(long)]
    calm: bool,
    /// The model [default: the built-in one].
    #[arg(long, value_name = "PATH")]
    model: Option<PathBuf>,
    /// Engine that runs the model: native, or tract in a build with that feature.
    #[arg(long, value_name = "ENGINE", default_value = "native")]
    engine: EngineKind,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
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
    /// Names devices, data and shadowing.
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
    /// Rotation of the city's grid: direction of its north axis, degrees clockwise from true north, -180 to 180.
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true, value_parser = rotation)]
    grid_rotation: f32,
    /// The model [default: the built-in one].
    #[arg(long, value_name = "PATH")]
    model: Option<PathBuf>,
    /// Engine that runs the model: native, or tract in a build with that feature.
    #[arg(long, value_name = "ENGINE", default_value = "native")]
    engine: EngineKind,
}

#[derive(Debug, Args)]
struct FlyArguments {
    #[command(flatten)]
    mission: MissionArguments,
    /// Weight of data, 0 to 1; energy gets the rest.
    #[arg(long, value_name = "W", default_value = "0.5", value_parser = weight)]
    preference: f32,
    /// Change the preference to W, T seconds after engaging. May be given several times.
    #[arg(long, value_name = "T:W", value_parser = switch)]
    switch: Vec<Switch>,
    /// Fly with a pilot that is not in this process: a board, or QEMU with -serial tcp:HOST:PORT for the port that is
    /// named here. udpin:HOST:PORT, udpout:, tcpin:, tcpout: or serial:PATH[:BAUD].
    #[arg(long, value_name = "ENDPOINT", conflicts_with = "model")]
    board: Option<Endpoint>,
    /// Where the board's radio is plugged in; without it the reports come by TUNNEL on the first port.
    #[arg(long, value_name = "ENDPOINT", requires = "board")]
    radio: Option<Endpoint>,
    /// How many seconds the aircraft lives while the board's clock, which nobody can hurry, counts one [default: 4].
    #[arg(long, value_name = "FACTOR", requires = "board", value_parser = haste)]
    haste: Option<f32>,
    /// Write the mission file that the pilot needs, and the city next to it.
    #[arg(long, value_name = "FILE")]
    mission_out: Option<PathBuf>,
    /// Print one JSON object instead of a summary.
    #[arg(long)]
    json: bool,
    /// Folder for trajectory.svg, flight.tlog and decisions.jsonl.
    #[arg(long, value_name = "DIR", default_value = "gleaner-flight")]
    out: PathBuf,
}

#[derive(Debug, Args)]
struct ServeArguments {
    #[command(flatten)]
    mission: MissionArguments,
    /// Where the companion computer connects: udpin:HOST:PORT, udpout:, tcpin:, tcpout: or serial:PATH[:BAUD]. Port 0
    /// lets the system choose.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcpin:127.0.0.1:5762")]
    companion: Endpoint,
    /// Where the radio's reports go.
    #[arg(long, value_name = "ENDPOINT", default_value = "udpout:127.0.0.1:14600")]
    radio: Endpoint,
    /// Where the ground station is.
    #[arg(long, value_name = "ENDPOINT", default_value = "udpout:127.0.0.1:14550")]
    gcs: Endpoint,
    /// How many times faster than real time; an external companion keeps real time, so use it with --onboard.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed)]
    speed: f32,
    /// Run the pilot inside this process instead of waiting for a companion.
    #[arg(long)]
    onboard: bool,
    /// Arm and take off; engaging stays with the ground station.
    #[arg(long)]
    auto_takeoff: bool,
    /// Write the mission file that `gleaner run` needs, and the city next to it.
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

/// What is to be done.
#[derive(Debug)]
pub(crate) enum Task {
    Fly(FlyOrder),
    Serve(ServeOrder),
    Sweep(SweepOrder),
}

impl SweepOrder {
    /// The flags that make a flight the same again.
    pub fn same(&self) -> String {
        let calm = if self.calm { " --calm" } else { "" };
        let model = self.model.as_ref().map_or(String::new(), |path| format!(" --model {}", path.display()));
        let engine = if self.engine == EngineKind::Native { "" } else { " --engine tract" };
        format!("{calm}{model}{engine}")
    }
}

/// Many missions in virtual time.
#[derive(Debug)]
pub(crate) struct SweepOrder {
    pub flights: u64,
    pub first: u64,
    pub calm: bool,
    pub model: Option<PathBuf>,
    pub engine: EngineKind,
    pub json: bool,
    pub out: PathBuf,
    pub keep: bool,
}

/// One mission: in virtual time without a board.
#[derive(Debug)]
pub(crate) struct FlyOrder {
    pub plan: MissionPlan,
    pub preference: f32,
    pub switches: Vec<Switch>,
    pub model: Option<PathBuf>,
    pub engine: EngineKind,
    pub board: Option<BoardOrder>,
    pub mission_out: Option<PathBuf>,
    pub json: bool,
    pub out: PathBuf,
}

/// Where the board is plugged in.
#[derive(Debug)]
pub(crate) struct BoardOrder {
    pub autopilot: Endpoint,
    pub radio: Option<Endpoint>,
}

/// The simulation in real time. With the pilot on board there is no companion port and no radio port.
#[derive(Debug)]
pub(crate) struct ServeOrder {
    pub plan: MissionPlan,
    /// `None`: the pilot is in this process.
    pub companion: Option<Endpoint>,
    pub radio: Option<Endpoint>,
    pub ground: Endpoint,
    pub speed: f32,
    pub auto_takeoff: bool,
    pub mission_out: Option<PathBuf>,
    pub until_landed: bool,
    pub model: Option<PathBuf>,
    pub engine: EngineKind,
    pub json: bool,
    pub out: PathBuf,
}

/// The demonstration: data first, then home by the cheapest way.
const DEMONSTRATION: [&str; 7] =
    ["gleaner-sitl", "fly", "--preference", "0.9", "--switch", "150:0.1", "--seed=1"];

/// A mission of six minutes then takes one and a half, and between two positions the aircraft moves no further than
/// the referee allows for.
const BOARD_HASTE: f32 = 4.0;

impl Arguments {
    /// Reads the command line of this process.
    ///
    /// # Errors
    /// The exit code, after help was printed or the fault was said in one line.
    pub fn read() -> Result<Arguments, u8> {
        Arguments::try_parse().map_err(|error| match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // Nobody to tell if the help itself cannot be printed.
                let _ = error.print();
                0
            }
            _ => {
                eprintln!("gleaner-sitl: {}: see `gleaner-sitl --help`", one_line(&error.to_string()));
                2
            }
        })
    }

    /// What was meant.
    pub(crate) fn task(self) -> Task {
        let command = self.command.or_else(|| Arguments::try_parse_from(DEMONSTRATION).ok()?.command);
        match command {
            Some(Command::Fly(arguments)) => Task::Fly(arguments.order()),
            Some(Command::Serve(arguments)) => Task::Serve(arguments.order()),
            Some(Command::Sweep(arguments)) => Task::Sweep(arguments.order()),
            None => unreachable!("the demonstration is a command; a test says so"),
        }
    }
}

impl MissionArguments {
    fn plan(&self) -> MissionPlan {
        MissionPlan {
            devices: self.devices.map(usize::from),
            battery: self.battery.map(BatteryUnits),
            reserve: BatteryUnits(self.reserve),
            rotation: Degrees(self.grid_rotation),
            ..MissionPlan::new(self.scenario, self.seed)
        }
    }
}

impl FlyArguments {
    fn order(self) -> FlyOrder {
        let mut switches = self.switch;
        switches.sort_by_key(|switch| switch.after);
        let haste = if self.board.is_some() { self.haste.unwrap_or(BOARD_HASTE) } else { 1.0 };
        FlyOrder {
            plan: MissionPlan { haste, ..self.mission.plan() },
            preference: self.preference,
            switches,
            model: self.mission.model,
            engine: self.mission.engine,
            board: self.board.map(|autopilot| BoardOrder { autopilot, radio: self.radio }),
            mission_out: self.mission_out,
            json: self.json,
            out: self.out,
        }
    }
}

impl ServeArguments {
    fn order(self) -> ServeOrder {
        let outside = !self.onboard;
        // With the pilot in this process both live by the same clock, however fast it goes.
        let haste = if outside { self.speed.max(1.0) } else { 1.0 };
        ServeOrder {
            plan: MissionPlan { haste, ..self.mission.plan() },
            companion: outside.then_some(self.companion),
            radio: outside.then_some(self.radio),
            ground: self.gcs,
            speed: self.speed,
            auto_takeoff: self.auto_takeoff,
            mission_out: self.mission_out,
            until_landed: self.until_landed,
            model: self.mission.model,
            engine: self.mission.engine,
            json: self.json,
            out: self.out,
        }
    }
}

impl SweepArguments {
    fn order(self) -> SweepOrder {
        let SweepArguments { flights, first, calm, model, engine, json, out, keep } = self;
        SweepOrder { flights, first, calm, model, engine, json, out, keep }
    }
}

/// The cause without the usage and the tips that follow it.
fn one_line(text: &str) -> String {
    let cause = text.split("\n\n").next().unwrap_or(text);
    let words: Vec<&str> = cause.split_whitespace().collect();
    words.join(" ").trim_start_matches("error: ").to_owned()
}

fn scenario(text: &str) -> Result<ScenarioKind, String> {
    text.parse().map_err(|error| format!("{error}"))
}

fn weight(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|weight| (0.0..=1.0).contains(weight));
    number.ok_or_else(|| "a weight is a number from 0 to 1".into())
}

fn units(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|units| (0.0..=500.0).contains(units));
    number.ok_or_else(|| "battery units are a number from 0 to 500".into())
}

fn rotation(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|degrees| (-180.0..=180.0).contains(degrees));
    number.ok_or_else(|| "a rotation is a number of degrees from -180 to 180".into())
}

fn speed(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|factor| (0.1..=50.0).contains(factor));
    number.ok_or_else(|| "a speed is a factor from 0.1 to 50".into())
}

fn haste(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|factor| (1.0..=10.0).contains(factor));
    number.ok_or_else(|| "a haste is a factor from 1 to 10".into())
}

fn switch(text: &str) -> Result<Switch, String> {
    let (after_s, w_data) = text.split_once(':').ok_or("write seconds:weight, as in 60:0.2")?;
    let after_s = after_s.parse::<f32>().ok().filter(|seconds| (0.0..=4000.0).contains(seconds));
    let after_s = after_s.ok_or("the time is a number of seconds from 0 to 4000, as in 60:0.2")?;
    Ok(Switch { after: Duration::from_secs_f32(after_s), w_data: weight(w_data)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn order(words: &[&str]) -> FlyOrder {
        let all = ["gleaner-sitl", "fly"].iter().chain(words);
        match Arguments::try_parse_from(all).unwrap().task() {
            Task::Fly(order) => order,
            Task::Serve(_) | Task::Sweep(_) => panic!("fly was typed"),
        }
    }

    #[test]
    fn the_command_line_is_consistent_and_the_demonstration_switches() {
        Arguments::command().debug_assert();
        let Task::Fly(order) = Arguments::try_parse_from(["gleaner-sitl"]).unwrap().task() else {
            panic!("the demonstration flies");
        };
        assert_eq!((order.preference, order.switches.len()), (0.9, 1));
    }

    #[test]
    fn switches_are_sorted_and_mistakes_are_refused() {
        let order = order(&["--switch", "60:0.2", "--switch", "30:1", "--scenario", "rb", "--devices", "9"]);
        assert_eq!(order.switches.iter().map(|switch| switch.w_data).collect::<Vec<_>>(), [1.0, 0.2]);
        assert_eq!((order.plan.kind, order.plan.devices), (ScenarioKind::ReturnBase, Some(9)));
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
            ["--haste", "4"],
        ] {
            let words = ["gleaner-sitl", "fly"].iter().chain(&wrong);
            assert!(Arguments::try_parse_from(words).is_err(), "{wrong:?}");
        }
    }
}
