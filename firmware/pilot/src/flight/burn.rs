//! What flying really takes from the battery, learned from the measured charge.
//!
//! Battery units are priced nominally: one for a cell, half of one for a slot of hovering. The real price depends on
//! wind, speed and aircraft. MAVLink carries the charge in whole percent, so the only exact moments are those at which
//! the percentage steps down: between two of them exactly that many percent were used. Each step gives one equation
//!
//! ```text
//! units used = cell x cells flown + hover x nominal units hovered + wind . net displacement in cells
//! ```
//!
//! and the prices are the least-squares solution over the last steps, at first with the nominal prices ([`Prices`]). Where
//! the monitor counts mAh, and these agree with the percentage, each half percent of them gives such an equation instead
//! ([`super::charge`]).
//!
//! What braking, a turn and accelerating add to the time of a leg counts as hovering ([`super::leg`]): as part of the price of a
//! cell, some turns in a row would make the way home look twice as dear as it is.
//!
//! The price of the last few steps is watched beside that of the last 25. When it is clearly higher, the older steps
//! belong to another wind, and both prices count by the same factor more.

use crate::flight::charge::Charge;
use crate::flight::prices::{Flown, Price, Prices};
use gleaner_units::BatteryUnits;

/// Nominal units per second of hovering: half a unit for the two seconds in which 20 m are flown at 10 m/s.
pub(crate) const HOVER_UNITS_PER_S: f32 = 0.25;
/// Weight of an older equation per newer one: a window of about 25 steps.
const DECAY: f32 = 0.96;
/// The same for the last few steps: about four.
const RECENT_DECAY: f32 = 0.75;
/// From this factor on the last steps are dearer. The time of a step is known to one report of the battery, 2 s on PX4, which
/// makes the price of four steps uncertain by about a tenth.
const DEARER: f32 = 1.15;
/// The most that they may be dearer.
const DEAREST: f32 = 3.0;
/// Nominal units that the last steps must span to be compared.
const RECENT_UNITS: f32 = 1.5;
/// A larger step within one report is a fault of the monitor or of a cell, not consumption.
pub(crate) const JUMP_PERCENT: u8 = 5;
/// A price that is learned this close to the nominal one is noise of whole percents.
const NOISE: f32 = 1.05;
/// Percent that an equation from mAh spans at least.
const MAH_PERCENT: f32 = 0.5;
/// Margin on a learned price that is not nominal: gusts and braking make the last cells and the descent that much dearer than the
/// mean of those before.
const MARGIN: f32 = 1.05;
/// From this price on the margin grows by this slope: in a strong wind the courses differ most, and the way home is one that was
/// seldom flown.
const STRONG: f32 = 1.1;
const MARGIN_SLOPE: f32 = 0.2;

/// A learned price with its margin.
fn with_margin(price: f32) -> f32 {
    price * (MARGIN + MARGIN_SLOPE * (price - STRONG).max(0.0))
}

/// What a new percentage means. A jump teaches nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reading {
    /// Nothing new.
    Same,
    /// It went down as flying does.
    Step,
    /// It went up, or down by more than what flying can take: a cell failed, or the monitor did.
    Jump,
}

/// The prices of a cell and of hovering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Burn {
    prices: Prices,
    /// Of the last few steps.
    recent: Prices,
    flown: Flown,
    percent: Option<u8>,
    /// Whether the percentage has stepped since it was first seen: before that the interval has no exact start.
    anchored: bool,
    charge: Charge,
    /// mAh drawn when `flown` began, if it counts by them.
    mah: Option<u32>,
}

impl Burn {
    pub(crate) const fn new() -> Burn {
        Burn {
            prices: Prices::new(),
            recent: Prices::new(),
            flown: Flown { cells: 0.0, hover: 0.0, net: [0.0; 2] },
            percent: None,
            anchored: false,
            charge: Charge::new(),
            mah: None,
        }
    }

    /// A fraction of a cell was flown in this direction over the ground, north and east.
    pub(crate) fn flew(&mut self, cells: f32, [north, east]: [f32; 2]) {
        self.flown.cells += cells;
        self.flown.net[0] += cells * north;
        self.flown.net[1] += cells * east;
    }

