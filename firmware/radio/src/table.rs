//! The last reports of the mission's devices.

use crate::Report;
use gleaner_units::{Db, Duration, Instant};
use heapless::Vec;

/// Why a device cannot be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableError {
    /// More devices than places.
    TooMany,
    /// An id is listed twice.
    Twice(u32),
}

/// Effect of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    /// It is the newest of the device with this index.
    Updated(usize),
    /// A newer report of that device is known.
    Outdated,
    /// Its device is not part of the mission.
    Unknown,
    /// Its SNR is not finite, or its remaining amount is negative or not finite.
    BadValue,
}

/// Counters of applied reports. They stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableStats {
    /// Reports of devices that are not part of the mission.
    pub unknown: u32,
    /// Reports that arrived after a newer one of their device.
    pub outdated: u32,
    /// Reports with a number that is not allowed.
    pub bad_values: u32,
    /// Remaining amounts above the mission's figure, reduced to it.
    pub capped: u32,
    /// Remaining amounts that fell faster than slots can carry, raised to what they can.
    pub limited: u32,
}

#[derive(Clone, Copy, Debug)]
struct Measurement {
    snr: Db,
    arrived_at: Instant,
    /// Age at arrival. Kept apart, since the measurement may be older than our clock.
    age: Duration,
}

impl Measurement {
    fn age(&self, now: Instant) -> Duration {
        now.since(self.arrived_at) + self.age
    }
}

#[derive(Clone, Copy, Debug)]
struct Device {
    id: u32,
    /// Data at the start of the mission, units.
    initial: f32,
    last: Option<Measurement>,
    remaining: Option<f32>,
    /// How much `remaining` may fall now, units.
    may_fall: f32,
    /// Number of slots up to which `may_fall` counts.
    slot: u32,
}

impl Device {
    /// A slot carries at most this much: 60 dB for a whole slot, `100 log2(1 + 10^6)` (paper, eq. 6).
    const SLOT_UNITS: f32 = 2_000.0;
    /// Reports may be late by this many slots.
    const SLOTS_MAX: u32 = 2;

    const fn new(id: u32, initial: f32) -> Device {
        let may_fall = Device::SLOT_UNITS * Device::SLOTS_MAX as f32;
        Device { id, initial, last: None, remaining: None, may_fall, slot: 0 }
    }

    /// Takes over a remaining amount as far as it is possible.
    fn update_remaining(&mut self, reported: f32, slots: u32, stats: &mut TableStats) {
        let passed = slots.wrapping_sub(self.slot).min(Device::SLOTS_MAX) as f32;
        let most = Device::SLOT_UNITS * Device::SLOTS_MAX as f32;
        self.may_fall = (self.may_fall + passed * Device::SLOT_UNITS).min(most);
        self.slot = slots;
        if reported > self.initial {
            count(&mut stats.capped);
        }
        let before = self.remaining.unwrap_or(self.initial);
        let lowest = before - self.may_fall;
        if reported < lowest {
            count(&mut stats.limited);
        }
        let now = reported.min(self.initial).max(lowest);
        self.may_fall -= (before - now).max(0.0);
        self.remaining = Some(now);
    }
}

/// The devices of a mission, at most `N`, in the mission's order.
#[derive(Clone, Debug)]
pub struct DeviceTable<const N: usize> {
    devices: Vec<Device, N>,
    slots: u32,
    stats: TableStats,
}

impl<const N: usize> Default for DeviceTable<N> {
    fn default() -> DeviceTable<N> {
        DeviceTable::empty()
    }
}

impl<const N: usize> DeviceTable<N> {
    /// A table without devices.
    #[must_use]
    pub const fn empty() -> DeviceTable<N> {
        let stats = TableStats { unknown: 0, outdated: 0, bad_values: 0, capped: 0, limited: 0 };
        DeviceTable { devices: Vec::new(), slots: 0, stats }
    }

    /// Adds a device that holds `initial` data units at the start of the mission.
    ///
    /// # Errors
    /// See [`TableError`]; nothing changes.
    pub fn add(&mut self, id: u32, initial: f32) -> Result<(), TableError> {
        if self.index_of(id).is_some() {
            return Err(TableError::Twice(id));
        }
        self.devices.push(Device::new(id, initial)).map_err(|_| TableError::TooMany)
    }

