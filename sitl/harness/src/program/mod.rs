//! The program: command line, tasks and their results.

mod announce;
mod arguments;
mod city;
mod fly;
mod load;
mod model;
mod page;
mod radio;
mod results;
mod serve;
mod shrink;
mod sweep;
mod watch;

pub use arguments::Arguments;

use arguments::Task;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why the program could not do its task. Each message says what to do.
#[derive(Debug, Error)]
pub enum ProgramError {
    /// No model.
    #[error("there is no model at {0}: train one with `gleaner-train`, or name one with --model")]
    ModelMissing(PathBuf),
    /// The model cannot be read from the disk.
    #[error("cannot read the model {path}: {source}")]
    ModelRead {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The model is unfit to fly.
    #[error("the model {path} is unfit to fly: {source}: export it again")]
    Model {
        /// Where.
        path: PathBuf,
        /// Why.
        source: gleaner_policy::onnx::ModelError,
    },
    /// No thread to fly on.
    #[error("no thread can be started: {0}: give fewer with --jobs")]
    Thread(io::Error),
    /// The mission cannot be flown.
    #[error("{0}")]
    Flight(#[from] crate::FlightError),
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A city or mission file is wrong.
    #[error("{path}: {cause}")]
    Input {
        /// Which file.
        path: PathBuf,
        /// Where and what.
        cause: String,
    },
    /// A file cannot be imported.
    #[error("{0}")]
    Import(#[from] crate::city::ImportError),
    /// A port cannot be opened.
    #[error("{0}")]
    Port(gleaner_ports::PortError),
    /// The page cannot be served.
    #[error("{0}")]
    Page(#[from] gleaner_dashboard::ServerError),
    /// The system delivers no interrupt.
    #[error("cannot listen for an interrupt: {0}: run it in the foreground of a terminal")]
    Signals(io::Error),
    /// The standard output is closed.
    #[error("cannot print: {0}: give it a standard output")]
    Stdout(io::Error),
    /// There is no terminal to draw in.
    #[error("--watch draws in a terminal and this output is none: run it in a terminal, or use --html")]
    NoTerminal,
    /// The operating system does not wait for a connection.
    #[error("cannot wait for a connection: {0}: free some memory, or file descriptors")]
    Wait(io::Error),
    /// No board connected.
    #[error("no board has connected for {0} s: start it, or correct --board")]
    NoBoard(u64),
    /// A result cannot be written.
    #[error("cannot write {path}: {source}: choose another folder with --out")]
    Write {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Runs the task; whether its result is good.
///
/// # Errors
/// The task could not be done.
pub fn run(arguments: Arguments) -> Result<bool, ProgramError> {
    match arguments.task() {
        Task::Fly(order) => fly::fly(&order),
        Task::Serve(order) => serve::serve(&order),
        Task::Sweep(order) => sweep::sweep(&order),
        Task::City(order) => city::city(&order),
        Task::Radio(order) => radio::radio(&order),
    }
}
