//! The off-policy training run: environment steps into a replay memory, updates from it.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::env::flight::{Flight, Reward};
use crate::env::greedy::Greedy;
use crate::env::mission::random_preference;
use crate::env::site::Site;
use crate::judge::validation::{Tables, Validation};
use crate::keep::checkpoint::CheckpointError;
use crate::keep::snapshot::{LAST, Snapshot};
use crate::learn::algorithm::{Algorithm, Inference};
use crate::learn::constants::CONSTANTS;
use crate::learn::n_step::NStep;
use crate::learn::policy::NetworkPolicy;
use crate::learn::replay::{Replay, Transition};
use crate::learn::resume;
use crate::learn::trainer::{Pace, TrainError, Trainer};
use crate::net;
use crate::observe::Encoding;
use crate::settings::Settings;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::ScenarioError;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// File name of the checkpoint inside the output folder.
pub const CHECKPOINT: &str = "run.checkpoint";

/// What an algorithm's encoding stores of a state.
type State<A> = <<A as Algorithm>::Encoding as Encoding>::Observation;

/// A run: everything that the next update depends on.
pub struct OffPolicyRun<A: Algorithm> {
    settings: Settings,
    site: Site,
    encoding: A::Encoding,
    algorithm: A,
    replay: Replay<State<A>>,
    inference: Inference<A::Encoding>,
    flights: Vec<ActiveFlight<State<A>>>,
    next_mission: u64,
    rng: ChaCha8Rng,
    update: u64,
    steps: u64,
    averaged: Vec<f32>,
    validation: Validation,
}

/// A flight in progress. The checkpoint stores its actions, from which its state is computed again.
struct ActiveFlight<O> {
    mission: u64,
    actions: Vec<u8>,
    flight: Flight,
    guide: Option<Greedy>,
    n_step: NStep<O>,
}

impl<O: Clone> ActiveFlight<O> {
    /// The guide's action. Call it exactly once per slot: the guide stores its target.
    fn guide_action(&mut self) -> Option<Action> {
        self.guide.as_mut().map(|guide| guide.decide(&self.flight))
    }

    fn step(&mut self, action: Action) -> Reward {
        self.actions.push(action.index() as u8);
        self.flight.step(action)
    }

    /// Flies one slot and returns the transitions that it completes.
    fn transitions<E: Encoding<Observation = O>>(
        &mut self,
        encoding: &E,
        before: O,
        action: Action,
    ) -> Vec<Transition<O>> {
        let mask_before = self.flight.mask();
        let reward = self.step(action);
        let (after, mask_after) = (encoding.observe(&self.flight), self.flight.mask());
        let over = self.flight.is_over();
        self.n_step.push(Transition { before, mask_before, action, reward, after, mask_after, over })
    }
}

/// The checkpoint after the settings. The field order is the file format.
#[derive(Deserialize)]
#[serde(bound = "")]
struct Stored<A: Algorithm> {
    algorithm: A,
    replay: Replay<State<A>>,
    flights: Vec<(u64, Vec<u8>)>,
    next_mission: u64,
    rng_seed: [u8; 32],
    rng_word: u128,
    update: u64,
    steps: u64,
    averaged: Vec<f32>,
}

/// [`Stored`] by reference.
#[derive(Serialize)]
#[serde(bound = "")]
struct StoredRef<'a, A: Algorithm> {
    algorithm: &'a A,
    replay: &'a Replay<State<A>>,
    flights: Vec<(u64, &'a [u8])>,
    next_mission: u64,
    rng_seed: [u8; 32],
    rng_word: u128,
    update: u64,
    steps: u64,
    averaged: &'a [f32],
}

impl<A: Algorithm> OffPolicyRun<A> {
    /// Continues from the checkpoint in `folder`, or starts a new run if there is none.
    ///
    /// # Errors
    /// See [`TrainError`].
    pub fn open(settings: Settings, site: Site, folder: &Path) -> Result<OffPolicyRun<A>, TrainError> {
        match resume::load::<Stored<A>>(&folder.join(CHECKPOINT), A::NAME, &settings)? {
            Some(stored) => OffPolicyRun::restore(settings, site, stored),
            None => OffPolicyRun::start(settings, site),
        }
    }