    /// A slot begins: one decision. Each slot lets the remaining amounts fall by what a slot can carry, so that a single
    /// report cannot mark a device as collected.
    pub fn begin_slot(&mut self) {
        self.slots = self.slots.wrapping_add(1);
    }

    /// Takes in a report. The only place where its numbers are checked.
    pub fn apply(&mut self, now: Instant, report: &Report) -> Applied {
        let is_allowed = report.remaining.is_none_or(|units| units.is_finite() && units >= 0.0);
        if !report.snr.0.is_finite() || !is_allowed {
            count(&mut self.stats.bad_values);
            return Applied::BadValue;
        }
        let index = self.index_of(report.device);
        let Some((index, device)) = index.and_then(|index| Some((index, self.devices.get_mut(index)?)))
        else {
            count(&mut self.stats.unknown);
            return Applied::Unknown;
        };
        let age = Duration::from_millis(u64::from(report.age_ms));
        if device.last.is_some_and(|last| last.age(now) < age) {
            count(&mut self.stats.outdated);
            return Applied::Outdated;
        }
        device.last = Some(Measurement { snr: report.snr, arrived_at: now, age });
        // Without an amount, the last one stands.
        if let Some(reported) = report.remaining {
            device.update_remaining(reported, self.slots, &mut self.stats);
        }
        Applied::Updated(index)
    }

