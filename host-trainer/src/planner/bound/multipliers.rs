//! The multipliers of the relaxed constraints, and the subgradient step that improves them.

/// Initial battery multiplier, data units per battery unit. It also scales the battery's component of the subgradient.
const BATTERY_MULTIPLIER: f64 = 300.0;
/// Range of the battery multiplier. No battery unit collects as much data as the maximum.
const BATTERY_MULTIPLIER_RANGE: [f64; 2] = [1.0, 2_000.0];
/// Relative slack that keeps rounding errors from making a bound too low.
pub(super) const ROUNDING: f64 = 1e-9;

/// The multipliers of the relaxed constraints.
#[derive(Clone)]
pub(super) struct Multipliers {
    /// Of the battery constraint, data units per battery unit.
    pub battery: f64,
    /// Of each device's data constraint, as a share of the largest value at which hovering does not pay.
    pub data: Vec<f64>,
}

/// A subgradient of the bound, in the parameters of [`Multipliers`].
pub(super) struct Subgradient {
    pub battery: f64,
    pub data: Vec<f64>,
}

impl Multipliers {
    /// The start of the root node: hovering just does not pay.
    pub fn initial(devices: usize) -> Multipliers {
        Multipliers { battery: BATTERY_MULTIPLIER, data: vec![1.0; devices] }
    }

    /// Moves against the subgradient by the length that would close `gap` if the bound were linear.
    pub fn step(&mut self, slope: &Subgradient, gap: f64) {
        let scaled = BATTERY_MULTIPLIER * slope.battery;
        let norm2 = scaled.powi(2) + slope.data.iter().map(|slope| slope * slope).sum::<f64>();
        let step = gap / norm2.max(ROUNDING);
        let [low, high] = BATTERY_MULTIPLIER_RANGE;
        self.battery = (self.battery - step * scaled * BATTERY_MULTIPLIER).clamp(low, high);
        for (share, slope) in self.data.iter_mut().zip(&slope.data) {
            *share = (*share - step * slope).clamp(0.0, 1.0);
        }
    }
}