    fn start(settings: Settings, site: Site) -> Result<OffPolicyRun<A>, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let algorithm = A::new(&settings, &mut rng);
        let mut run = OffPolicyRun::assemble(settings, site, algorithm, rng)?;
        for _ in 0..run.settings.steps_per_update {
            let flight = run.next_flight()?;
            run.flights.push(flight);
        }
        Ok(run)
    }

    fn restore(settings: Settings, site: Site, stored: Stored<A>) -> Result<OffPolicyRun<A>, TrainError> {
        let mut rng = ChaCha8Rng::from_seed(stored.rng_seed);
        rng.set_word_pos(stored.rng_word);
        let mut run = OffPolicyRun::assemble(settings, site, stored.algorithm, rng)?;
        run.replay = stored.replay;
        run.next_mission = stored.next_mission;
        run.update = stored.update;
        run.steps = stored.steps;
        run.averaged = stored.averaged;
        for (mission, actions) in stored.flights {
            let mut active = run.begin(mission)?;
            for action in actions {
                active.guide_action();
                let before = run.encoding.observe(&active.flight);
                let action = Action::from_index(usize::from(action)).unwrap_or(Action::Hover);
                // The memory has the completed transitions already.
                let _ = active.transitions(&run.encoding, before, action);
            }
            run.flights.push(active);
        }
        Ok(run)
    }

    fn assemble(
        settings: Settings,
        site: Site,
        algorithm: A,
        rng: ChaCha8Rng,
    ) -> Result<OffPolicyRun<A>, TrainError> {
        Ok(OffPolicyRun {
            validation: Validation::draw(&site, &settings)?,
            replay: Replay::new(settings.replay),
            encoding: A::Encoding::of(site.world().city()),
            averaged: algorithm.policy_parameters().to_vec(),
            inference: Inference::new(A::network()),
            settings,
            site,
            algorithm,
            flights: Vec::new(),
            next_mission: 0,
            rng,
            update: 0,
            steps: 0,
        })
    }

    fn begin(&self, number: u64) -> Result<ActiveFlight<State<A>>, ScenarioError> {
        let mission = self.settings.missions().mission(&self.site, number)?;
        let flight = Flight::new(self.site.world(), &mission.realization, mission.seed, mission.preference)?
            .with_table(self.site.table());
        let n_step = NStep::new(self.settings.n_step, self.settings.discount);
        Ok(ActiveFlight { mission: number, actions: Vec::new(), flight, guide: mission.guide, n_step })
    }

    fn next_flight(&mut self) -> Result<ActiveFlight<State<A>>, ScenarioError> {
        let mission = self.next_mission;
        self.next_mission += 1;
        self.begin(mission)
    }

    /// The averaged policy as it is now.
    fn snapshot(&self) -> Snapshot {
        Snapshot {
            system: A::NAME.to_owned(),
            method: method(A::NAME),
            settings: self.settings.clone(),
            actor: self.averaged.clone(),
            update: self.update,
            steps: self.steps,
            score: f64::NEG_INFINITY,
        }
    }

    /// One slot of every flight, with the algorithm's exploration or uniformly random actions.
    fn collect(&mut self, uniform: bool) -> Result<(), TrainError> {
        let states: Vec<_> =
            self.flights.iter().map(|active| self.encoding.observe(&active.flight)).collect();
        let scores = self.scores(&states);
        for (index, (before, scores)) in states.into_iter().zip(scores).enumerate() {
            let active = &mut self.flights[index];
            let mask = active.flight.mask();
            let policy = if uniform {
                Distribution::new(&[0.0; ACTIONS], mask)
            } else {
                A::explore(&self.settings, self.update, &scores, mask)
            };
            let explored = policy.sample(self.rng.random());
            let is_guided = !uniform && self.rng.random_bool(CONSTANTS.guided_slots);
            let action = active.guide_action().filter(|_| is_guided).unwrap_or(explored);
            for transition in active.transitions(&self.encoding, before, action) {
                self.replay.push(transition);
            }
            self.steps += 1;
            if active.flight.is_over() {
                self.flights[index] = self.next_flight()?;
            }
        }
        Ok(())
    }

    /// The policy's scores of the actions of every flight.
    fn scores(&mut self, states: &[State<A>]) -> Vec<[f32; ACTIONS]> {
        let preferences = self.flights.iter().map(|active| active.flight.preference());
        let inputs = states.iter().zip(preferences.clone());
        let outputs = self.inference.outputs(&self.encoding, self.algorithm.policy_parameters(), inputs);
        let outputs = outputs.chunks_exact(outputs.len() / states.len());
        outputs.zip(preferences).map(|(outputs, preference)| A::scores(outputs, preference)).collect()
    }
}

