//! Settings of a training run: hyper-parameters and the distribution of missions. Stored in every checkpoint.

mod check;
mod preset;
mod v1;

pub use check::SettingsError;
pub use preset::Preset;
pub(crate) use v1::SettingsV1;

use crate::env::mission::{MissionShares, MissionSource};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Hyper-parameters and the distribution of missions. A default is the paper's where the paper gives a number.
///
/// `train` uses all of them. `distil` uses the missions, `batch` x `preferences` as its batch, `replay` and the
/// learning rates; `refine` uses the missions and the learning rates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, clap::Args)]
#[serde(default)]
pub struct Settings {
    /// Seed of all random draws of the run.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Updates until the run is done.
    #[arg(long, default_value_t = 150_000)]
    pub updates: u64,
    /// Environment steps per update, each in a flight of its own. The paper flies one.
    #[arg(long, default_value_t = 4)]
    pub steps_per_update: usize,
    /// Environment steps with random actions before the first update.
    #[arg(long, default_value_t = 5_000)]
    pub warm_up: usize,
    /// Transitions in one batch (paper: 32).
    #[arg(long, default_value_t = 32)]
    pub batch: usize,
    /// Preferences per transition and update (paper: J = 3).
    #[arg(long, default_value_t = 3)]
    pub preferences: usize,
    /// Capacity of the replay memory, transitions (paper: 100,000).
    #[arg(long, default_value_t = 100_000)]
    pub replay: usize,
    /// Adam's step size at the start (paper: 3e-4).
    #[arg(long, default_value_t = 3e-4)]
    pub learning_rate: f32,
    /// Adam's step size at the end, reached linearly over the second half of the run. The paper keeps it constant.
    #[arg(long, default_value_t = 3e-4)]
    pub learning_rate_end: f32,
    /// Discount per slot, gamma (paper: 0.99).
    #[arg(long, visible_alias = "gamma", default_value_t = 0.99)]
    #[serde(alias = "gamma")]
    pub discount: f32,
    /// Step size of the Polyak average that the target critics follow, per update.
    #[arg(long, default_value_t = 0.005)]
    pub polyak: f32,
    /// Target entropy at the start, as a share of the entropy of the uniform policy (paper: 0.6).
    #[arg(long, default_value_t = 0.6)]
    pub entropy_start: f32,
    /// Target entropy at the end (paper: 0.3).
    #[arg(long, default_value_t = 0.3)]
    pub entropy_end: f32,
    /// Temperature tau of the softmax at the start (paper: 5).
    #[arg(long, default_value_t = 5.0)]
    pub heat_start: f32,
    /// Temperature tau of the softmax at the end (paper: 1.5).
    #[arg(long, default_value_t = 1.5)]
    pub heat_end: f32,
    /// Environment steps after the warm-up over which target entropy and tau move from start to end (paper: 100,000).
    #[arg(long, default_value_t = 100_000)]
    pub anneal: u64,
    /// Initial entropy coefficient nu, in scaled rewards. Adam moves ln nu by at most the learning rate per update, so
    /// a start at 0.05 needs 25,000 updates to reach the value where nu settles.
    #[arg(long, visible_alias = "entropy-coefficient", default_value_t = 0.005)]
    #[serde(alias = "entropy_coefficient")]
    pub entropy_weight: f32,
    /// Use the heated softmax (paper, eq. 20) as the policy everywhere: in exploration, targets, actor loss and
    /// entropy. Without it the temperature applies to exploration only.
    #[arg(long, default_value_t = false, default_missing_value = "true", num_args = 0..=1)]
    pub heat_in_policy: bool,
    /// Validate on the 100 evaluation realizations, as the paper's learning curves do. Of such a run only the final
    /// parameters are a fair result, since the best ones were chosen on the evaluation realizations.
    #[arg(long, default_value_t = false, default_missing_value = "true", num_args = 0..=1)]
    pub validate_on_evaluation: bool,
    /// Factor on the rewards that the networks learn from, so that state values lie within a few units of zero.
    #[arg(long, default_value_t = 0.05)]
    pub reward_scale: f32,
    /// Weight of the distance to the terminal as a potential in the energy objective. Potential-based shaping keeps the
    /// optimal policy (Ng, Harada and Russell 1999) and spares the critic learning the way home. The paper has none.
    #[arg(long, default_value_t = 0.0)]
    pub shaping: f32,
    /// Share of flights, and of relabelled transitions, under a pure preference, (1, 0) or (0, 1). The other
    /// preferences are uniform. With 0 all are uniform, as in the paper.
    #[arg(long, value_parser = share, default_value_t = 0.2)]
    pub pure_preferences: f64,
    /// Share of missions that GREEDY flies, with a random number of visits; the policy explores in one slot of ten.
    /// Full devices are then seen early. The paper has none.
    #[arg(long, value_parser = share, default_value_t = 0.0)]
    pub share_greedy: f64,
    /// Share of missions with the zones of RD.
    #[arg(long, value_parser = share, default_value_t = 1.0)]
    pub share_rd: f64,
    /// Share of missions with the zone of RB. The missions that RD and RB leave start and end anywhere.
    #[arg(long, value_parser = share, default_value_t = 0.0)]
    pub share_rb: f64,
    /// Share of missions with another number of devices (1 to 12) and another battery (50 to 120 units) than K = 6 and
    /// B = 80. The paper trains with none.
    #[arg(long, value_parser = share, default_value_t = 0.0)]
    pub share_varied: f64,
    /// refine: share of missions over generated cities, with the noise off by up to 2 dB and a tenth of the reports
    /// missing, so that the policy does not depend on the default city.
    #[arg(long, value_parser = share, default_value_t = 0.0)]
    pub share_cities: f64,
    /// refine: share of the other missions in a world that differs from what the aircraft assumes: noise off by up to 6 dB
    /// or path-loss exponents by up to 0.3, half of them with a wrong map or without one.
    #[arg(long, value_parser = share, default_value_t = 0.0)]
    pub share_mismatched: f64,
    /// How the twin critics are combined: `per-objective` takes the lower value of each objective, which may mix the
    /// two critics; `scalarised` takes both objectives from the critic with the lower w . Q, which is the value that
    /// the policy maximises.
    #[arg(long, default_value_t = TwinMinimum::PerObjective)]
    pub twin_minimum: TwinMinimum,
    /// Slots of reward in a target before the bootstrapped value (n-step return; paper: 1). Longer returns carry data
    /// from the end of a detour back faster, with a bias towards older policies.
    #[arg(long, default_value_t = 1)]
    pub n_step: usize,
    /// Fingerprint of the city that the run trains in; the default city when absent.
    #[arg(skip)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub site: Option<String>,
}

