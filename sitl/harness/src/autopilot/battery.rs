//! The pack: energy use, what the autopilot reports of it, and the voltage failsafe.

use super::motion::TICK_S;
use gleaner_units::{BatteryUnits, Duration, Instant};

/// How much power flying takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnergyModel {
    /// The paper's prices hold: a cell of 20 m from rest to rest takes 0.98 units and a hover of 2 s 0.32, so the
    /// decisions (1 and 0.5 units) always pay for what they use. For tests of the account and for comparisons with
    /// an episode of the trainer.
    #[default]
    Nominal,
    /// As measured on ArduCopter with a pack of 3,300 mAh: hovering takes 0.24 % a second, so a unit of a pack that
    /// counts as 100 units really costs 1.15 to 1.2 %, 1.5 % in 8 m/s of wind; landing from 60 m takes 12.7 %.
    Measured,
}

/// A battery and its use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pack {
    /// What it holds when full.
    pub capacity: BatteryUnits,
    /// Power of hovering, units per second.
    pub hover_per_s: f32,
    /// Airspeed at which flying takes twice the power of hovering, m/s.
    pub doubling_mps: f32,
    /// Power while descending, as a fraction of hovering.
    pub descent: f32,
}

impl Pack {
    /// Hover current over capacity, 28.1 A of 3,300 mAh: percent of the pack per second.
    const MEASURED_HOVER_PERCENT_PER_S: f32 = 0.2365;

    /// A full pack of this capacity under this model.
    #[must_use]
    pub const fn new(capacity: BatteryUnits, model: EnergyModel) -> Pack {
        match model {
            EnergyModel::Nominal => Pack { capacity, hover_per_s: 0.16, doubling_mps: 10.0, descent: 1.0 },
            EnergyModel::Measured => Pack {
                capacity,
                hover_per_s: Pack::MEASURED_HOVER_PERCENT_PER_S * capacity.0 / 100.0,
                doubling_mps: 16.5,
                descent: 0.93,
            },
        }
    }
}

/// Stage of the battery failsafe. It is latched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Level {
    Fine,
    Low,
    Critical,
    /// PX4 only.
    Emergency,
}

/// The battery monitor.
#[derive(Clone, Debug)]
pub(super) struct Battery {
    pack: Pack,
    used: f64,
    power_per_s: f64,
    /// Factor on all power.
    pub consumption: f64,
    pub voltage_v: f32,
    unknown_until: Instant,
    pub level: Level,
    low_since: Option<Instant>,
    critical_since: Option<Instant>,
}

/// Voltage thresholds in force, from the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Thresholds {
    pub low_v: f32,
    pub critical_v: f32,
    pub timer: Duration,
}

impl Battery {
    /// Hover current of the measured quadrotor, units of 10 mA.
    const HOVER_CURRENT_CA: f64 = 2811.0;
    /// `BATT_CAPACITY`, mAh.
    const CAPACITY_MAH: f64 = 3300.0;

    pub const fn new(pack: Pack) -> Battery {
        Battery {
            pack,
            used: 0.0,
            power_per_s: 0.0,
            consumption: 1.0,
            voltage_v: 12.6,
            unknown_until: Instant::ZERO,
            level: Level::Fine,
            low_since: None,
            critical_since: None,
        }
    }

    /// One tick in the air with this squared airspeed, m^2/s^2; `None` on the ground.
    pub fn draw(&mut self, airspeed_squared: Option<f64>, descends: bool) {
        let doubling = f64::from(self.pack.doubling_mps);
        self.power_per_s = match airspeed_squared {
            Some(squared) => {
                let descent = if descends { f64::from(self.pack.descent) } else { 1.0 };
                let hover = f64::from(self.pack.hover_per_s) * self.consumption * descent;
                hover * (1.0 + squared / (doubling * doubling))
            }
            None => 0.0,
        };
        self.used = (self.used + self.power_per_s * TICK_S).min(f64::from(self.pack.capacity.0));
    }

    /// Removes charge.
    pub fn lose(&mut self, units: BatteryUnits) {
        self.used = (self.used + f64::from(units.0)).clamp(0.0, f64::from(self.pack.capacity.0));
    }

    /// The monitor reports no percentage until then.
    pub fn hide_until(&mut self, until: Instant) {
        self.unknown_until = until;
    }

    pub fn left(&self) -> BatteryUnits {
        BatteryUnits((f64::from(self.pack.capacity.0) - self.used) as f32)
    }

    /// Fraction left.
    pub fn fraction(&self) -> f64 {
        1.0 - self.used / f64::from(self.pack.capacity.0)
    }

