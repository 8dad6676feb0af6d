//! The installed models: number 0 is the configured one, number n the nth of `models`.
//!
//! `GLN_MODEL` chooses one while nothing is flown. A thread of its own reads and tests the file, so that heartbeats go on;
//! the model in use is replaced only by one that has reproduced its golden pairs.

use crate::clock;
use crate::config::Config;
use crate::load::{self, LoadError};
use gleaner_link::{ParameterId, Parameters, Severity};
use gleaner_pilot::{Budget, LookingAhead, Onboard};
use gleaner_policy::{Engine, EngineKind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

/// The policy of this program.
pub type FlightPolicy = LookingAhead<Engine>;

/// The policy that a model becomes.
pub fn policy(engine: Engine) -> FlightPolicy {
    LookingAhead::new(engine, Budget::LINUX).with_clock(clock::now)
}

/// The files of the models, by number. `None` is the built-in model.
#[derive(Clone)]
pub struct Installed {
    files: Vec<Option<PathBuf>>,
    engine: Option<EngineKind>,
}

impl Installed {
    /// Those of the configuration.
    pub fn new(config: &Config) -> Installed {
        let others = config.models.iter().cloned().map(Some);
        Installed { files: [config.model.clone()].into_iter().chain(others).collect(), engine: config.engine }
    }

    /// The file with this number; the inner `None` is the built-in model.
    pub fn file(&self, number: usize) -> Option<Option<&Path>> {
        self.files.get(number).map(Option::as_deref)
    }

    /// The largest number.
    pub fn last(&self) -> usize {
        self.files.len() - 1
    }

    /// Reads and tests the model with this number.
    ///
    /// # Errors
    /// The file cannot be read, or is no model that may fly.
    pub fn load(&self, number: usize) -> Result<Engine, LoadError> {
        load::model(self.file(number).flatten(), self.engine)
    }

    /// The model that a run starts with: the one that was chosen from the ground, or the configured one when that cannot
    /// be used. Then `parameters` show 0, and the line says why.
    ///
    /// # Errors
    /// As [`Installed::load`] for the configured model.
    pub fn first(&self, parameters: &mut Parameters) -> Result<(Engine, usize, Option<String>), LoadError> {
        let wanted = parameters.model();
        let chosen = match usize::try_from(wanted) {
            Ok(0) => return Ok((self.load(0)?, 0, None)),
            Ok(number) if number <= self.last() => self.load(number).map_err(|error| error.to_string()),
            _ => Err(format!("there are models 0..{}", self.last())),
        };
        match chosen {
            Ok(engine) => Ok((engine, usize::try_from(wanted).unwrap_or(0), None)),
            Err(cause) => {
                // 0 is in the parameter's range.
                let _ = parameters.set_id(ParameterId::Model, 0.0);
                Ok((self.load(0)?, 0, Some(format!("GLN_MODEL {wanted} refused: {cause}: model 0 flies"))))
            }
        }
    }
}

type Loaded = (usize, Result<Box<Engine>, LoadError>);

/// The choice of a run.
pub struct Models {
    installed: Installed,
    active: usize,
    previous: usize,
    /// The number that is being loaded.
    awaited: Option<usize>,
    orders: Sender<usize>,
    loaded: Receiver<Loaded>,
}

impl Models {
    /// Begins with model `active` in use. Call it before the program becomes real-time: its thread must not have that
    /// priority.
    pub fn start(installed: Installed, active: usize) -> Models {
        let (orders, waiting) = channel();
        let (done, loaded) = channel();
        let files = installed.clone();
        std::thread::spawn(move || {
            for number in waiting {
                // At the end of the run no one receives it any more.
                let _ = done.send((number, files.load(number).map(Box::new)));
            }
        });
        Models { installed, active, previous: active, awaited: None, orders, loaded }
    }

    /// Follows `GLN_MODEL`. Never waits.
    pub fn poll(&mut self, onboard: &mut Onboard<FlightPolicy>) {
        while let Ok(loaded) = self.loaded.try_recv() {
            self.take(loaded, onboard);
        }
        let shown = self.awaited.unwrap_or(self.active);
        let wanted = onboard.parameters().model();
        if usize::try_from(wanted) == Ok(shown) {
            return;
        }
        let number = usize::try_from(wanted).unwrap_or(self.previous);
        if number > self.installed.last() {
            self.refuse(onboard, number, &format!("there are models 0..{}", self.installed.last()));
        } else if !onboard.may_replace_policy() {
            self.refuse(onboard, number, "not in flight");
        } else if number == self.active {
            self.awaited = None;
            show(onboard, self.active);
        } else {
            self.awaited = Some(number);
            show(onboard, number);
            // The thread ends only with this end of the channel.
            let _ = self.orders.send(number);
        }
    }

    fn take(&mut self, (number, loaded): Loaded, onboard: &mut Onboard<FlightPolicy>) {
        if self.awaited != Some(number) {
            return;
        }
        let engine = match loaded {
            Ok(engine) => *engine,
            Err(error) => {
                tracing::warn!("model {number} refused: {error}");
                return self.refuse(onboard, number, "see the log");
            }
        };
        let name = engine.name().to_owned();
        if onboard.replace_policy(policy(engine)).is_err() {
            return self.refuse(onboard, number, "not in flight");
        }
        self.awaited = None;
        self.previous = std::mem::replace(&mut self.active, number);
        onboard.say(Severity::Notice, format_args!("gleaner: model {number}: {name}"));
    }

    /// The model in use stays.
    fn refuse(&mut self, onboard: &mut Onboard<FlightPolicy>, number: usize, cause: &str) {
        self.awaited = None;
        show(onboard, self.active);
        let active = self.active;
        onboard
            .say(Severity::Warning, format_args!("gleaner: model {number} refused, {cause}; {active} stays"));
    }
}

fn show(onboard: &mut Onboard<FlightPolicy>, number: usize) {
    onboard.show_model(u8::try_from(number).unwrap_or(u8::MAX));
}