    /// The aircraft hovered for `secs`.
    pub(crate) fn hovered(&mut self, secs: f32) {
        self.flown.hover += secs * HOVER_UNITS_PER_S;
    }

    /// Something else than this flight used the battery: the interval has no exact start any more.
    pub(crate) fn interrupt(&mut self) {
        self.flown = Flown::default();
        self.percent = None;
        self.anchored = false;
        self.charge.jumped();
        self.mah = None;
    }

    /// Takes in the measured percentage and the mAh drawn. `full`: units of a full battery.
    pub(crate) fn read(&mut self, percent: u8, mah: Option<u32>, full: BatteryUnits) -> Reading {
        let by_mah = self.charge.mah_per_percent().zip(mah);
        if let Some((per_percent, mah)) = by_mah {
            self.read_mah(mah, per_percent, full);
        } else {
            self.mah = None;
        }
        let Some(last) = self.percent.replace(percent) else { return Reading::Same };
        if percent == last {
            return Reading::Same;
        }
        let was_anchored = core::mem::replace(&mut self.anchored, true);
        let step = last.saturating_sub(percent);
        let used = full.0 * f32::from(step) / 100.0;
        // One percent at once may be the end of a long one; several were used since the last report.
        let is_lost = step > 1 && was_anchored && by_mah.is_none() && used > DEAREST * self.flown.units();
        if step == 0 || step > JUMP_PERCENT || is_lost {
            self.anchored = false;
            self.charge.jumped();
            if by_mah.is_none() {
                self.flown = Flown::default();
            }
            return Reading::Jump;
        }
        self.charge.stepped(step, mah);
        if by_mah.is_none() {
            let flown = core::mem::take(&mut self.flown);
            if was_anchored {
                self.learn(flown, used);
            }
        }
        Reading::Step
    }

    /// One equation for each half percent of the charge drawn.
    fn read_mah(&mut self, mah: u32, per_percent: f32, full: BatteryUnits) {
        let drawn = self.mah.map(|from| mah.checked_sub(from));
        match drawn {
            Some(Some(drawn)) => {
                let percent = drawn as f32 / per_percent;
                if percent >= MAH_PERCENT {
                    let flown = core::mem::take(&mut self.flown);
                    // A counter that leaps was reset, or counts another battery.
                    let used = full.0 * percent / 100.0;
                    let is_lost = percent > 1.0 && used > DEAREST * flown.units();
                    if percent <= f32::from(JUMP_PERCENT) && !is_lost {
                        self.learn(flown, used);
                    }
                    self.mah = Some(mah);
                }
            }
            Some(None) | None => {
                self.flown = Flown::default();
                self.mah = Some(mah);
            }
        }
    }

    fn learn(&mut self, flown: Flown, used: f32) {
        self.prices.learn(flown, used, DECAY);
        self.recent.learn(flown, used, RECENT_DECAY);
    }

    /// Prices as learned, without wind, and as much dearer as the last few steps were.
    pub(crate) fn learned(&self) -> Price {
        let Price { cell, hover, net } = self.prices.solve();
        let factor = self.dearer();
        Price { cell: cell * factor, hover: hover * factor, net }
    }

    /// The price of a nominal unit of hovering that a landing is planned with. What hovering took may be known only from before
    /// a change that cells showed since, so it is at least the mean of the window.
    pub(crate) fn descent_price(&self) -> f32 {
        let price = self.learned().hover.max(self.prices.mean());
        if price > NOISE { with_margin(price) } else { price.max(1.0) }
    }

    /// The price of a nominal unit of hovering as it was learned from hovering, without a margin: what the landing will probably
    /// take.
    pub(crate) fn hover_price(&self) -> f32 {
        self.prices.solve().hover.max(1.0)
    }

    /// How much dearer the last few steps were than the window says: 1 if not clearly.
    fn dearer(&self) -> f32 {
        let recently = self.recent.flown();
        if recently.units() < RECENT_UNITS {
            return 1.0;
        }
        let factor = self.recent.used() / self.prices.solve().of(recently);
        if factor > DEARER { factor.min(DEAREST) } else { 1.0 }
    }

