//! What the radio reported of the mission's devices.

use crate::{DeviceSite, Devices, MAX_DEVICES, RadioActivity};
use gleaner_policy::DeviceState;
use gleaner_radio::{Applied, DeviceTable, Reception, Remark, Report, ReportDecoder, ReportStats};
use gleaner_units::{Duration, Instant};

/// The radio's port and the table of devices behind it.
pub(super) struct Heard {
    pub(super) decoder: ReportDecoder,
    pub(super) table: DeviceTable<MAX_DEVICES>,
    activity: RadioActivity,
    reception: Reception,
}

impl Heard {
    pub(super) const fn new() -> Heard {
        let activity = RadioActivity { heard_at: None, bytes: 0, reports: 0 };
        Heard {
            decoder: ReportDecoder::new(),
            table: DeviceTable::empty(),
            activity,
            reception: Reception::new(),
        }
    }

    pub(super) fn receive(&mut self, now: Instant, bytes: &[u8]) {
        self.see(bytes);
        let Heard { decoder, table, activity, .. } = self;
        decoder.push(bytes, |report| apply(now, &report, table, activity));
    }

    /// Counts bytes that the program decodes.
    pub(super) fn see(&mut self, bytes: &[u8]) {
        let count = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        self.activity.bytes = self.activity.bytes.saturating_add(count);
        self.reception.see(bytes);
    }

    /// Calls `say` for what is wrong with the bytes and reports of the last seconds.
    pub(super) fn remarks(&mut self, now: Instant, say: impl FnMut(Remark)) {
        let RadioActivity { bytes, reports, .. } = self.activity;
        let radio = ReportStats { bytes, reports, ..ReportStats::NONE };
        self.reception.poll(now, &radio, &self.table.stats(), say);
    }

    pub(super) fn report(&mut self, now: Instant, report: &Report) {
        apply(now, report, &mut self.table, &mut self.activity);
    }

    pub(super) const fn activity(&self) -> RadioActivity {
        self.activity
    }

    /// The devices with reports older than `max_age` masked.
    pub(super) const fn at(&self, now: Instant, max_age: Duration) -> Aged<'_> {
        Aged { table: &self.table, now, max_age }
    }
}

fn apply(now: Instant, report: &Report, table: &mut DeviceTable<MAX_DEVICES>, activity: &mut RadioActivity) {
    activity.reports = activity.reports.saturating_add(1);
    if let Applied::Updated(_) = table.apply(now, report) {
        activity.heard_at = Some(now);
    }
}

/// The devices at one moment.
pub(super) struct Aged<'a> {
    table: &'a DeviceTable<MAX_DEVICES>,
    now: Instant,
    max_age: Duration,
}

impl Devices for Aged<'_> {
    fn state(&self, index: usize, site: &DeviceSite) -> DeviceState {
        DeviceState {
            cell: site.cell,
            remaining: self.table.remaining(index).unwrap_or(site.data),
            snr: self.table.snr(index, self.now, self.max_age),
        }
    }
}
