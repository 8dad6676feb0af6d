//! Faults of the radio's reports.

use gleaner_radio::Report;
use gleaner_units::{Db, Duration, Instant};
use std::fmt;

/// A fault of the radio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RadioFault {
    /// No reports.
    Silent,
    /// Reports are this many seconds old.
    Stale(u32),
    /// Every report arrives this many times.
    Repeated(u8),
    /// Reports claim that the devices are empty.
    LyingEmpty,
    /// Reports claim more data than a number can hold.
    LyingFull,
    /// Reports claim a strong signal from every device.
    LyingStrong,
    /// Every round contains this many reports of devices that are not in the mission.
    Unknown(u8),
}

impl fmt::Display for RadioFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RadioFault::Silent => write!(f, "the radio is silent"),
            RadioFault::Stale(age_s) => write!(f, "radio reports are {age_s} s old"),
            RadioFault::Repeated(times) => write!(f, "radio reports arrive {times} times"),
            RadioFault::LyingEmpty => write!(f, "radio reports claim empty devices"),
            RadioFault::LyingFull => write!(f, "radio reports claim 3e38 data units"),
            RadioFault::LyingStrong => write!(f, "radio reports claim 40 dB everywhere"),
            RadioFault::Unknown(count) => write!(f, "the radio reports {count} unknown devices"),
        }
    }
}

/// The fault in force, if any.
#[derive(Debug, Default)]
pub(crate) struct RadioFaults(Option<(RadioFault, Instant)>);

impl RadioFaults {
    pub fn begin(&mut self, now: Instant, fault: RadioFault, lasts: Duration) {
        self.0 = Some((fault, now + lasts));
    }

    /// The reports as they arrive.
    pub fn distort(&self, now: Instant, mut reports: Vec<Report>) -> Vec<Report> {
        let Some((fault, _)) = self.0.filter(|(_, until)| now < *until) else { return reports };
        match fault {
            RadioFault::Silent => reports.clear(),
            RadioFault::Stale(age_s) => reports.iter_mut().for_each(|r| r.age_ms = age_s * 1000),
            RadioFault::Repeated(times) => {
                let once = reports.clone();
                (1..times).for_each(|_| reports.extend(once.iter().cloned()));
            }
            RadioFault::LyingEmpty => reports.iter_mut().for_each(|r| r.remaining = Some(0.0)),
            RadioFault::LyingFull => reports.iter_mut().for_each(|r| r.remaining = Some(3e38)),
            RadioFault::LyingStrong => reports.iter_mut().for_each(|r| r.snr = Db(40.0)),
            RadioFault::Unknown(count) => {
                if let Some(first) = reports.first().copied() {
                    reports.extend((0..count).map(|n| Report { device: 500 + u32::from(n), ..first }));
                }
            }
        }
        reports
    }
}