    /// The price of a nominal unit that the way home is judged by: never below 1. `slot_s` is the time of a slot: the
    /// guard prices a hover at half a unit and a cell at one, however long they last.
    pub(crate) fn price(&self, slot_s: f32) -> f32 {
        let slot = slot_s * HOVER_UNITS_PER_S;
        if !self.prices.has_learned() {
            // A cell takes at least the hovering power of its time.
            return if slot > 1.0 { slot } else { 1.0 };
        }
        let Price { cell, hover, .. } = self.learned();
        let dearest = cell.max(hover * slot / 0.5);
        if dearest > NOISE { with_margin(dearest) } else { 1.0 }
    }

    /// Units that the way home takes for its course, beyond `price` for each of its cells: what the wind against it adds.
    /// `net`: its net displacement towards north and east, in cells.
    ///
    /// The price times the cells and these units cover every way home that is no longer: what a detour adds by going against the
    /// wind, it gets back.
    pub(crate) fn headwind(&self, cells: f32, net: [f32; 2], price: f32) -> f32 {
        let with_wind = self.prices.solve_with_wind();
        if with_wind.net == [0.0; 2] || cells < 1.0 {
            return 0.0;
        }
        let mean = with_wind.cell + with_wind.of_net(net) / cells;
        ((with_margin(mean) - price) * cells).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: BatteryUnits = BatteryUnits(100.0);
    const NORTH: [f32; 2] = [1.0, 0.0];

    /// Flies cells and hovers in turn with these prices in percent.
    fn fly(cell: f32, hover_slot: f32, slots: usize) -> Burn {
        let mut burn = Burn::new();
        let mut left = 90.7_f32;
        for slot in 0..slots {
            for _ in 0..40 {
                if slot % 3 == 2 {
                    burn.hovered(0.05);
                    left -= hover_slot / 40.0;
                } else {
                    burn.flew(0.025, NORTH);
                    left -= cell / 40.0;
                }
                burn.read(left as u8, None, FULL);
            }
        }
        burn
    }

    #[test]
    fn prices_are_learned_from_whole_percents() {
        for (cell, hover_slot) in [(1.5, 0.5), (1.2, 0.6), (2.5, 0.4), (0.8, 0.3)] {
            let learned = fly(cell, hover_slot, 30).learned();
            assert!((learned.cell - cell).abs() < 0.12 * cell, "{learned:?} for {cell}");
            assert!((learned.hover - hover_slot / 0.5).abs() < 0.4, "{learned:?} for {hover_slot}");
        }
    }

    /// A pack of 3,300 mAh whose monitor shows steps of 2 percent.
    #[test]
    fn mah_teach_where_the_percentage_is_coarse() {
        let mut burn = Burn::new();
        let (cell, mut left) = (1.6_f32, 95.2_f32);
        let read = |burn: &mut Burn, left: f32| {
            let percent = (left / 2.0) as u8 * 2;
            burn.read(percent, Some((33.0 * (100.0 - left)) as u32), FULL)
        };
        for _ in 0..25 {
            for _ in 0..20 {
                burn.flew(0.05, NORTH);
                left -= cell / 20.0;
                read(&mut burn, left);
            }
        }
        let learned = burn.learned().cell;
        assert!((learned - cell).abs() < 0.1, "{learned}");
        // A percentage that jumps with the voltage does not disturb it.
        for percent in [20, 60, 30] {
            assert_eq!(burn.read(percent, Some((33.0 * (100.0 - left)) as u32), FULL), Reading::Jump);
        }
        for _ in 0..40 {
            burn.flew(0.05, NORTH);
            left -= 2.4 / 20.0;
            burn.read(30, Some((33.0 * (100.0 - left)) as u32), FULL);
        }
        assert!(burn.learned().cell > learned + 0.1, "it goes on learning: {}", burn.learned().cell);
    }

    #[test]
    fn the_price_never_falls_below_nominal() {
        assert_eq!(Burn::new().price(2.0), 1.0);
        assert_eq!(Burn::new().price(4.0), 1.0);
        assert_eq!(Burn::new().price(8.0), 2.0, "a slow cell takes as much as hovering for so long");
        assert_eq!(fly(0.98, 0.32, 40).price(2.0), 1.0);
        let windy = fly(1.5, 0.6, 40).price(2.0);
        assert!((1.45..1.75).contains(&windy), "{windy}");
    }

    /// Nominal consumption, then wind: many cheap steps must not outweigh few dear ones.
    #[test]
    fn eight_percent_teach_most_of_a_dearer_wind() {
        for price in [1.4, 1.8, 2.4] {
            let mut burn = Burn::new();
            let mut left = 90.5_f32;
            let mut fly = |burn: &mut Burn, price: f32, percent: f32| {
                let until = left - percent;
                while left > until {
                    burn.flew(0.05, NORTH);
                    left -= 0.05 * price;
                    burn.read(left as u8, None, FULL);
                }
            };
            fly(&mut burn, 0.98, 40.0);
            assert_eq!(burn.price(2.0), 1.0);
            fly(&mut burn, price, 8.0);
            assert!(burn.price(2.0) > 0.85 * price, "{} for {price}", burn.price(2.0));
            fly(&mut burn, price, 20.0);
            assert!(burn.price(2.0) < 1.1 * with_margin(price), "{} for {price}", burn.price(2.0));
        }
    }

    /// Crosswind and downwind were flown, and the way home is upwind.
    #[test]
    fn the_way_home_against_the_wind_is_dearer_than_the_way_out() {
        let mut burn = Burn::new();
        let mut left = 90.5_f32;
        for leg in 0..12 {
            let (direction, price) =
                [([0.0, 1.0], 1.3), ([1.0, 0.0], 0.9), ([0.0, -1.0], 1.3), ([1.0, 0.0], 0.9)][leg % 4];
            for _ in 0..60 {
                burn.flew(0.05, direction);
                left -= 0.05 * price;
                burn.read(left as u8, None, FULL);
            }
        }
        let price = burn.price(2.0);
        let home = price * 10.0 + burn.headwind(10.0, [-10.0, 0.0], price);
        assert!((15.5..18.5).contains(&home), "{home}: a cell upwind takes 1.7");
        assert!(burn.headwind(10.0, [10.0, 0.0], price) < 0.2, "downwind the price of a cell suffices");
        assert!(fly(0.98, 0.49, 40).headwind(10.0, [-10.0, 0.0], 1.0) < 0.5, "no wind");
    }

    #[test]
    fn cells_that_grow_dear_make_the_landing_dearer() {
        let mut burn = fly(1.0, 0.5, 20);
        assert!(burn.descent_price() < 1.1, "{}", burn.descent_price());
        let mut left = 60.5_f32;
        burn.interrupt();
        while left > 30.0 {
            burn.flew(0.05, NORTH);
            left -= 0.05 * 1.8;
            burn.read(left as u8, None, FULL);
        }
        assert!(burn.descent_price() > 1.5, "{}", burn.descent_price());
    }

    /// A cell of the pack failed: the charge fell at once, and flying is as cheap as before.
    #[test]
    fn charge_that_is_lost_at_once_makes_nothing_dearer() {
        for lost in 4..=JUMP_PERCENT {
            let mut burn = fly(1.0, 0.5, 30);
            let before = burn.learned();
            let percent = burn.percent.unwrap();
            burn.flew(0.4, NORTH);
            assert_eq!(burn.read(percent - lost, None, FULL), Reading::Jump);
            assert_eq!(burn.learned(), before, "{lost} %");
        }
    }

    #[test]
    fn jumps_teach_nothing() {
        let mut burn = fly(1.0, 0.5, 30);
        let before = burn.learned();
        assert_eq!(burn.read(40, None, FULL), Reading::Jump);
        assert_eq!(burn.read(60, None, FULL), Reading::Jump);
        assert_eq!(burn.read(60, None, FULL), Reading::Same);
        burn.flew(5.0, NORTH);
        assert_eq!(burn.read(59, None, FULL), Reading::Step);
        assert_eq!(burn.learned(), before, "the interval after a jump has no exact start");
    }
}
