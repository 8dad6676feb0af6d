//! Means with 95 % confidence intervals over missions.

use std::fmt;

/// Standard errors on each side of the mean (normal approximation).
const STANDARD_ERRORS: f64 = 1.96;

/// A mean and the half width of its 95 % confidence interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// Half of the interval's width.
    pub half: f64,
}

impl Interval {
    /// The mean of independent missions; zeros for none.
    #[must_use]
    pub fn of(values: &[f32]) -> Interval {
        let values: Vec<f64> = values.iter().map(|&value| f64::from(value)).collect();
        Interval { mean: mean(&values), half: STANDARD_ERRORS * standard_error(&values) }
    }

    /// The mean of `ours - theirs` over the same missions.
    #[must_use]
    pub fn of_difference(ours: &[f32], theirs: &[f32]) -> Interval {
        let differences: Vec<f32> = ours.iter().zip(theirs).map(|(a, b)| a - b).collect();
        Interval::of(&differences)
    }

    /// The ratio of two means over the same missions, in percent (delta method: the residuals `ours - ratio * theirs`
    /// give the standard error).
    #[must_use]
    pub fn of_share(ours: &[f32], theirs: &[f32]) -> Interval {
        let as_f64 = |values: &[f32]| values.iter().map(|&value| f64::from(value)).collect::<Vec<_>>();
        let (ours, theirs) = (as_f64(ours), as_f64(theirs));
        let whole = mean(&theirs);
        if whole <= 0.0 {
            return Interval::default();
        }
        let ratio = mean(&ours) / whole;
        let residuals: Vec<f64> = ours.iter().zip(&theirs).map(|(a, b)| a - ratio * b).collect();
        let half = STANDARD_ERRORS * standard_error(&residuals) / whole;
        Interval { mean: 100.0 * ratio, half: 100.0 * half }
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} ± {:.1}", self.mean, self.half)
    }
}

/// The mean; 0 for none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard error of the mean, from the sample variance.
fn standard_error(values: &[f64]) -> f64 {
    (sample_variance(values) / values.len().max(1) as f64).sqrt()
}

/// The sample variance; 0 for fewer than two values.
pub(crate) fn sample_variance(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    squares / (values.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interval_of_known_numbers() {
        let interval = Interval::of(&[1.0, 2.0, 3.0, 4.0]);
        // Sample variance 5/3, standard error sqrt(5/12).
        assert!((interval.mean - 2.5).abs() < 1e-9);
        assert!((interval.half - 1.96 * (5.0_f64 / 12.0).sqrt()).abs() < 1e-9);
        assert_eq!(Interval::of(&[7.0]), Interval { mean: 7.0, half: 0.0 });
        assert_eq!(Interval::of(&[]), Interval::default());
    }

    #[test]
    fn equal_shares_have_no_spread() {
        let share = Interval::of_share(&[9.0, 18.0, 27.0], &[10.0, 20.0, 30.0]);
        assert!((share.mean - 90.0).abs() < 1e-4 && share.half < 1e-4, "{share:?}");
        let difference = Interval::of_difference(&[3.0, 5.0], &[1.0, 3.0]);
        assert_eq!(difference, Interval { mean: 2.0, half: 0.0 });
        assert_eq!(Interval::of_share(&[1.0], &[0.0]), Interval::default());
    }
}