impl<A: Algorithm> Trainer for OffPolicyRun<A> {
    type Losses = A::Losses;
    const PACE: Pace = Pace::FAST;

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn update(&self) -> u64 {
        self.update
    }

    fn steps(&self) -> u64 {
        self.steps
    }

    /// Fills the memory first, then makes [`Settings::steps_per_update`] environment steps and one update.
    fn advance(&mut self) -> Result<A::Losses, TrainError> {
        while self.replay.len() < self.settings.warm_up.min(self.settings.replay) || self.replay.is_empty() {
            self.collect(true)?;
        }
        self.collect(false)?;
        let transitions = self.replay.sample(self.settings.batch, &mut self.rng);
        let preferences = relabelling(&self.settings, &mut self.rng);
        let losses =
            self.algorithm.update(&self.encoding, &self.settings, self.update, &transitions, &preferences);
        self.update += 1;
        // A plain mean at first, so that the initial parameters soon have no weight.
        let share = CONSTANTS.averaging.max(1.0 / self.update as f32);
        net::polyak(&mut self.averaged, self.algorithm.policy_parameters(), share);
        Ok(losses)
    }

    fn validate(&mut self, best: &mut Option<Snapshot>) -> Result<Tables, TrainError> {
        let mut policy = NetworkPolicy::<A>::new(&self.averaged);
        let tables = self.validation.tables(self.site.world(), &mut policy)?;
        Snapshot { score: tables.score(), ..self.snapshot() }.offer(best);
        Ok(tables)
    }

    fn save(&mut self, folder: &Path) -> Result<(), CheckpointError> {
        let stored = StoredRef::<A> {
            algorithm: &self.algorithm,
            replay: &self.replay,
            flights: self.flights.iter().map(|active| (active.mission, &active.actions[..])).collect(),
            next_mission: self.next_mission,
            rng_seed: self.rng.get_seed(),
            rng_word: self.rng.get_word_pos(),
            update: self.update,
            steps: self.steps,
            averaged: &self.averaged,
        };
        resume::save(&folder.join(CHECKPOINT), A::NAME, &self.settings, &stored)?;
        self.snapshot().save(&folder.join(LAST))
    }
}

/// Preferences to relabel a batch with: a share of pure ones, which a uniform draw never gives, and uniform ones. Flights
/// have the full share of pure preferences; half of it is enough here.
fn relabelling(settings: &Settings, rng: &mut ChaCha8Rng) -> Vec<Preference> {
    let share = settings.pure_preferences / 2.0;
    (0..settings.batch * settings.preferences)
        .map(|_| {
            let choice: f64 = rng.random();
            if choice < share / 2.0 {
                Preference::DATA
            } else if choice < share {
                Preference::ENERGY
            } else {
                random_preference(rng)
            }
        })
        .collect()
}

/// The command that trains a system, without its settings.
fn method(system: &str) -> String {
    match system {
        "gleaner" => "train".to_owned(),
        _ => format!("train --system {system}"),
    }
}
