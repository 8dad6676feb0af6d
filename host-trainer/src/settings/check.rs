//! Which settings a run can use.

use super::Settings;
use thiserror::Error;

/// Settings that no run can use.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SettingsError {
    /// A count that must not be zero.
    #[error("--{0} 0: give at least 1")]
    Zero(&'static str),
    /// RD and RB are more than all missions.
    #[error("--share-rd {rd} and --share-rb {rb} add up to more than 1: lower one of them")]
    Shares {
        /// Share of RD.
        rd: f64,
        /// Share of RB.
        rb: f64,
    },
    /// Nothing that a validation could fly.
    #[error(
        "--share-rd 0 and --share-rb 0: validation needs at least one of the two scenarios; give one a share"
    )]
    NoScenario,
    /// A number outside its range.
    #[error("--{flag} {value}: {range}")]
    Range {
        /// The flag.
        flag: &'static str,
        /// What it was set to.
        value: f32,
        /// What it may be.
        range: &'static str,
    },
}

impl Settings {
    /// Checks what the command line alone cannot: counts, sums and ranges.
    ///
    /// # Errors
    /// The first setting that no run can use.
    pub fn check(&self) -> Result<(), SettingsError> {
        let counts = [
            ("batch", self.batch),
            ("preferences", self.preferences),
            ("steps-per-update", self.steps_per_update),
            ("replay", self.replay),
            ("n-step", self.n_step),
        ];
        if let Some((flag, _)) = counts.into_iter().find(|(_, count)| *count == 0) {
            return Err(SettingsError::Zero(flag));
        }
        let (rd, rb) = (self.share_rd, self.share_rb);
        // Shares such as 0.7 and 0.3 may add up to a little more than 1 in binary.
        if rd + rb > 1.0 + 1e-9 {
            return Err(SettingsError::Shares { rd, rb });
        }
        if rd + rb <= 0.0 {
            return Err(SettingsError::NoScenario);
        }
        let positive = "a number above 0";
        let unit = "a number between 0 and 1";
        let is_share = |value: f32| (0.0..=1.0).contains(&value);
        let is_positive = |value: f32| value.is_finite() && value > 0.0;
        let ranges = [
            ("learning-rate", self.learning_rate, is_positive(self.learning_rate), positive),
            ("learning-rate-end", self.learning_rate_end, self.learning_rate_end >= 0.0, "at least 0"),
            ("discount", self.discount, is_share(self.discount), unit),
            ("polyak", self.polyak, is_share(self.polyak), unit),
            ("heat-start", self.heat_start, is_positive(self.heat_start), positive),
            ("heat-end", self.heat_end, is_positive(self.heat_end), positive),
            ("entropy-start", self.entropy_start, is_share(self.entropy_start), unit),
            ("entropy-end", self.entropy_end, is_share(self.entropy_end), unit),
            ("entropy-weight", self.entropy_weight, is_positive(self.entropy_weight), positive),
            ("reward-scale", self.reward_scale, is_positive(self.reward_scale), positive),
        ];
        match ranges.into_iter().find(|(_, _, is_allowed, _)| !is_allowed) {
            Some((flag, value, _, range)) => Err(SettingsError::Range { flag, value, range }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::share;

    #[test]
    fn unusable_settings_are_refused() {
        let check = |change: &dyn Fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings.check().map_err(|error| error.to_string())
        };
        assert_eq!(check(&|_| ()), Ok(()));
        assert_eq!(check(&|s| (s.share_rd, s.share_rb) = (0.7, 0.3)), Ok(()));
        for (change, named) in [
            (
                &(|s: &mut Settings| s.share_rb = 0.3) as &dyn Fn(&mut Settings),
                "--share-rd 1 and --share-rb 0.3",
            ),
            (&|s| s.share_rd = 0.0, "--share-rd 0 and --share-rb 0"),
            (&|s| s.batch = 0, "--batch 0"),
            (&|s| s.n_step = 0, "--n-step 0"),
            (&|s| s.discount = 1.5, "--discount 1.5"),
            (&|s| s.heat_end = 0.0, "--heat-end 0"),
            (&|s| s.learning_rate = f32::NAN, "--learning-rate NaN"),
        ] {
            let error = check(change).unwrap_err();
            assert!(error.starts_with(named), "{error}");
        }
        for word in ["1.5", "-0.1", "NaN", "half"] {
            assert!(share(word).is_err(), "{word}");
        }
    }
}
