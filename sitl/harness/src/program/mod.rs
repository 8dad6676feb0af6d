//! The program: what was typed, and what is done with it.

mod arguments;
mod fly;
mod introduction;
mod model;
mod results;
mod serve;
mod sweep;

pub use arguments::Arguments;

use arguments::Task;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why the program could not do what was asked. Each says what to do.
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
    /// The mission cannot be flown.
    #[error("{0}")]
    Flight(#[from] crate::FlightError),
    /// A port cannot be opened.
    #[error("{0}")]
    Port(gleaner_ports::PortError),
    /// The system does not let us hear an interrupt.
    #[error("cannot listen for an interrupt: {0}: run it in the foreground of a terminal")]
    Signals(io::Error),
    /// Nobody reads what we print.
    #[error("cannot print: {0}: give it a standard output")]
    Stdout(io::Error),
    /// The operating system does not wait for a connection.
    #[error("cannot wait for a connection: {0}: free some memory, or file descriptors")]
    Wait(io::Error),
    /// No board came.
    #[error("no board has connected for {0} s: start it, or correct --board")]
    NobodyConnects(u64),
    /// A result cannot be written.
    #[error("cannot write {path}: {source}: choose another folder with --out")]
    Write {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Does what was asked; whether it went well.
///
/// # Errors
/// It could not be done at all.
pub fn run(arguments: Arguments) -> Result<bool, ProgramError> {
    match arguments.task() {
        Task::Fly(order) => fly::fly(&order),
        Task::Serve(order) => serve::serve(&order),
        Task::Sweep(order) => sweep::sweep(&order),
    }
}
