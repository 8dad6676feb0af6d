//! Named sets of settings.

use super::Settings;
use clap::ArgMatches;
use clap::parser::ValueSource;
use std::fmt;
use std::str::FromStr;

/// A named set of settings. A flag on the command line overrides its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// The paper's training (section V-A).
    Paper,
}

/// Environment steps of the paper's training.
const PAPER_STEPS: u64 = 1_500_000;
/// Environment steps between two evaluations of the paper's learning curves.
const PAPER_EVALUATION_STEPS: u64 = 20_000;

impl Preset {
    /// All presets.
    pub const ALL: [Preset; 1] = [Preset::Paper];

    /// The settings of the preset, with the values that `given` names explicitly in `settings`.
    #[must_use]
    pub fn apply(self, settings: &Settings, given: &ArgMatches) -> Settings {
        let is_given = |name: &str| matches!(given.value_source(name), Some(ValueSource::CommandLine));
        let mut result = settings.clone();
        let Preset::Paper = self;
        // One update per four environment steps: four times faster than the paper's one per step.
        macro_rules! set {
            ($($name:ident = $value:expr;)*) => {
                $(if !is_given(stringify!($name)) { result.$name = $value; })*
            };
        }
        set! {
            learning_rate = 3e-4;
            learning_rate_end = 3e-4;
            batch = 32;
            preferences = 3;
            replay = 100_000;
            discount = 0.99;
            entropy_start = 0.6;
            entropy_end = 0.3;
            heat_start = 5.0;
            heat_end = 1.5;
            anneal = 100_000;
            heat_in_policy = true;
            pure_preferences = 0.0;
            shaping = 0.0;
            share_greedy = 0.0;
            share_varied = 0.0;
            validate_on_evaluation = true;
            steps_per_update = 4;
        }
        let updates = PAPER_STEPS / (result.steps_per_update.max(1) as u64);
        set! {
            updates = updates;
        }
        result
    }

    /// Updates between two validations, `PAPER_EVALUATION_STEPS` apart.
    #[must_use]
    pub fn validate_every(self, settings: &Settings) -> u64 {
        (PAPER_EVALUATION_STEPS / (settings.steps_per_update.max(1) as u64)).max(1)
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Preset::Paper => f.write_str("paper"),
        }
    }
}

impl FromStr for Preset {
    type Err = String;

    fn from_str(name: &str) -> Result<Preset, String> {
        Preset::ALL
            .into_iter()
            .find(|preset| preset.to_string() == name)
            .ok_or_else(|| "unknown preset: use paper".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Args as _, FromArgMatches as _};

    fn applied(words: &[&str]) -> Settings {
        let command = Settings::augment_args(clap::Command::new("settings"));
        let given = command.get_matches_from([&["settings"], words].concat());
        Preset::Paper.apply(&Settings::from_arg_matches(&given).unwrap(), &given)
    }

    #[test]
    fn paper_preset_has_the_papers_settings() {
        let paper = applied(&[]);
        assert_eq!((paper.learning_rate, paper.learning_rate_end, paper.discount), (3e-4, 3e-4, 0.99));
        assert_eq!((paper.batch, paper.replay, paper.preferences), (32, 100_000, 3));
        assert_eq!((paper.entropy_start, paper.entropy_end), (0.6, 0.3));
        assert_eq!((paper.heat_start, paper.heat_end, paper.anneal), (5.0, 1.5, 100_000));
        assert_eq!(paper.updates * paper.steps_per_update as u64, 1_500_000);
        assert!(paper.heat_in_policy && paper.validate_on_evaluation);
        assert_eq!((paper.pure_preferences, paper.n_step), (0.0, 1));
        assert_eq!(Preset::Paper.validate_every(&paper), 5_000);
    }

    #[test]
    fn explicit_flags_override_the_preset() {
        let settings = applied(&["--steps-per-update", "1", "--batch", "64", "--pure-preferences", "0.2"]);
        assert_eq!((settings.updates, settings.batch, settings.pure_preferences), (1_500_000, 64, 0.2));
        assert_eq!(Preset::Paper.validate_every(&settings), 20_000);
        let short = applied(&["--updates", "10", "--heat-in-policy", "false"]);
        assert_eq!((short.updates, short.heat_in_policy), (10, false));
    }
}
