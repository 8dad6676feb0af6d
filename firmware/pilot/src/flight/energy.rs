//! Battery units: what the mission may still use, what landing takes, what is expected at touchdown.

use crate::flight::burn::{Burn, HOVER_UNITS_PER_S, Reading};
use crate::scene::Scene;
use gleaner_units::{Action, BatteryUnits, Cell};

/// What descending takes less than hovering: ArduCopter used 12.7 units of 100 in 57 s. It is saved in the rotors, so that it
/// does not grow with what the wind takes.
const DESCENT_SAVING: f32 = 0.1;

/// The account of one mission.
///
/// It is opened at engage with the measured charge less the landing, or with what is left of the mission's budget,
/// whichever is less, and pays for each action when it is decided. What is available is also capped by the latest
/// measurement, at the learned price of a unit. MAVLink carries the charge in whole percent, truncated by both
/// autopilots, so up to one percent more than reported may be there: the cap is `percent + 1`, and `GLN_RESERVE` must
/// cover that one percent. The cap does not last: when a sagging voltage recovers, the account is still the account.
///
/// A mission lasts from arming to disarming: a take-over, a second engagement and a restart of the program
/// ([`Energy::resume`]) do not reopen a spent budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Energy {
    left: BatteryUnits,
    spent: BatteryUnits,
    pub(crate) burn: Burn,
}

impl Energy {
    pub(crate) const fn new() -> Energy {
        Energy { left: BatteryUnits(0.0), spent: BatteryUnits(0.0), burn: Burn::new() }
    }

    /// Another mission: nothing is spent. Prices that were learned stay.
    pub(crate) fn begin_mission(&mut self) {
        self.spent = BatteryUnits(0.0);
        self.left = BatteryUnits(0.0);
        self.burn.interrupt();
    }

    /// Continues a mission of an earlier run of the program, which used `spent`. Only what is more than known counts.
    pub(crate) fn resume(&mut self, spent: BatteryUnits) {
        if spent.0.is_finite() && self.spent < spent {
            self.spent = spent;
        }
    }

    /// Units that could be used from here if the mission were engaged now.
    pub(crate) fn offered(&self, scene: &Scene<'_>, percent: u8) -> BatteryUnits {
        smaller(self.measured(scene, percent), scene.mission.budget - self.spent)
    }

    /// Engages with what is offered.
    pub(crate) fn open(&mut self, offered: BatteryUnits) {
        self.left = offered;
        self.burn.interrupt();
    }

    /// What may be used once `ahead` is flown, which is paid for but not yet taken from the battery. Given the latest
    /// measurement if there is one.
    pub(crate) fn available(&self, scene: &Scene<'_>, ahead: BatteryUnits) -> BatteryUnits {
        match scene.vehicle().battery_percent {
            Some(percent) => smaller(self.left, self.measured(scene, percent.saturating_add(1)) - ahead),
            None => self.left,
        }
    }

    /// Pays for an action.
    pub(crate) fn pay(&mut self, action: Action) {
        self.left = self.left - action.cost();
        self.spent = self.spent + action.cost();
    }

    /// Paid in this mission.
    pub(crate) const fn spent(&self) -> BatteryUnits {
        self.spent
    }

    /// Takes in the measured charge; whether the percentage jumped.
    pub(crate) fn read(&mut self, scene: &Scene<'_>) -> bool {
        let full = scene.inputs.parameters.full_battery();
        let vehicle = scene.vehicle();
        let mah = vehicle.battery_drawn_mah;
        vehicle.battery_percent.is_some_and(|percent| self.burn.read(percent, mah, full) == Reading::Jump)
    }

    /// Battery percent that a unit costs, as learned.
    pub(crate) fn unit_percent(&self, scene: &Scene<'_>) -> f32 {
        self.burn.learned().cell * 100.0 / scene.inputs.parameters.full_battery().0
    }

