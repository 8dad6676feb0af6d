//! The pack: what flying takes from it, what the autopilot says of it, and its failsafe.

use super::motion::TICK_S;
use gleaner_units::{BatteryUnits, Duration, Instant, MetresPerSecond};

/// A battery and what flying takes from it.
///
/// Power is `hover power x (1 + (v / cruise)^2)`. The hover power is chosen so that what the decisions are priced at
/// (paper, eq. 4: one unit for a cell, half a unit for a slot of hovering) covers what they really take: a cell of
/// 20 m from rest to rest lasts 5.2 s and takes 0.98 units, a hover of 2 s takes 0.32. On a real aircraft
/// `GLN_BAT_UNITS` is set to make the same true; with dearer moves the envelope would promise too much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pack {
    /// What it holds when full.
    pub capacity: BatteryUnits,
    /// Units per second of hovering.
    pub hover_per_s: f32,
    /// The speed at which flying takes twice the power of hovering.
    pub cruise: MetresPerSecond,
}

impl Pack {
    /// A full pack of this capacity in the aircraft of [`crate::Copter`].
    #[must_use]
    pub const fn new(capacity: BatteryUnits) -> Pack {
        Pack { capacity, hover_per_s: 0.16, cruise: MetresPerSecond(10.0) }
    }
}

/// How far the battery failsafe has gone. It never goes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    Fine,
    Low,
    Critical,
}

/// The battery monitor.
#[derive(Clone, Debug)]
pub(crate) struct Battery {
    pack: Pack,
    used: f64,
    power_per_s: f64,
    pub voltage_v: f32,
    level: Level,
    low_since: Option<Instant>,
    critical_since: Option<Instant>,
}

/// Thresholds in force, from the parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thresholds {
    pub low_v: f32,
    pub critical_v: f32,
    pub timer: Duration,
}

impl Battery {
    /// Hover current of the measured quadrotor, units of 10 mA.
    const HOVER_CURRENT_CA: f64 = 2811.0;
    /// `BATT_CAPACITY`, mAh.
    pub const CAPACITY_MAH: f64 = 3300.0;

    pub fn new(pack: Pack) -> Battery {
        Battery {
            pack,
            used: 0.0,
            power_per_s: 0.0,
            voltage_v: 12.6,
            level: Level::Fine,
            low_since: None,
            critical_since: None,
        }
    }

    /// One tick in the air at this ground speed, or on the ground.
    pub fn draw(&mut self, flying_at_mps: Option<f64>) {
        let ratio = flying_at_mps.unwrap_or(0.0) / f64::from(self.pack.cruise.0);
        self.power_per_s = match flying_at_mps {
            Some(_) => f64::from(self.pack.hover_per_s) * (1.0 + ratio * ratio),
            None => 0.0,
        };
        self.used = (self.used + self.power_per_s * TICK_S).min(f64::from(self.pack.capacity.0));
    }

    /// Takes units away: a weak cell, a fault.
    pub fn lose(&mut self, units: BatteryUnits) {
        self.used = (self.used + f64::from(units.0)).clamp(0.0, f64::from(self.pack.capacity.0));
    }

    pub fn left(&self) -> BatteryUnits {
        BatteryUnits((f64::from(self.pack.capacity.0) - self.used) as f32)
    }

    pub fn level(&self) -> Level {
        self.level
    }

    /// Whole percent, cut off, as the autopilot reports it.
    pub fn percent(&self) -> i8 {
        (100.0 * (1.0 - self.used / f64::from(self.pack.capacity.0))) as i8
    }

    pub fn consumed_mah(&self) -> i32 {
        (self.used / f64::from(self.pack.capacity.0) * Battery::CAPACITY_MAH) as i32
    }

    pub fn current_ca(&self) -> i16 {
        (Battery::HOVER_CURRENT_CA * self.power_per_s / f64::from(self.pack.hover_per_s)) as i16
    }

    /// The level that begins now, if one does. Each begins once; straight to critical skips low.
    pub fn check(&mut self, now: Instant, thresholds: Thresholds) -> Option<Level> {
        let since = |below: bool, since: Option<Instant>| if below { since.or(Some(now)) } else { None };
        self.low_since = since(self.voltage_v < thresholds.low_v, self.low_since);
        self.critical_since = since(self.voltage_v < thresholds.critical_v, self.critical_since);
        let over = |since: Option<Instant>| since.is_some_and(|since| now - since >= thresholds.timer);
        let reached = if over(self.critical_since) {
            Level::Critical
        } else if over(self.low_since) {
            Level::Low
        } else {
            Level::Fine
        };
        if reached > self.level {
            self.level = reached;
            Some(reached)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autopilot::motion::{Body, SpeedLimits};

    fn battery() -> Battery {
        Battery::new(Pack::new(BatteryUnits(100.0)))
    }

    #[test]
    fn a_cell_and_a_slot_take_no_more_than_they_are_priced_at() {
        let mut hovering = battery();
        (0..100).for_each(|_| hovering.draw(Some(0.0)));
        let taken = 100.0 - hovering.left().0;
        assert!((0.25..=0.5).contains(&taken), "{taken} for 2 s");
        assert_eq!(hovering.percent(), 99, "cut off, not rounded");
        let mut flying = battery();
        let mut body = Body::at([0.0, 0.0, -60.0]);
        let limits = SpeedLimits { horizontal_mps: 10.0, up_mps: 2.5, down_mps: 1.5 };
        // Until arrival inside the default radius of 2 m.
        while body.position[1] < 18.0 {
            body.fly_to([0.0, 20.0, -60.0], [0.0; 3], limits);
            flying.draw(Some(body.ground_speed_mps()));
        }
        let taken = 100.0 - flying.left().0;
        assert!((0.9..=1.0).contains(&taken), "{taken} for 20 m");
    }

    #[test]
    fn the_failsafe_waits_for_its_timer_and_never_goes_back() {
        let thresholds = Thresholds { low_v: 10.5, critical_v: 10.0, timer: Duration::from_secs(10) };
        let at = |seconds: u64| Instant::from_millis(seconds * 1000);
        let mut battery = battery();
        battery.voltage_v = 10.3;
        assert_eq!(battery.check(at(0), thresholds), None);
        battery.voltage_v = 11.0;
        assert_eq!(battery.check(at(9), thresholds), None);
        battery.voltage_v = 10.3;
        assert_eq!(battery.check(at(10), thresholds), None, "the timer began anew");
        assert_eq!(battery.check(at(20), thresholds), Some(Level::Low));
        assert_eq!(battery.check(at(21), thresholds), None, "told once");
        battery.voltage_v = 12.6;
        assert_eq!(battery.check(at(60), thresholds), None);
        assert_eq!(battery.level(), Level::Low);
        battery.voltage_v = 9.0;
        battery.check(at(61), thresholds);
        assert_eq!(battery.check(at(71), thresholds), Some(Level::Critical));
    }
}