    /// Whole percent, truncated, as the autopilot reports it; -1 while unknown.
    pub fn percent(&self, now: Instant) -> i8 {
        if now < self.unknown_until { -1 } else { (100.0 * self.fraction()) as i8 }
    }

    pub fn consumed_mah(&self) -> i32 {
        (self.used / f64::from(self.pack.capacity.0) * Battery::CAPACITY_MAH) as i32
    }

    pub fn current_ca(&self) -> i16 {
        (Battery::HOVER_CURRENT_CA * self.power_per_s / f64::from(self.pack.hover_per_s)) as i16
    }

    /// The failsafe level that begins now, if any. Each begins once; a drop straight to critical skips low.
    pub fn check_voltage(&mut self, now: Instant, thresholds: Thresholds) -> Option<Level> {
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
        self.raise(reached)
    }

    /// Latches a level; `Some` if it is new.
    pub fn raise(&mut self, reached: Level) -> Option<Level> {
        (reached > self.level).then(|| {
            self.level = reached;
            reached
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::{Body, Response, SpeedLimits};
    use super::*;

    fn battery(model: EnergyModel) -> Battery {
        Battery::new(Pack::new(BatteryUnits(100.0), model))
    }

    fn hover_2_s(model: EnergyModel) -> f32 {
        let mut battery = battery(model);
        (0..100).for_each(|_| battery.draw(Some(0.0), false));
        100.0 - battery.left().0
    }

    /// Units for one of ten straight cells in this wind along the course, targets 20 m apart.
    fn a_cell(model: EnergyModel, wind_mps: f64) -> f32 {
        let mut battery = battery(model);
        let mut body = Body::at([0.0, 0.0, -60.0], Response::ARDUCOPTER);
        let limits = SpeedLimits { horizontal_mps: 10.0, up_mps: 2.5, down_mps: 1.5 };
        for cell in 1..=10 {
            let target = f64::from(cell) * 20.0;
            while body.position[1] < target - 2.0 {
                body.fly_to([0.0, target, -60.0], [0.0; 3], limits);
                let air = body.velocity[1] - wind_mps;
                battery.draw(Some(air * air), false);
            }
        }
        (100.0 - battery.left().0) / 10.0
    }

    #[test]
    fn nominal_decisions_pay_for_what_they_use() {
        assert!((0.25..=0.5).contains(&hover_2_s(EnergyModel::Nominal)));
        let cell = a_cell(EnergyModel::Nominal, 0.0);
        assert!((0.85..=1.0).contains(&cell), "{cell} for 20 m");
    }

    #[test]
    fn measured_use_of_a_cell_calm_and_in_wind() {
        let calm = a_cell(EnergyModel::Measured, 0.0);
        assert!((1.13..=1.25).contains(&calm), "{calm} % a cell");
        // Half of the cells up the wind, half down it.
        let wind = 0.5 * (a_cell(EnergyModel::Measured, 8.0) + a_cell(EnergyModel::Measured, -8.0));
        assert!((1.42..=1.60).contains(&wind), "{wind} % a cell");
    }

    #[test]
    fn percent_is_truncated_and_hidden_while_unknown() {
        let mut battery = battery(EnergyModel::Nominal);
        battery.lose(BatteryUnits(0.1));
        assert_eq!(battery.percent(Instant::ZERO), 99);
        battery.hide_until(Instant::from_millis(1000));
        assert_eq!(battery.percent(Instant::from_millis(999)), -1);
        assert_eq!(battery.percent(Instant::from_millis(1000)), 99);
    }

    #[test]
    fn the_failsafe_waits_for_its_timer_and_is_latched() {
        let thresholds = Thresholds { low_v: 10.5, critical_v: 10.0, timer: Duration::from_secs(10) };
        let at = |seconds: u64| Instant::from_millis(seconds * 1000);
        let mut battery = battery(EnergyModel::Nominal);
        battery.voltage_v = 10.3;
        assert_eq!(battery.check_voltage(at(0), thresholds), None);
        battery.voltage_v = 11.0;
        assert_eq!(battery.check_voltage(at(9), thresholds), None);
        battery.voltage_v = 10.3;
        assert_eq!(battery.check_voltage(at(10), thresholds), None, "the timer restarts");
        assert_eq!(battery.check_voltage(at(20), thresholds), Some(Level::Low));
        assert_eq!(battery.check_voltage(at(21), thresholds), None, "reported once");
        battery.voltage_v = 12.6;
        assert_eq!(battery.check_voltage(at(60), thresholds), None);
        assert_eq!(battery.level, Level::Low);
        battery.voltage_v = 9.0;
        battery.check_voltage(at(61), thresholds);
        assert_eq!(battery.check_voltage(at(71), thresholds), Some(Level::Critical));
    }
}
