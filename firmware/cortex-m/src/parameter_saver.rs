//! Decides when changed parameters are written to flash.

use crate::{ParameterStore, Restored, SaveError};
use core::fmt;
use embedded_storage::nor_flash::NorFlash;
use gleaner_link::Severity;
use gleaner_pilot::{Enable, ParameterId, Parameters, State};
use gleaner_units::{Duration, Instant};

/// Parameters are saved when they have not changed for this long.
const SETTLED_AFTER: Duration = Duration::from_secs(2);

/// Saves the parameters two seconds after the last change. Writing a record into an erased slot takes a quarter of a
/// millisecond and is allowed in flight. Erasing a sector stops the processor for up to half a second and is allowed
/// only while Gleaner commands nothing.
pub struct ParameterSaver<F> {
    store: ParameterStore<F>,
    saved: Parameters,
    seen: Parameters,
    seen_at: Instant,
    refused: bool,
}

/// A message for the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveNotice {
    /// The last change before the reset was lost.
    ChangeLost,
    /// The saved parameters are damaged; the defaults apply.
    Damaged,
    /// The flash refused to write; changes last until the next reset only.
    NotSaved,
}

impl SaveNotice {
    /// Severity of the `STATUSTEXT`.
    #[must_use]
    pub const fn severity(self) -> Severity {
        Severity::Warning
    }
}

impl fmt::Display for SaveNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SaveNotice::ChangeLost => "gleaner: last parameter change was lost",
            SaveNotice::Damaged => "gleaner: parameters damaged, defaults hold",
            SaveNotice::NotSaved => "gleaner: parameters not saved, flash refuses",
        })
    }
}

impl<F: NorFlash> ParameterSaver<F> {
    /// Restores the saved parameters; also returns a notice when something was lost.
    pub fn open(flash: F) -> (ParameterSaver<F>, Option<SaveNotice>) {
        let (store, parameters, found) = ParameterStore::open(flash);
        let notice = match found {
            Restored::Nothing | Restored::Saved => None,
            Restored::Older => Some(SaveNotice::ChangeLost),
            Restored::Damaged => Some(SaveNotice::Damaged),
        };
        let seen = parameters.clone();
        (ParameterSaver { store, saved: parameters, seen, seen_at: Instant::ZERO, refused: false }, notice)
    }

    /// The parameters as they are in flash.
    #[must_use]
    pub const fn saved(&self) -> &Parameters {
        &self.saved
    }

    /// Compares the parameters with the saved ones and saves them when due. Call it from the decision loop.
    pub fn poll(&mut self, now: Instant, parameters: &Parameters, state: State) -> Option<SaveNotice> {
        let mut wanted = parameters.clone();
        // The value 0 is in range.
        let _ = wanted.set_id(ParameterId::Enable, Enable::Off.value());
        if wanted != self.seen {
            (self.seen, self.seen_at, self.refused) = (wanted, now, false);
            return None;
        }
        if self.seen == self.saved || self.refused || now.since(self.seen_at) < SETTLED_AFTER {
            return None;
        }
        let may_erase = matches!(state, State::Idle | State::Done | State::Passive | State::Fault);
        match self.store.save(&self.seen, may_erase) {
            Ok(()) => self.saved = self.seen.clone(),
            Err(SaveError::Full) => {}
            Err(SaveError::Flash) => {
                // No retry until the next change: each attempt may wear the flash.
                self.refused = true;
                return Some(SaveNotice::NotSaved);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Double;

    fn with_speed(speed: f32) -> Parameters {
        let mut parameters = Parameters::default();
        parameters.set_id(ParameterId::Speed, speed).unwrap();
        parameters.set_id(ParameterId::Enable, 1.0).unwrap();
        parameters
    }

    /// Polls for two seconds from `at`, at the rate of the decision loop.
    fn settle(saver: &mut ParameterSaver<Double>, at: u64, speed: f32, state: State) -> Option<SaveNotice> {
        let parameters = with_speed(speed);
        (0..=101)
            .filter_map(|tick| saver.poll(Instant::from_millis(at + tick * 20), &parameters, state))
            .last()
    }

    #[test]
    fn a_settled_change_is_saved_and_an_engage_request_never() {
        let double = Double::new();
        let (mut saver, notice) = ParameterSaver::open(double.clone());
        assert_eq!(notice, None);
        for turn in 0..50_u64 {
            let speed = 2.0 + turn as f32 / 10.0;
            assert_eq!(saver.poll(Instant::from_millis(turn * 100), &with_speed(speed), State::Idle), None);
        }
        assert_eq!(double.operations(), 0, "still changing");
        assert_eq!(settle(&mut saver, 5_000, 8.0, State::Idle), None);
        let operations = double.operations();
        assert!(operations > 0);
        assert_eq!(settle(&mut saver, 10_000, 8.0, State::Idle), None);
        assert_eq!(double.operations(), operations, "once");
        let (again, _) = ParameterSaver::open(double);
        assert_eq!((again.saved().speed().0, again.saved().enable()), (8.0, Enable::Off));
    }

    #[test]
    fn no_sector_is_erased_in_flight_and_no_change_is_lost() {
        let double = Double::new();
        let (mut saver, _) = ParameterSaver::open(double.clone());
        for (minute, speed) in [(0, 2.0), (1, 3.0), (2, 4.0), (3, 5.0)] {
            settle(&mut saver, minute * 60_000, speed, State::Idle);
        }
        let operations = double.operations();
        assert_eq!(settle(&mut saver, 300_000, 6.0, State::Engaged), None);
        assert_eq!(double.operations(), operations, "the sector is full");
        assert_eq!(settle(&mut saver, 400_000, 6.0, State::Done), None);
        assert_eq!(ParameterSaver::open(double).0.saved().speed().0, 6.0);
    }

    #[test]
    fn a_refusing_flash_is_reported_once_per_change() {
        let double = Double::new();
        let (mut saver, _) = ParameterSaver::open(double.clone());
        double.power_for(Some(0));
        assert_eq!(settle(&mut saver, 0, 2.0, State::Idle), Some(SaveNotice::NotSaved));
        let operations = double.operations();
        assert_eq!(settle(&mut saver, 60_000, 2.0, State::Idle), None);
        assert_eq!(double.operations(), operations);
        assert_eq!(settle(&mut saver, 120_000, 3.0, State::Idle), Some(SaveNotice::NotSaved));
        assert!(
            [SaveNotice::ChangeLost, SaveNotice::Damaged, SaveNotice::NotSaved]
                .iter()
                .all(|notice| std::format!("{notice}").len() <= 50)
        );
    }
}
