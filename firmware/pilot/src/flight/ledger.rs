//! Battery units left: what the guard's arithmetic says, and what the autopilot measures.

use gleaner_units::{Action, BatteryUnits};

/// The account of one mission.
///
/// It is opened with the measured charge or the mission's budget, whichever is less, and pays for each action
/// when it is decided. What is available is also capped by the latest measurement. MAVLink carries the charge in
/// whole percent, truncated by both autopilots, so up to one percent more than reported may be there: the cap is
/// `percent + 1`, and `GLN_RESERVE` must cover that one percent. The cap does not last: when a sagging voltage
/// recovers, the account is still the account.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ledger {
    left: BatteryUnits,
    spent: BatteryUnits,
}

impl Ledger {
    /// Opens the account; `percent` as measured, `full` what a full battery is worth.
    pub(crate) fn open(percent: u8, full: BatteryUnits, budget: BatteryUnits) -> Ledger {
        Ledger { left: smaller(charge(percent, full), budget), spent: BatteryUnits(0.0) }
    }

    /// What may be used, given the latest measurement if there is one.
    pub(crate) fn available(&self, percent: Option<u8>, full: BatteryUnits) -> BatteryUnits {
        match percent {
            Some(percent) => smaller(self.left, charge(percent.saturating_add(1), full)),
            None => self.left,
        }
    }

    /// Pays for an action.
    pub(crate) fn pay(&mut self, action: Action) {
        self.left = self.left - action.cost();
        self.spent = self.spent + action.cost();
    }

    /// Paid so far.
    pub(crate) const fn spent(&self) -> BatteryUnits {
        self.spent
    }
}

/// Battery units behind a percentage.
pub(crate) fn charge(percent: u8, full: BatteryUnits) -> BatteryUnits {
    // In this order, so that whole results are exact.
    BatteryUnits(full.0 * f32::from(percent.min(100)) / 100.0)
}

pub(crate) fn smaller(a: BatteryUnits, b: BatteryUnits) -> BatteryUnits {
    if b < a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: BatteryUnits = BatteryUnits(200.0);

    #[test]
    fn the_account_opens_with_the_lesser_of_charge_and_budget() {
        assert_eq!(Ledger::open(90, FULL, BatteryUnits(80.0)).available(None, FULL), BatteryUnits(80.0));
        assert_eq!(Ledger::open(30, FULL, BatteryUnits(80.0)).available(None, FULL), BatteryUnits(60.0));
    }

    #[test]
    fn actions_are_paid_and_the_measurement_caps_what_is_left() {
        let mut ledger = Ledger::open(90, FULL, BatteryUnits(80.0));
        ledger.pay(Action::North);
        ledger.pay(Action::Hover);
        assert_eq!(ledger.spent(), BatteryUnits(1.5));
        assert_eq!(ledger.available(Some(90), FULL), BatteryUnits(78.5));
        assert_eq!(ledger.available(Some(19), FULL), BatteryUnits(40.0), "one percent more than reported");
        assert_eq!(ledger.available(Some(90), FULL), BatteryUnits(78.5), "the cap does not last");
        assert_eq!(
            ledger.available(Some(u8::MAX), BatteryUnits(1.0)),
            BatteryUnits(1.0),
            "100 % is the most"
        );
    }
}
