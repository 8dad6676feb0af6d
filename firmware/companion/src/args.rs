//! The command line as it was typed. Nothing is opened here.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, Parser, Subcommand};
use gleaner_dashboard::http_address;
use gleaner_policy::EngineKind;
use gleaner_policy::native::WeightFormat;
use gleaner_ports::Endpoint;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

/// The pilot on a drone's companion computer: gathers data from ground sensors.
#[derive(Parser)]
#[command(name = "gleaner", version, arg_required_else_help = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

/// What to do.
#[derive(Subcommand)]
pub enum Command {
    /// Serve an autopilot until interrupted. Engages only on request of the operator (GLN_ENABLE).
    Run(Run),
    /// Check configuration, mission, model and ports, and print what to do about each fault.
    Check {
        #[command(flatten)]
        setup: Setup,
        /// Seconds to listen for a heartbeat of the autopilot; 0 does not listen.
        #[arg(long = "wait", value_name = "SECONDS", default_value_t = 3, value_parser = clap::value_parser!(u64).range(..=3600))]
        wait_s: u64,
    },
    /// Time one inference in each engine, and whole decisions on this computer. Exits with 1 if it is too slow.
    Bench(Bench),
    /// Convert a model for the native engine and verify the result.
    Convert(Conversion),
    /// List the parameters that a ground station will see, with the values of a configuration.
    Params {
        /// Configuration file; without it the default values.
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
    /// List the serial devices of this machine and their USB names.
    Ports,
    /// Replay a decision log of `gleaner` or `gleaner-sitl` and list the decisions that change.
    Replay(Replay),
    /// Write a finished flight as a web page in one file.
    Report(Report),
    /// Show a mission.
    #[command(subcommand)]
    Mission(MissionCommand),
    /// Make an ONNX model of your own flyable: check it, add golden pairs, seal it.
    Seal(Sealing),
}

/// A flight to show.
#[derive(Args)]
pub struct Report {
    /// The folder of decisions.jsonl and flight.tlog, or a decisions.jsonl. Its last run is shown.
    #[arg(value_name = "FLIGHT")]
    pub flight: PathBuf,
    /// The mission that was flown [default: mission.bin beside the decision log, which every run writes].
    #[arg(long, value_name = "FILE")]
    pub mission: Option<PathBuf>,
    /// The page to write.
    #[arg(long, value_name = "FILE", default_value = "flight.html")]
    pub html: PathBuf,
    /// The configuration of the run, for GLN_ALT, GLN_RESERVE and the component id; without it the default values.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The trained policy that flew, for its attention [default: the built-in one].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
}

/// What to do with a mission.
#[derive(Subcommand)]
pub enum MissionCommand {
    /// Print the mission: city, fence, battery, and from how many cells each device is in line of sight.
    Show(MissionShow),
}

/// A mission to show.
#[derive(Args)]
pub struct MissionShow {
    /// The mission file.
    #[arg(value_name = "FILE")]
    pub mission: PathBuf,
    /// Also draw it, as a web page in one file: city, fence, terminal, devices and line of sight.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Flight altitude for line of sight, metres.
    #[arg(long, value_name = "METRES", default_value_t = 60, value_parser = clap::value_parser!(u16).range(20..=120))]
    pub altitude: u16,
}

/// A model to seal.
#[derive(Args)]
pub struct Sealing {
    /// The exported policy (.onnx).
    pub model: PathBuf,
    /// The file to write (.onnx).
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Name of the model, as it is shown before a flight.
    #[arg(long, value_name = "NAME")]
    pub name: String,
    /// Version of the model.
    #[arg(long = "model-version", value_name = "VERSION", default_value = "1")]
    pub model_version: String,
    /// What it was trained in.
    #[arg(long, value_name = "TEXT", default_value = "unknown")]
    pub scenario: String,
}

/// A run.
#[derive(Args)]
pub struct Run {
    #[command(flatten)]
    pub setup: Setup,
    /// Forget the parameters that were set from a ground station.
    #[arg(long)]
    pub reset_parameters: bool,
    /// Print one line for each decision, and the traffic of the ports.
    #[arg(long, short)]
    pub verbose: bool,
}

/// A log to replay.
#[derive(Args)]
pub struct Replay {
    /// The decision log (decisions.jsonl).
    pub log: PathBuf,
    /// The trained policy [default: the built-in one].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Engine that runs the model: native or tract [default: native, or tract for another graph].
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<EngineKind>,
}

/// A model to time.
#[derive(Args)]
pub struct Bench {
    /// The trained policy (.onnx) [default: the built-in one].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Number of inferences of each kind.
    #[arg(long, value_name = "NUMBER", default_value_t = 501, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub inferences: u32,
}

/// A model to convert.
#[derive(Args)]
pub struct Conversion {
    /// The trained policy (.onnx).
    pub model: PathBuf,
    /// The file to write (.gln).
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Format of the weights: f32 or i16.
    #[arg(long, value_name = "FORMAT", default_value = "f32", value_parser = weights)]
    pub weights: WeightFormat,
}

/// Files and ports. A flag overrides the configuration file; paths in flags are relative to the current folder.
#[derive(Args, Default)]
pub struct Setup {
    /// Configuration file; paths in it are relative to it.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Port to the autopilot: udpin:HOST:PORT, udpout:HOST:PORT, udpbcast:HOST:PORT, tcpin:HOST:PORT, tcpout:HOST:PORT,
    /// serial:PATH or serial:PATH:BAUD.
    #[arg(long, value_name = "ENDPOINT")]
    pub autopilot: Option<Endpoint>,
    /// Another port, to a ground station; may be given several times. Messages are routed between the ports.
    #[arg(long, value_name = "ENDPOINT")]
    pub ground: Vec<Endpoint>,
    /// Port to the radio that reports signal quality.
    #[arg(long, value_name = "ENDPOINT")]
    pub radio: Option<Endpoint>,
    /// The trained policy [default: the built-in one].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Engine that runs the model: native or tract [default: native, or tract for another graph].
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<EngineKind>,
    /// The mission.
    #[arg(long, value_name = "FILE")]
    pub mission: Option<PathBuf>,
    /// Folder for decisions.jsonl and flight.tlog.
    #[arg(long = "log", value_name = "FOLDER")]
    pub log_dir: Option<PathBuf>,
    /// Serve the live page at this address: a port of this computer, or ADDRESS:PORT. Other computers need a token.
    #[arg(long, value_name = "ADDRESS", value_parser = http_address)]
    pub http: Option<SocketAddr>,
    /// Folder for what outlives a run: parameters set from a ground station, and how the last run ended.
    #[arg(long = "state", value_name = "FOLDER")]
    pub state_dir: Option<PathBuf>,
}

fn weights(name: &str) -> Result<WeightFormat, String> {
    WeightFormat::from_name(name).ok_or_else(|| "it must be f32 or i16".into())
}

/// Reads the command line of this process.
///
/// # Errors
/// The exit code, after the help or the fault was printed.
pub fn parse() -> Result<Command, ExitCode> {
    match CommandLine::try_parse() {
        Ok(line) => Ok(line.command),
        Err(error) => Err(answer(&error)),
    }
}

fn answer(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            // A closed stdout takes no message about itself.
            let _ = error.print();
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprintln!("gleaner: no command: type one, for example `gleaner check`, or --help");
            ExitCode::from(2)
        }
        _ => {
            eprintln!("gleaner: {}: {}", one_line(&error.to_string()), advice(error));
            ExitCode::from(2)
        }
    }
}

/// The nearest right word, or the help.
fn advice(error: &clap::Error) -> String {
    let suggested =
        [ContextKind::SuggestedSubcommand, ContextKind::SuggestedArg, ContextKind::SuggestedValue];
    let word = suggested.into_iter().find_map(|kind| match error.get(kind)? {
        ContextValue::String(word) => Some(word.clone()),
        ContextValue::Strings(words) => words.first().cloned(),
        _ => None,
    });
    word.map_or_else(|| "see `gleaner --help`".to_owned(), |word| format!("did you mean {word}?"))
}

/// The cause, without the usage and the tips that follow it.
fn one_line(text: &str) -> String {
    let cause = text.split("\n\n").next().unwrap_or(text);
    let words: Vec<&str> = cause.split_whitespace().collect();
    words.join(" ").trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn a_wrong_endpoint_gets_the_right_one_suggested() {
        let Err(error) = CommandLine::try_parse_from(["gleaner", "run", "--autopilot", "1.2.3.4:5"]) else {
            panic!("accepted");
        };
        let line = one_line(&error.to_string());
        assert!(line.contains("did you mean udpout:1.2.3.4:5?"), "{line}");
        assert!(!line.contains('\n') && !line.contains("Usage"), "{line}");
    }
}
