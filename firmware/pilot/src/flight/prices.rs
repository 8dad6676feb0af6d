//! Least squares of what flying takes: a cell, a nominal unit of hovering, and a cell against the wind.

use nalgebra::{Matrix4, Vector4};

/// Weight of the nominal prices, in nominal units.
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
/// Weight of no wind, in cells.
const WIND_PRIOR: f32 = 1.0;
/// Cells without which no wind is told from noise.
const WIND_CELLS: f32 = 10.0;
/// A weaker wind is noise of whole percents. Units per cell: a seventh is a wind of about 1.5 m/s.
const CALM: f32 = 0.15;
/// The same for the price of a cell against the wind: up to here the nominal price, with its margins, covers it.
const BREEZE: f32 = 1.3;

/// Nominal units flown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Flown {
    pub(crate) cells: f32,
    pub(crate) hover: f32,
    /// Cells towards north and east, less those towards south and west.
    pub(crate) net: [f32; 2],
}

impl Flown {
    pub(crate) fn units(self) -> f32 {
        self.cells + self.hover
    }

    fn terms(self) -> Vector4<f32> {
        let [north, east] = self.net;
        Vector4::new(self.cells, self.hover, north, east)
    }
}

/// What a flight takes, in units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Price {
    /// A cell, as the mean of upwind and downwind.
    pub(crate) cell: f32,
    /// A nominal unit of hovering.
    pub(crate) hover: f32,
    /// What a cell towards north and towards east takes more.
    pub(crate) net: [f32; 2],
}

impl Price {
    /// Units that `flown` takes.
    pub(crate) fn of(&self, flown: Flown) -> f32 {
        self.cell * flown.cells + self.hover * flown.hover + self.of_net(flown.net)
    }

    /// What a flight with this net displacement in cells takes because of the wind.
    pub(crate) fn of_net(&self, [north, east]: [f32; 2]) -> f32 {
        self.net[0] * north + self.net[1] * east
    }

    /// The same where every number is one that a battery can mean.
    fn sound(self) -> Price {
        let sound = |price: f32| if price.is_finite() { price.clamp(CHEAPEST, DEAREST) } else { 1.0 };
        let [north, east] = self.net;
        let strength = libm::hypotf(north, east);
        // `NaN` is no wind either.
        let is_wind = strength > CALM && strength < DEAREST && self.cell + strength > BREEZE;
        let net = if is_wind { self.net } else { [0.0; 2] };
        Price { cell: sound(self.cell), hover: sound(self.hover), net }
    }
}

/// Sums over the equations `used = cell x cells + hover x hover + north x net north + east x net east`, older ones with less
/// weight.
///
/// The power of a multirotor grows with the square of its airspeed `v - w`, so the energy of a way has a part that is linear in
/// its net displacement: what a headwind takes, a tailwind gives back.
///
/// Each equation has the weight `1 / units flown`, so that the mean price is the sum of what was used by the sum of what was
/// flown. With equal weights a step of the percentage that spans many cheap units would prevail over one of few dear units; with
/// the mean price of each step, one in which the aircraft brakes and hardly advances would.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prices {
    /// Of the terms cells, hover, net north, net east.
    gram: Matrix4<f32>,
    /// Of each term and what was used.
    moments: Vector4<f32>,
}

impl Prices {
    pub(crate) const fn new() -> Prices {
        Prices {
            gram: Matrix4::new(0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0.),
            moments: Vector4::new(0., 0., 0., 0.),
        }
    }

    /// Takes in one equation. `decay`: what is left of the weight of the older ones.
    pub(crate) fn learn(&mut self, flown: Flown, used: f32, decay: f32) {
        let units = flown.units();
        if units.is_nan() || units < LEAST_UNITS {
            return;
        }
        let terms = flown.terms();
        self.gram = self.gram * decay + terms * terms.transpose() / units;
        self.moments = self.moments * decay + terms * (used / units);
    }

    /// The prices without wind. Where only one course was flown, they are the prices on that course.
    pub(crate) fn solve(&self) -> Price {
        let Prices { gram, moments } = *self;
        let (cc, ch, hh) = (gram.m11 + PRIOR, gram.m12, gram.m22 + PRIOR);
        let (cu, hu) = (moments.x + PRIOR * self.unflown_cell(), moments.y + PRIOR);
        let determinant = cc * hh - ch * ch;
        let (cell, hover) = ((cu * hh - hu * ch) / determinant, (hu * cc - cu * ch) / determinant);
        Price { cell, hover, net: [0.0; 2] }.sound()
    }

    /// The prices with what the wind adds to each course. Without wind, those of [`Prices::solve`].
    pub(crate) fn solve_with_wind(&self) -> Price {
        if self.flown().cells < WIND_CELLS {
            return self.solve();
        }
        let Prices { gram, moments } = *self;
        let prior = Vector4::new(PRIOR, PRIOR, WIND_PRIOR, WIND_PRIOR);
        let moments = moments + Vector4::new(PRIOR * self.unflown_cell(), PRIOR, 0.0, 0.0);
        let solved = (gram + Matrix4::from_diagonal(&prior)).try_inverse().map(|inverse| inverse * moments);
        let price = solved.map(|it| Price { cell: it.x, hover: it.y, net: [it.z, it.w] }.sound());
        price.filter(|price| price.net != [0.0; 2]).unwrap_or_else(|| self.solve())
    }

