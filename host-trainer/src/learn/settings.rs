//! Everything that shapes a training run, with its unit and default. Stored in every checkpoint.

use crate::env::greedy::Greedy;
use gleaner_policy::Preference;
use gleaner_units::{BatteryUnits, Cell};
use gleaner_world::{Realization, Scenario, ScenarioError, ScenarioKind, Seed, Stream, World};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Hyper-parameters and the distribution of missions. The defaults are the paper's where it gives a number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, clap::Args)]
#[serde(default)]
pub struct Settings {
    /// Names every random draw of the run.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Updates until the run is done.
    #[arg(long, default_value_t = 150_000)]
    pub updates: u64,
    /// Slots flown per update, each in a flight of its own. The paper flies one.
    #[arg(long, default_value_t = 4)]
    pub steps_per_update: usize,
    /// Slots flown at random before the first update.
    #[arg(long, default_value_t = 5_000)]
    pub warm_up: usize,
    /// Transitions in one batch (paper: 32).
    #[arg(long, default_value_t = 32)]
    pub batch: usize,
    /// Preferences per transition and update (paper, J = 3).
    #[arg(long, default_value_t = 3)]
    pub preferences: usize,
    /// Transitions kept (paper: 100,000).
    #[arg(long, default_value_t = 100_000)]
    pub replay: usize,
    /// Adam's step size at the start (paper: 3e-4).
    #[arg(long, default_value_t = 3e-4)]
    pub learning_rate: f32,
    /// Adam's step size at the end; it falls linearly over the second half of the run. The paper keeps it.
    #[arg(long, default_value_t = 3e-4)]
    pub learning_rate_end: f32,
    /// Discount per slot (paper: 0.99).
    #[arg(long, default_value_t = 0.99)]
    pub discount: f32,
    /// Share of the critics that the targets take over per update.
    #[arg(long, default_value_t = 0.005)]
    pub polyak: f32,
    /// Target entropy at the start, as a share of the logarithm of the number of allowed actions (paper: 0.6).
    #[arg(long, default_value_t = 0.6)]
    pub entropy_start: f32,
    /// Target entropy at the end (paper: 0.3).
    #[arg(long, default_value_t = 0.3)]
    pub entropy_end: f32,
    /// Temperature of the exploring softmax at the start (paper: 5).
    #[arg(long, default_value_t = 5.0)]
    pub heat_start: f32,
    /// Temperature of the exploring softmax at the end (paper: 1.5).
    #[arg(long, default_value_t = 1.5)]
    pub heat_end: f32,
    /// Environment steps after the warm-up over which target entropy and heat move from start to end (paper: 100,000
    /// steps). An update flies `steps_per_update` of them.
    #[arg(long, default_value_t = 100_000)]
    pub anneal: u64,
    /// Initial entropy coefficient nu, in scaled rewards. Adam moves ln nu by at most the learning rate an update, so
    /// a start at 0.05 needs 25,000 updates to come down to where it settles.
    #[arg(long, default_value_t = 0.005)]
    pub entropy_weight: f32,
    /// Use the heated softmax (paper, eq. 20) as the policy everywhere: in exploration, targets, actor loss and
    /// entropy. Without it the heat is applied in exploration only.
    #[arg(long, default_value_t = false, default_missing_value = "true", num_args = 0..=1)]
    pub heat_in_policy: bool,
    /// Validate on the 100 evaluation realizations, as the paper's learning curves do. Only the final parameters of
    /// such a run are a fair result: the best by validation were chosen on the realizations that judge them.
    #[arg(long, default_value_t = false, default_missing_value = "true", num_args = 0..=1)]
    pub validate_on_evaluation: bool,
    /// The networks see rewards times this, so that values lie within a few units of zero.
    #[arg(long, default_value_t = 0.05)]
    pub reward_scale: f32,
    /// Share of the way to the terminal that counts as potential of the energy objective. Shaping by a potential
    /// changes no optimal policy (Ng, Harada and Russell 1999), but a critic that need not learn the way home first
    /// learns faster. The paper has none.
    #[arg(long, default_value_t = 0.0)]
    pub shaping: f32,
    /// Share of flights under a pure preference, (1, 0) or (0, 1); the rest is uniform.
    #[arg(long, default_value_t = 0.2)]
    pub pure_preferences: f64,
    /// Share of missions that GREEDY flies, with a random number of visits; in one slot of ten the policy explores
    /// from where GREEDY has led. Shows the learner full devices early. The paper has none.
    #[arg(long, default_value_t = 0.0)]
    pub share_greedy: f64,
    /// Share of missions with the default zones of RD.
    #[arg(long, default_value_t = 1.0)]
    pub share_rd: f64,
    /// Share of missions with the default zone of RB. What RD and RB leave starts and ends anywhere.
    #[arg(long, default_value_t = 0.0)]
    pub share_rb: f64,
    /// Share of missions with another number of devices (1 to 12) and another battery (50 to 120) than K = 6 and
    /// B = 80. The paper trains with none.
    #[arg(long, default_value_t = 0.0)]
    pub share_varied: f64,
    /// Refinement: share of missions over generated cities, under a channel that is a little off, with reports
    /// missing. What the default city teaches must not be all that the policy knows.
    #[arg(long, default_value_t = 0.0)]
    pub share_cities: f64,
}

