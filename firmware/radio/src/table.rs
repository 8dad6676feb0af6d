//! What was last heard of each device of the mission.

use crate::Report;
use gleaner_units::{Db, Duration, Instant};
use heapless::Vec;

/// Why a table cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableError {
    /// More devices than places.
    TooMany,
    /// An id is listed twice.
    Twice(u32),
}

/// What a report did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    /// It is the newest of the device with this index.
    Updated(usize),
    /// Something newer of that device was known already.
    Outdated,
    /// Its device is not of this mission.
    Unknown,
}

#[derive(Clone, Copy, Debug)]
struct Heard {
    snr: Db,
    arrived_at: Instant,
    /// Age at arrival. Kept apart, since the measurement may lie before the start of our clock.
    age: Duration,
}

impl Heard {
    fn age(&self, now: Instant) -> Duration {
        now.since(self.arrived_at) + self.age
    }
}

#[derive(Clone, Copy, Debug)]
struct Device {
    id: u32,
    heard: Option<Heard>,
    remaining: Option<f32>,
}

/// The devices of a mission, at most `N`, in the mission's order.
#[derive(Clone, Debug)]
pub struct DeviceTable<const N: usize> {
    devices: Vec<Device, N>,
    unknown_reports: u32,
    outdated_reports: u32,
}

impl<const N: usize> DeviceTable<N> {
    /// A table of these ids of which nothing was heard.
    ///
    /// # Errors
    /// See [`TableError`].
    pub fn new(ids: &[u32]) -> Result<DeviceTable<N>, TableError> {
        let mut table = DeviceTable::empty();
        for &id in ids {
            table.add(id)?;
        }
        Ok(table)
    }

    /// A table without devices.
    #[must_use]
    pub const fn empty() -> DeviceTable<N> {
        DeviceTable { devices: Vec::new(), unknown_reports: 0, outdated_reports: 0 }
    }

    /// One more device, of which nothing was heard.
    ///
    /// # Errors
    /// See [`TableError`]; nothing changes.
    pub fn add(&mut self, id: u32) -> Result<(), TableError> {
        if self.index_of(id).is_some() {
            return Err(TableError::Twice(id));
        }
        self.devices.push(Device { id, heard: None, remaining: None }).map_err(|_| TableError::TooMany)
    }

    /// Takes in a report. Values that [`crate::decode_body`] would refuse are taken for an unknown device.
    pub fn apply(&mut self, now: Instant, report: &Report) -> Applied {
        let is_sound = report.snr.0.is_finite();
        let index = self.index_of(report.device).filter(|_| is_sound);
        let Some((index, device)) = index.and_then(|index| Some((index, self.devices.get_mut(index)?)))
        else {
            self.unknown_reports = self.unknown_reports.saturating_add(1);
            return Applied::Unknown;
        };
        let age = Duration::from_millis(u64::from(report.age_ms));
        if device.heard.is_some_and(|heard| heard.age(now) < age) {
            self.outdated_reports = self.outdated_reports.saturating_add(1);
            return Applied::Outdated;
        }
        device.heard = Some(Heard { snr: report.snr, arrived_at: now, age });
        // A device that does not tell has not changed what it told before.
        let told = report.remaining.filter(|units| units.is_finite()).map(|units| units.max(0.0));
        device.remaining = told.or(device.remaining);
        Applied::Updated(index)
    }