    /// The price of a cell as far as the equations do not say: nominal. Where nearly only hovering was flown, and that is
    /// dearer than nominal, a cell is dearer too.
    fn unflown_cell(&self) -> f32 {
        let flown = self.flown();
        let is_hovering = flown.cells < HOVERING * flown.units();
        if is_hovering { 1.0 + CELL_TO_HOVER * (self.mean() - 1.0).max(0.0) } else { 1.0 }
    }

    /// What was flown in the equations.
    pub(crate) fn flown(&self) -> Flown {
        // Each row of the gram matrix is a term times the units of its equation, by these units.
        let sums = self.gram.column(0) + self.gram.column(1);
        Flown { cells: sums.x, hover: sums.y, net: [sums.z, sums.w] }
    }

    /// What was used in the equations.
    pub(crate) fn used(&self) -> f32 {
        self.moments.x + self.moments.y
    }

    /// The mean price in the equations; 1 before there is one.
    pub(crate) fn mean(&self) -> f32 {
        let units = self.flown().units();
        if units > 0.0 { self.used() / units } else { 1.0 }
    }

    pub(crate) fn has_learned(&self) -> bool {
        self.flown().units() > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flown(cells: f32, hover: f32) -> Flown {
        Flown { cells, hover, net: [0.0; 2] }
    }

    fn course(north: f32, east: f32) -> Flown {
        Flown { cells: north.abs() + east.abs(), hover: 0.0, net: [north, east] }
    }

    #[test]
    fn the_prices_explain_the_equations() {
        let mut prices = Prices::new();
        for (cells, hover) in [(1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (0.8, 0.1)].repeat(10) {
            prices.learn(flown(cells, hover), 1.6 * cells + 0.8 * hover, 1.0);
        }
        let price = prices.solve();
        assert!((price.cell - 1.6).abs() < 0.08 && (price.hover - 0.8).abs() < 0.08, "{price:?}");
        let total = prices.flown();
        assert!((total.units() - 39.0).abs() < 0.01, "{total:?}");
        assert!((prices.mean() - price.of(total) / total.units()).abs() < 0.02);
        assert_eq!(prices.solve_with_wind(), price, "no course was dearer than another");
    }

    #[test]
    fn wind_makes_one_course_dear_and_the_other_cheap() {
        let mut prices = Prices::new();
        // South was flown most: against the wind it is 1.6, with it 0.8.
        let flights =
            [course(-1.0, 0.0), course(-1.0, 0.0), course(0.0, 1.0), course(0.0, -1.0), course(1.0, 0.0)];
        for flown in flights.repeat(5) {
            prices.learn(flown, 1.2 * flown.cells + 0.4 * flown.net[0], 1.0);
        }
        let price = prices.solve_with_wind();
        let north = price.of(course(1.0, 0.0));
        assert!((north - 1.6).abs() < 0.1 && (price.of(course(-1.0, 0.0)) - 0.8).abs() < 0.1, "{price:?}");
        assert!(prices.solve().cell < north - 0.3, "the mean of what was flown is no price for the way home");
    }

    #[test]
    fn a_dear_single_course_is_as_dear_on_the_way_back() {
        let mut prices = Prices::new();
        (0..25).for_each(|_| prices.learn(course(-1.0, 0.0), 1.7, 1.0));
        // Wind cannot be told from consumption here.
        let (plain, back) = (prices.solve(), prices.solve_with_wind().of(course(1.0, 0.0)));
        assert!((plain.cell - 1.67).abs() < 0.05 && back < plain.cell, "{plain:?} {back}");
    }

    #[test]
    fn cells_are_dearer_than_the_hovering_that_was_flown() {
        let mut prices = Prices::new();
        (0..25).for_each(|_| prices.learn(flown(0.0, 1.0), 1.6, 1.0));
        let Price { cell, hover, .. } = prices.solve();
        assert!((cell - 2.2).abs() < 0.01 && (hover - 1.6).abs() < 0.05, "{cell} {hover}");
    }

    #[test]
    fn nominal_hovering_leaves_cells_nominal() {
        let mut prices = Prices::new();
        (0..25).for_each(|_| prices.learn(flown(0.0, 1.0), 0.98, 1.0));
        let Price { cell, hover, .. } = prices.solve();
        assert!((cell - 1.0).abs() < 0.01 && (hover - 0.98).abs() < 0.01, "{cell} {hover}");
    }

    #[test]
    fn a_step_without_advance_is_no_dear_wind() {
        let mut prices = Prices::new();
        (0..5).for_each(|_| prices.learn(flown(0.7, 0.0), 0.7, 0.8));
        prices.learn(flown(0.06, 0.0), 0.7, 0.8);
        assert!(prices.mean() < 1.4, "{}", prices.mean());
    }

    #[test]
    fn charge_that_falls_by_itself_teaches_nothing() {
        let mut prices = Prices::new();
        prices.learn(Flown::default(), 3.0, 1.0);
        prices.learn(Flown { cells: f32::NAN, ..Flown::default() }, 3.0, 1.0);
        assert!(!prices.has_learned());
        assert_eq!(prices.solve_with_wind(), Price { cell: 1.0, hover: 1.0, net: [0.0; 2] });
    }
}
