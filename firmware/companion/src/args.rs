//! The command line as it was typed in. Nothing is opened here.

use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand};
use gleaner_policy::EngineKind;
use gleaner_policy::native::WeightFormat;
use gleaner_ports::Endpoint;
use std::path::PathBuf;
use std::process::ExitCode;

/// Gathers data from sensors on the ground with a drone: the pilot on its companion computer.
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
    Run(Setup),
    /// Check configuration, mission, model and ports, and say what to do about each fault.
    Check {
        #[command(flatten)]
        setup: Setup,
        /// Seconds to wait for a heartbeat of the autopilot; 0 does not wait.
        #[arg(long = "wait", value_name = "SECONDS", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=3600))]
        wait_s: u64,
    },
    /// Time one inference in each engine, side by side.
    Bench(Bench),
    /// Convert a model for the native engine, and let it prove itself there.
    Convert(Conversion),
    /// List the parameters that a ground station will see, with the values that a configuration gives them.
    Params {
        /// Configuration file; without it the values of a fresh installation.
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
    /// List the serial devices of this machine and their USB names.
    Ports,
    /// Replay a decision log of `gleaner` or `gleaner-sitl` and list the decisions that change.
    Replay(Replay),
}

/// A flight to decide again.
#[derive(Args)]
pub struct Replay {
    /// The decision log (decisions.jsonl).
    pub log: PathBuf,
    /// The trained policy.
    #[arg(long, value_name = "FILE")]
    pub model: PathBuf,
    /// What runs it: tract or native.
    #[arg(long, value_name = "ENGINE", default_value = "tract")]
    pub engine: EngineKind,
}

/// A model to time.
#[derive(Args)]
pub struct Bench {
    /// The trained policy (.onnx).
    #[arg(long, value_name = "FILE")]
    pub model: PathBuf,
    /// How many inferences of each kind.
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
    /// How weights are stored: f32 or i16.
    #[arg(long, value_name = "FORMAT", default_value = "f32", value_parser = weights)]
    pub weights: WeightFormat,
}

/// Where everything is. A flag overrides the configuration file; its paths are relative to the current folder.
#[derive(Args, Default)]
pub struct Setup {
    /// Configuration file; paths in it are relative to it.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Port to the autopilot: udpin:HOST:PORT, udpout:HOST:PORT, tcpin:HOST:PORT, tcpout:HOST:PORT or
    /// serial:PATH[:BAUD].
    #[arg(long, value_name = "ENDPOINT")]
    pub autopilot: Option<Endpoint>,
    /// Port to the radio that reports signal quality, in the same words; udp: is udpin:.
    #[arg(long, value_name = "ENDPOINT")]
    pub radio: Option<Endpoint>,
    /// The trained policy.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// What runs it: tract or native.
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<EngineKind>,
    /// The mission.
    #[arg(long, value_name = "FILE")]
    pub mission: Option<PathBuf>,
    /// Folder for the decision log, decisions.jsonl.
    #[arg(long = "log", value_name = "FOLDER")]
    pub log_dir: Option<PathBuf>,
}

fn weights(name: &str) -> Result<WeightFormat, String> {
    WeightFormat::from_name(name).ok_or_else(|| "it must be f32 or i16".into())
}

/// Reads the command line of this process.
///
/// # Errors
/// The exit code, after help was printed or the fault was said.
pub fn parse() -> Result<Command, ExitCode> {
    match CommandLine::try_parse() {
        Ok(line) => Ok(line.command),
        Err(error) => Err(answer(&error)),
    }
}

fn answer(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            // Nobody to tell if the help itself cannot be printed.
            let _ = error.print();
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprintln!("gleaner: nothing to do: give a command, for example `gleaner check`, or --help");
            ExitCode::from(2)
        }
        _ => {
            eprintln!("gleaner: {}: see `gleaner --help`", one_line(&error.to_string()));
            ExitCode::from(2)
        }
    }
}

/// The cause without the usage and the tips that follow it.
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
    fn a_wrong_endpoint_is_one_line_that_shows_a_right_one() {
        let Err(error) = CommandLine::try_parse_from(["gleaner", "run", "--autopilot", "1.2.3.4:5"]) else {
            panic!("accepted");
        };
        let line = one_line(&error.to_string());
        assert!(line.contains("did you mean udpout:1.2.3.4:5?"), "{line}");
        assert!(!line.contains('\n') && !line.contains("Usage"), "{line}");
    }
}