/// How two critics become one value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TwinMinimum {
    /// The lower value of each objective.
    #[default]
    PerObjective,
    /// Both objectives of the critic with the lower scalarised value.
    Scalarised,
}

impl fmt::Display for TwinMinimum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            TwinMinimum::PerObjective => "per-objective",
            TwinMinimum::Scalarised => "scalarised",
        })
    }
}

impl FromStr for TwinMinimum {
    type Err = String;

    fn from_str(name: &str) -> Result<TwinMinimum, String> {
        [TwinMinimum::PerObjective, TwinMinimum::Scalarised]
            .into_iter()
            .find(|rule| rule.to_string() == name)
            .ok_or_else(|| "use per-objective or scalarised".to_owned())
    }
}

/// A share on the command line.
fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err("a share lies between 0 and 1".to_owned()) }
}

impl Default for Settings {
    /// Defaults for an empty command line.
    fn default() -> Settings {
        use clap::{Args as _, FromArgMatches as _};
        let empty = Settings::augment_args(clap::Command::new("settings")).get_matches_from(["settings"]);
        Settings::from_arg_matches(&empty).expect("every setting has a default")
    }
}

/// Settings inside a binary file, as JSON, so that a file written before a setting existed can still be read.
pub mod as_json {
    use super::Settings;
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser};
    use std::borrow::Borrow;

    /// Writes a string.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(
        settings: &impl Borrow<Settings>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serde_json::to_string(settings.borrow()).map_err(ser::Error::custom)?.serialize(serializer)
    }

    /// Reads a string. A setting that it does not name has its default.
    ///
    /// # Errors
    /// Not JSON, or a setting of another type.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Settings, D::Error> {
        serde_json::from_str(&String::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl Settings {
    /// The first setting in which two runs differ, as `name: ours, theirs`.
    #[must_use]
    pub fn difference(&self, other: &Settings) -> Option<String> {
        let [ours, theirs] = [self, other].map(|settings| serde_json::to_value(settings).unwrap_or_default());
        let names = ours.as_object()?.keys().chain(theirs.as_object()?.keys());
        let differs = names.into_iter().find(|name| ours.get(name) != theirs.get(name))?;
        let value = |settings: &serde_json::Value| {
            settings.get(differs).map_or_else(
                || "default".to_owned(),
                |value| match value.as_f64() {
                    Some(number) if value.is_f64() => (number as f32).to_string(),
                    _ => value.to_string(),
                },
            )
        };
        Some(format!("{differs}: {} there, {} here", value(&ours), value(&theirs)))
    }

    /// Where the run's missions come from.
    #[must_use]
    pub const fn missions(&self) -> MissionSource {
        MissionSource {
            seed: self.seed,
            shares: MissionShares {
                rd: self.share_rd,
                rb: self.share_rb,
                varied: self.share_varied,
                greedy: self.share_greedy,
                pure_preferences: self.pure_preferences,
            },
        }
    }

    /// The command that trains the same again: `method` with every setting that is not at its default.
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
            let value = match (value.as_str(), value.as_f64()) {
                (Some(name), _) => name.to_owned(),
                // The shortest text that reads back as the same f32 is what was typed.
                (_, Some(number)) if value.is_f64() => format!("{}", number as f32),
                _ => value.to_string(),
            };
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

    /// Target entropy at this update, as a share of the entropy of the uniform policy.
    #[must_use]
    pub fn entropy_target_at(&self, update: u64) -> f32 {
        interpolate(self.entropy_start, self.entropy_end, self.annealed(update))
    }

    /// Temperature tau of the softmax at this update.
    #[must_use]
    pub fn heat_at(&self, update: u64) -> f32 {
        interpolate(self.heat_start, self.heat_end, self.annealed(update))
    }

    /// Progress of the annealing, 0 to 1. It counts environment steps, as the paper does.
    #[must_use]
    pub fn annealed(&self, update: u64) -> f32 {
        let steps = update as f64 * self.steps_per_update as f64;
        (steps / self.anneal.max(1) as f64).min(1.0) as f32
    }

    /// Adam's step size at this update.
    #[must_use]
    pub fn learning_rate_at(&self, update: u64) -> f32 {
        let progress = update as f64 / self.updates.max(1) as f64;
        let decay = ((progress - 0.5) * 2.0).clamp(0.0, 1.0) as f32;
        interpolate(self.learning_rate, self.learning_rate_end, decay)
    }
}

/// Linear interpolation from `start` at 0 to `end` at 1.
pub(crate) fn interpolate(start: f32, end: f32, progress: f32) -> f32 {
    start + (end - start) * progress
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
    fn command_line_names_what_differs_from_the_defaults() {
        let settings = Settings {
            heat_in_policy: true,
            twin_minimum: TwinMinimum::Scalarised,
            n_step: 5,
            seed: 16_777_217,
            ..Settings::default()
        };
        assert_eq!(
            settings.command_line("train", "runs/x"),
            "gleaner-train train --out runs/x --seed 16777217 --heat-in-policy true --twin-minimum scalarised \
             --n-step 5"
        );
    }

    #[test]
    fn json_of_an_older_version_is_read_with_defaults() {
        let old: Settings = serde_json::from_str(r#"{"seed":3,"discount":0.9}"#).unwrap();
        assert_eq!((old.seed, old.discount, old.n_step), (3, 0.9, 1));
        let renamed: Settings = serde_json::from_str(r#"{"gamma":0.5,"entropy_coefficient":0.1}"#).unwrap();
        assert_eq!((renamed.discount, renamed.entropy_weight), (0.5, 0.1));
    }
}