impl Default for Settings {
    /// What the command line means by no words at all.
    fn default() -> Settings {
        use clap::{Args as _, FromArgMatches as _};
        let nothing = Settings::augment_args(clap::Command::new("settings")).get_matches_from(["settings"]);
        Settings::from_arg_matches(&nothing).expect("every setting has a default")
    }
}

/// Settings inside a binary file, as JSON: a file that was written before a setting existed can still be read.
pub mod as_json {
    use super::Settings;
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser};

    /// As a string.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(settings: &Settings, serializer: S) -> Result<S::Ok, S::Error> {
        serde_json::to_string(settings).map_err(ser::Error::custom)?.serialize(serializer)
    }

    /// From a string; what it does not name has its default.
    ///
    /// # Errors
    /// Not JSON, or a setting of another type.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Settings, D::Error> {
        serde_json::from_str(&String::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl Settings {
    /// The mission with this number: every draw comes from the run's seed and the number.
    ///
    /// # Errors
    /// The city has no room for it.
    pub fn mission(&self, world: &World, number: u64) -> Result<Mission, ScenarioError> {
        // Runs with other seeds never share a mission in the first 2^32.
        let seed = Seed::training((self.seed << 32).wrapping_add(number));
        let mut rng = seed.rng(Stream::Choices);
        let mut scenario = self.zones(world, &mut rng).in_city(world.city());
        if rng.random_bool(self.share_varied) {
            let battery = BatteryUnits(rng.random_range(50..=120) as f32);
            scenario = scenario.with_devices(rng.random_range(1..=12)).with_battery(battery);
        }
        let preference = if rng.random_bool(self.pure_preferences) {
            if rng.random_bool(0.5) { Preference::DATA } else { Preference::ENERGY }
        } else {
            random_preference(&mut rng)
        };
        let guide = rng
            .random_bool(self.share_greedy)
            .then(|| Greedy::new(rng.random_range(1..=scenario.device_count)));
        Ok(Mission {
            seed,
            realization: Realization::draw(world.city(), &scenario, seed)?,
            preference,
            guide,
        })
    }

    fn zones(&self, world: &World, rng: &mut ChaCha8Rng) -> Scenario {
        let choice: f64 = rng.random();
        if choice < self.share_rd {
            return ScenarioKind::ReachDestination.scenario();
        }
        let base = ScenarioKind::ReturnBase.scenario();
        if choice < self.share_rd + self.share_rb {
            return base;
        }
        let open = world.city().open_cells();
        let mut cell = || -> Cell { open[rng.random_range(0..open.len())] };
        // The farthest corners are 68 moves apart and the smallest battery is 50, so draw until it is near enough.
        loop {
            let scenario = Scenario { start: cell(), terminal: cell(), ..base };
            if scenario.shortest_moves() <= 45 {
                return scenario;
            }
        }
    }

    /// The command that learns the same again: every setting that is not at its default.
    #[must_use]
    pub fn command_line(&self, method: &str, out: &str) -> String {
        use clap::Args as _;
        let mut command = format!("gleaner-train {method} --out {out}");
        let all = serde_json::to_value(self).unwrap_or_default();
        let described = Settings::augment_args(clap::Command::new("settings"));
        for argument in described.get_arguments() {
            let (Some(flag), Some(value)) = (argument.get_long(), all.get(argument.get_id().as_str())) else {
                continue;
            };
            // Settings are f32 and f64: the shortest text that reads back the same is what was typed.
            let value =
                value.as_f64().map_or_else(|| value.to_string(), |number| format!("{}", number as f32));
            let default = argument.get_default_values().first().and_then(|value| value.to_str());
            let default = default.unwrap_or("");
            let is_default = match (default.parse::<f32>(), value.parse::<f32>()) {
                (Ok(default), Ok(value)) => default == value,
                _ => default == value,
            };
            if !is_default {
                command += &format!(" --{flag} {value}");
            }
        }
        command
    }

    /// Target entropy at this update, as a share of the largest possible.
    #[must_use]
    pub fn entropy_target_at(&self, update: u64) -> f32 {
        mix(self.entropy_start, self.entropy_end, self.annealed(update))
    }

    /// Temperature of the exploring softmax at this update.
    #[must_use]
    pub fn heat_at(&self, update: u64) -> f32 {
        mix(self.heat_start, self.heat_end, self.annealed(update))
    }

    /// How far along the annealing is, 0 to 1.
    #[must_use]
    pub fn annealed(&self, update: u64) -> f32 {
        let steps = update as f64 * self.steps_per_update as f64;
        (steps / self.anneal.max(1) as f64).min(1.0) as f32
    }

    /// Adam's step size at this update.
    #[must_use]
    pub fn learning_rate_at(&self, update: u64) -> f32 {
        let progress = update as f64 / self.updates.max(1) as f64;
        let falling = ((progress - 0.5) * 2.0).clamp(0.0, 1.0) as f32;
        self.learning_rate + (self.learning_rate_end - self.learning_rate) * falling
    }
}

/// The line from start to end.
pub(crate) fn mix(start: f32, end: f32, progress: f32) -> f32 {
    start + (end - start) * progress
}

/// Uniform over the preferences.
pub fn random_preference(rng: &mut ChaCha8Rng) -> Preference {
    Preference::new(rng.random::<f32>()).unwrap_or(Preference::DATA)
}

/// A mission to learn from.
#[derive(Clone, Debug)]
pub struct Mission {
    /// Names its draws.
    pub seed: Seed,
    /// The devices.
    pub realization: Realization,
    /// What it is flown for.
    pub preference: Preference,
    /// Who flies it, if not the policy.
    pub guide: Option<Greedy>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn annealing_counts_environment_steps() {
        let settings = Settings { steps_per_update: 4, anneal: 100_000, ..Settings::default() };
        assert_eq!(settings.annealed(0), 0.0);
        assert_eq!(settings.annealed(12_500), 0.5);
        assert_eq!(settings.annealed(25_000), 1.0);
        assert_eq!(settings.heat_at(25_000), settings.heat_end);
    }

    #[test]
    fn command_line_names_switches_that_are_on() {
        let settings = Settings { heat_in_policy: true, ..Settings::default() };
        assert_eq!(
            settings.command_line("train", "runs/x"),
            "gleaner-train train --out runs/x --heat-in-policy true"
        );
    }
}