    /// Number of devices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.devices.len()
    }

    /// Whether the mission has no device.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.devices.is_empty()
    }

    /// Index of a device in the mission's order.
    #[must_use]
    pub fn index_of(&self, id: u32) -> Option<usize> {
        self.devices.iter().position(|device| device.id == id)
    }

    /// Id of the device with this index.
    #[must_use]
    pub fn id(&self, index: usize) -> Option<u32> {
        self.devices.get(index).map(|device| device.id)
    }

    /// Its last SNR, if that was measured within `max_age`.
    #[must_use]
    pub fn snr(&self, index: usize, now: Instant, max_age: Duration) -> Option<Db> {
        let last = self.devices.get(index)?.last.as_ref()?;
        (last.age(now) <= max_age).then_some(last.snr)
    }

    /// Age of its last SNR.
    #[must_use]
    pub fn age(&self, index: usize, now: Instant) -> Option<Duration> {
        Some(self.devices.get(index)?.last.as_ref()?.age(now))
    }

    /// Data units that it still holds, by its last report: finite, 0 to the initial amount; `None` if never reported.
    #[must_use]
    pub fn remaining(&self, index: usize) -> Option<f32> {
        self.devices.get(index)?.remaining
    }

    /// The counters.
    #[must_use]
    pub const fn stats(&self) -> TableStats {
        self.stats
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn report(device: u32, snr: f32, remaining: Option<f32>, age_ms: u32) -> Report {
        Report { device, snr: Db(snr), remaining, age_ms }
    }

    fn table(ids: &[u32]) -> DeviceTable<4> {
        let mut table = DeviceTable::empty();
        for &id in ids {
            table.add(id, 6_000.0).unwrap();
        }
        table
    }

    #[test]
    fn an_snr_is_masked_when_it_is_too_old() {
        let mut table = table(&[10, 20]);
        let at = Instant::from_millis;
        assert_eq!(table.apply(at(1_000), &report(20, 3.0, Some(5_000.0), 4_000)), Applied::Updated(1));
        let max_age = Duration::from_secs(10);
        assert_eq!(table.snr(1, at(7_000), max_age), Some(Db(3.0)), "measured before our clock started");
        assert_eq!(table.snr(1, at(7_001), max_age), None);
        assert_eq!(table.age(1, at(2_000)), Some(Duration::from_secs(5)));
        assert_eq!(table.remaining(1), Some(5_000.0), "the amount does not age");
        assert_eq!((table.snr(0, at(1_000), max_age), table.remaining(0)), (None, None));
        assert_eq!(table.snr(2, at(1_000), max_age), None);
    }

    #[test]
    fn older_and_foreign_reports_change_nothing() {
        let mut table = table(&[10]);
        let now = Instant::from_millis(60_000);
        table.apply(now, &report(10, 3.0, Some(5_000.0), 100));
        assert_eq!(table.apply(now, &report(10, 9.0, Some(5_500.0), 5_000)), Applied::Outdated);
        assert_eq!(table.apply(now, &report(11, 9.0, None, 0)), Applied::Unknown);
        assert_eq!(table.snr(0, now, Duration::from_secs(1)), Some(Db(3.0)));
        assert_eq!(table.apply(now, &report(10, 4.0, None, 0)), Applied::Updated(0));
        assert_eq!(table.remaining(0), Some(5_000.0));
        assert_eq!(table.stats(), TableStats { unknown: 1, outdated: 1, ..TableStats::default() });
    }

    #[test]
    fn bad_numbers_are_counted_by_their_own_reason() {
        let mut table = table(&[10]);
        let now = Instant::ZERO;
        for snr in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(table.apply(now, &report(10, snr, None, 0)), Applied::BadValue);
        }
        for remaining in [f32::NAN, f32::INFINITY, -0.5] {
            assert_eq!(table.apply(now, &report(10, 1.0, Some(remaining), 0)), Applied::BadValue);
        }
        assert_eq!((table.remaining(0), table.age(0, now)), (None, None));
        assert_eq!(table.stats(), TableStats { bad_values: 6, ..TableStats::default() });
    }

    #[test]
    fn the_mission_caps_the_remaining_amount() {
        let mut table = table(&[10]);
        table.apply(Instant::ZERO, &report(10, 1.0, Some(3e38), 0));
        assert_eq!((table.remaining(0), table.stats().capped), (Some(6_000.0), 1));
    }

    #[test]
    fn an_amount_falls_by_what_slots_carry() {
        let mut table = table(&[10]);
        let mut lie = |slots: u32, reports: u32| {
            (0..slots).for_each(|_| table.begin_slot());
            (0..reports).for_each(|_| {
                table.apply(Instant::ZERO, &report(10, 1.0, Some(0.0), 0));
            });
            (table.remaining(0).unwrap(), table.stats().limited)
        };
        assert_eq!(lie(0, 5), (2_000.0, 5), "two slots at once");
        assert_eq!(lie(1, 1), (0.0, 5));
    }

    #[test]
    fn a_slot_that_carries_its_most_is_not_limited() {
        let mut table = table(&[10]);
        for remaining in [6_000.0, 4_500.0, 2_700.0, 700.0, 0.0] {
            table.apply(Instant::ZERO, &report(10, 1.0, Some(remaining), 0));
            assert_eq!(table.remaining(0), Some(remaining));
            table.begin_slot();
        }
        assert_eq!(table.stats(), TableStats::default());
    }

    #[test]
    fn too_many_devices_and_double_ids_are_refused() {
        let mut table = table(&[1, 2, 3]);
        assert_eq!(table.add(2, 1.0), Err(TableError::Twice(2)));
        assert_eq!(table.add(4, 1.0), Ok(()));
        assert_eq!(table.add(5, 1.0), Err(TableError::TooMany));
    }

    proptest! {
        #![proptest_config(crate::seeded())]

        #[test]
        fn no_reports_leave_an_impossible_value(
            reports in proptest::collection::vec((0u32..6, any::<f32>(), any::<Option<f32>>(), any::<u32>(), 0u64..5_000), 0..400)
        ) {
            let mut table = table(&[0, 1, 2, 3]);
            let mut now_ms = 0;
            for (device, snr, remaining, age_ms, wait_ms) in reports {
                now_ms += wait_ms;
                table.apply(Instant::from_millis(now_ms), &report(device, snr, remaining, age_ms));
                for index in 0..table.len() {
                    let now = Instant::from_millis(now_ms);
                    prop_assert!(table.snr(index, now, Duration::from_secs(1_000_000)).is_none_or(|snr| snr.0.is_finite()));
                    prop_assert!(table.remaining(index).is_none_or(|units| (0.0..=6_000.0).contains(&units)));
                }
            }
        }
    }
}