    /// Percent expected at touchdown after `ahead` and the way home from `cell`; negative when it does not suffice.
    pub(crate) fn touchdown_percent(
        &self,
        scene: &Scene<'_>,
        cell: Cell,
        ahead: BatteryUnits,
    ) -> Option<f32> {
        let percent = f32::from(scene.vehicle().battery_percent?);
        let way = f32::from(scene.guard.distance(cell)?) + ahead.0;
        let full = scene.inputs.parameters.full_battery().0;
        let cell_price = self.burn.learned().cell;
        let used = way * cell_price + self.headwind(scene, cell_price) + self.landing(scene).0;
        Some(percent - used * 100.0 / full)
    }

    /// Percent expected at touchdown if everything that is available but the reserve is used.
    pub(crate) fn least_percent(&self, scene: &Scene<'_>) -> Option<f32> {
        let percent = f32::from(scene.vehicle().battery_percent?);
        let full = scene.inputs.parameters.full_battery().0;
        let used = self.available(scene, BatteryUnits(0.0)) - scene.guard.reserve();
        let price = self.burn.price(scene.slot().as_secs_f32());
        let used = used.0 * price + self.headwind(scene, price) + self.landing(scene).0;
        Some(percent - used * 100.0 / full)
    }

    /// Whether the measured charge still covers `ahead`, the way from `cell` and the landing, without reserve.
    pub(crate) fn reaches_home(&self, scene: &Scene<'_>, cell: Cell, ahead: BatteryUnits) -> bool {
        self.touchdown_percent(scene, cell, ahead).is_none_or(|percent| percent + 1.0 > 0.0)
    }

    /// Whether little more than the landing is left.
    pub(crate) fn must_land(&self, scene: &Scene<'_>) -> bool {
        let full = scene.inputs.parameters.full_battery();
        let left = scene.vehicle().battery_percent.map(|percent| charge(percent, full));
        // Without the margins of a plan: the terminal may be one cell away.
        let landing = descent_units(scene, self.burn.hover_price());
        left.is_some_and(|left| left.0 < landing + self.burn.learned().cell)
    }

    /// Units that the landing takes, from the flight altitude at the descent rate of the autopilot.
    fn landing(&self, scene: &Scene<'_>) -> BatteryUnits {
        BatteryUnits(descent_units(scene, self.burn.descent_price()))
    }

    /// Nominal units behind a percentage: less the landing and the wind against the way home, at the learned price.
    fn measured(&self, scene: &Scene<'_>, percent: u8) -> BatteryUnits {
        let price = self.burn.price(scene.slot().as_secs_f32());
        let left = charge(percent, scene.inputs.parameters.full_battery()) - self.landing(scene);
        BatteryUnits((left.0 - self.headwind(scene, price)) / price)
    }

    /// Units that the wind adds to the way home from where the aircraft is, beyond `price` for each cell.
    fn headwind(&self, scene: &Scene<'_>, price: f32) -> f32 {
        let Some((cell, net)) = scene.homeward() else { return 0.0 };
        let cells = scene.guard.distance(cell).map_or(0.0, f32::from);
        self.burn.headwind(cells, net, price)
    }
}

/// Units of descent and landing at this price of a nominal unit of hovering.
fn descent_units(scene: &Scene<'_>, hover_price: f32) -> f32 {
    let secs = scene.inputs.parameters.altitude().0 / scene.inputs.rules.descent_rate.0.max(0.1);
    secs * HOVER_UNITS_PER_S * (hover_price - DESCENT_SAVING)
}

/// Battery units behind a percentage.
fn charge(percent: u8, full: BatteryUnits) -> BatteryUnits {
    // In this order, so that whole results are exact.
    BatteryUnits(full.0 * f32::from(percent.min(100)) / 100.0)
}

fn smaller(a: BatteryUnits, b: BatteryUnits) -> BatteryUnits {
    if b < a { b } else { a }
}
