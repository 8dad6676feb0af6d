//! Least squares of two prices: of a cell, and of a nominal unit of hovering.

/// Weight of the prior, in nominal units.
const PRIOR: f32 = 1.0;
/// Share of cells below which a window counts as hovering only.
const HOVERING: f32 = 0.1;
/// What a headwind adds to the price of a cell, per what it adds to that of a nominal unit of hovering.
const CELL_TO_HOVER: f32 = 2.0;
/// Bounds of a price: beyond them the monitor is at fault, not the wind.
const CHEAPEST: f32 = 0.3;
const DEAREST: f32 = 3.0;
/// Less is flown between two steps only when the charge falls by itself.
const LEAST_UNITS: f32 = 0.05;

/// Nominal units flown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Flown {
    pub(crate) cells: f32,
    pub(crate) hover: f32,
}

impl Flown {
    pub(crate) fn units(self) -> f32 {
        self.cells + self.hover
    }
}

/// Sums over the equations `used = cell x cells + hover x hover`, older ones with less weight.
///
/// Each equation has the weight `1 / units flown`, so that the mean price is the sum of what was used by the sum of what was
/// flown. With equal weights a step of the percentage that spans many cheap units would prevail over one of few dear units; with
/// the mean price of each step, one in which the aircraft brakes and hardly advances would.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prices {
    /// Normal equations: cells x cells, cells x hover, hover x hover, cells x used, hover x used.
    sums: [f32; 5],
}

impl Prices {
    pub(crate) const fn new() -> Prices {
        Prices { sums: [0.0; 5] }
    }

    /// Takes in one equation. `decay`: what is left of the weight of the older ones.
    pub(crate) fn learn(&mut self, flown: Flown, used: f32, decay: f32) {
        let units = flown.units();
        if units.is_nan() || units < LEAST_UNITS {
            return;
        }
        let Flown { cells, hover } = flown;
        let terms = [cells * cells, cells * hover, hover * hover, cells * used, hover * used];
        for (sum, term) in self.sums.iter_mut().zip(terms) {
            *sum = *sum * decay + term / units;
        }
    }

    /// Prices of a cell and of a nominal unit of hovering.
    pub(crate) fn solve(&self) -> (f32, f32) {
        let [cc, ch, hh, cu, hu] = self.sums;
        let (cc, hh) = (cc + PRIOR, hh + PRIOR);
        let (cu, hu) = (cu + PRIOR * self.unflown_cell(), hu + PRIOR);
        let determinant = cc * hh - ch * ch;
        let solved = ((cu * hh - hu * ch) / determinant, (hu * cc - cu * ch) / determinant);
        let sound = |price: f32| if price.is_finite() { price.clamp(CHEAPEST, DEAREST) } else { 1.0 };
        (sound(solved.0), sound(solved.1))
    }

    /// The price of a cell as far as the equations do not say: nominal. Where nearly only hovering was flown, and that is
    /// dearer than nominal, a cell is dearer too.
    fn unflown_cell(&self) -> f32 {
        let flown = self.flown();
        let is_hovering = flown.cells < HOVERING * flown.units();
        if is_hovering { 1.0 + CELL_TO_HOVER * (self.mean() - 1.0).max(0.0) } else { 1.0 }
    }

    /// The mean price of `flown`.
    pub(crate) fn mean_of(&self, flown: Flown) -> f32 {
        let (cell, hover) = self.solve();
        (cell * flown.cells + hover * flown.hover) / flown.units()
    }

    /// Cells and hovering in the equations, in nominal units.
    pub(crate) fn flown(&self) -> Flown {
        let [cc, ch, hh, ..] = self.sums;
        Flown { cells: cc + ch, hover: hh + ch }
    }

    /// The mean price in the equations; 1 before there is one.
    pub(crate) fn mean(&self) -> f32 {
        let ([.., cu, hu], units) = (self.sums, self.flown().units());
        if units > 0.0 { (cu + hu) / units } else { 1.0 }
    }

    pub(crate) fn has_learned(&self) -> bool {
        self.flown().units() > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prices_explain_the_equations() {
        let mut prices = Prices::new();
        for (cells, hover) in [(1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (0.8, 0.1)].repeat(10) {
            prices.learn(Flown { cells, hover }, 1.6 * cells + 0.8 * hover, 1.0);
        }
        let (cell, hover) = prices.solve();
        assert!((cell - 1.6).abs() < 0.08 && (hover - 0.8).abs() < 0.08, "{cell} {hover}");
        let flown = prices.flown();
        assert!((flown.units() - 39.0).abs() < 0.01, "{flown:?}");
        assert!((prices.mean() - prices.mean_of(flown)).abs() < 0.02);
    }

    #[test]
    fn cells_are_dearer_than_the_hovering_that_was_flown() {
        let mut prices = Prices::new();
        (0..25).for_each(|_| prices.learn(Flown { cells: 0.0, hover: 1.0 }, 1.6, 1.0));
        let (cell, hover) = prices.solve();
        assert!((cell - 2.2).abs() < 0.01 && (hover - 1.6).abs() < 0.05, "{cell} {hover}");
    }

    #[test]
    fn nominal_hovering_leaves_cells_nominal() {
        let mut prices = Prices::new();
        (0..25).for_each(|_| prices.learn(Flown { cells: 0.0, hover: 1.0 }, 0.98, 1.0));
        let (cell, hover) = prices.solve();
        assert!((cell - 1.0).abs() < 0.01 && (hover - 0.98).abs() < 0.01, "{cell} {hover}");
    }

    #[test]
    fn a_step_without_advance_is_no_dear_wind() {
        let mut prices = Prices::new();
        (0..5).for_each(|_| prices.learn(Flown { cells: 0.7, hover: 0.0 }, 0.7, 0.8));
        prices.learn(Flown { cells: 0.06, hover: 0.0 }, 0.7, 0.8);
        assert!(prices.mean() < 1.4, "{}", prices.mean());
    }

    #[test]
    fn charge_that_falls_by_itself_teaches_nothing() {
        let mut prices = Prices::new();
        prices.learn(Flown::default(), 3.0, 1.0);
        prices.learn(Flown { cells: f32::NAN, hover: 0.0 }, 3.0, 1.0);
        assert!(!prices.has_learned());
        assert_eq!(prices.solve(), (1.0, 1.0));
    }
}