    /// How many devices there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.devices.len()
    }

    /// Whether the mission has no device.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.devices.is_empty()
    }

    /// The place of a device in the mission's order.
    #[must_use]
    pub fn index_of(&self, id: u32) -> Option<usize> {
        self.devices.iter().position(|device| device.id == id)
    }

    /// The id of the device at a place.
    #[must_use]
    pub fn id(&self, index: usize) -> Option<u32> {
        self.devices.get(index).map(|device| device.id)
    }

    /// Its last SNR, if that was measured within `max_age`.
    #[must_use]
    pub fn snr(&self, index: usize, now: Instant, max_age: Duration) -> Option<Db> {
        let heard = self.devices.get(index)?.heard.as_ref()?;
        (heard.age(now) <= max_age).then_some(heard.snr)
    }

    /// How long ago its last SNR was measured.
    #[must_use]
    pub fn age(&self, index: usize, now: Instant) -> Option<Duration> {
        Some(self.devices.get(index)?.heard.as_ref()?.age(now))
    }

    /// Data units that it last told to hold: finite, not negative; `None` if it never told.
    #[must_use]
    pub fn remaining(&self, index: usize) -> Option<f32> {
        self.devices.get(index)?.remaining
    }

    /// Reports of devices that are not of this mission.
    #[must_use]
    pub const fn unknown_reports(&self) -> u32 {
        self.unknown_reports
    }

    /// Reports that came after a newer one of their device.
    #[must_use]
    pub const fn outdated_reports(&self) -> u32 {
        self.outdated_reports
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn report(device: u32, snr: f32, remaining: Option<f32>, age_ms: u32) -> Report {
        Report { device, snr: Db(snr), remaining, age_ms }
    }

    #[test]
    fn an_snr_is_masked_when_it_is_too_old() {
        let mut table = DeviceTable::<4>::new(&[10, 20]).unwrap();
        let at = Instant::from_millis;
        assert_eq!(table.apply(at(1_000), &report(20, 3.0, Some(50.0), 4_000)), Applied::Updated(1));
        let max_age = Duration::from_secs(10);
        assert_eq!(table.snr(1, at(7_000), max_age), Some(Db(3.0)), "measured before our clock started");
        assert_eq!(table.snr(1, at(7_001), max_age), None);
        assert_eq!(table.age(1, at(2_000)), Some(Duration::from_secs(5)));
        assert_eq!(table.remaining(1), Some(50.0), "what it holds does not fade");
        assert_eq!((table.snr(0, at(1_000), max_age), table.remaining(0)), (None, None));
        assert_eq!(table.snr(2, at(1_000), max_age), None);
    }

    #[test]
    fn older_and_foreign_reports_change_nothing() {
        let mut table = DeviceTable::<4>::new(&[10]).unwrap();
        let now = Instant::from_millis(60_000);
        table.apply(now, &report(10, 3.0, Some(50.0), 100));
        assert_eq!(table.apply(now, &report(10, 9.0, Some(80.0), 5_000)), Applied::Outdated);
        assert_eq!(table.apply(now, &report(11, 9.0, None, 0)), Applied::Unknown);
        assert_eq!(table.snr(0, now, Duration::from_secs(1)), Some(Db(3.0)));
        assert_eq!(table.apply(now, &report(10, 4.0, None, 0)), Applied::Updated(0));
        assert_eq!(table.remaining(0), Some(50.0));
        assert_eq!((table.unknown_reports(), table.outdated_reports()), (1, 1));
    }

    #[test]
    fn impossible_missions_are_refused() {
        assert_eq!(DeviceTable::<2>::new(&[1, 2, 3]).unwrap_err(), TableError::TooMany);
        assert_eq!(DeviceTable::<4>::new(&[1, 2, 1]).unwrap_err(), TableError::Twice(1));
    }

    proptest! {
        #![proptest_config(crate::seeded())]

        #[test]
        fn no_flood_leaves_an_odd_value(
            reports in proptest::collection::vec((0u32..6, any::<f32>(), any::<Option<f32>>(), any::<u32>(), 0u64..5_000), 0..400)
        ) {
            let mut table = DeviceTable::<4>::new(&[0, 1, 2, 3]).unwrap();
            let mut now_ms = 0;
            for (device, snr, remaining, age_ms, wait_ms) in reports {
                now_ms += wait_ms;
                table.apply(Instant::from_millis(now_ms), &report(device, snr, remaining, age_ms));
                for index in 0..table.len() {
                    let now = Instant::from_millis(now_ms);
                    prop_assert!(table.snr(index, now, Duration::from_secs(1_000_000)).is_none_or(|snr| snr.0.is_finite()));
                    prop_assert!(table.remaining(index).is_none_or(|units| units.is_finite() && units >= 0.0));
                }
            }
        }
    }
}
