//! When the parameters are saved.

use crate::{Found, ParameterStore, SaveError};
use core::fmt;
use embedded_storage::nor_flash::NorFlash;
use gleaner_link::Severity;
use gleaner_pilot::{Enable, ParameterId, Parameters, State};
use gleaner_units::{Duration, Instant};

/// A value that is still being turned is not saved yet.
const SETTLED_AFTER: Duration = Duration::from_secs(2);

/// Saves the parameters some time after they changed: a record as soon as there is an erased slot, also in flight
/// (a quarter of a millisecond); a sector is erased only while nothing is commanded, because that stops the processor
/// for up to half a second.
pub struct Keeper<F> {
    store: ParameterStore<F>,
    saved: Parameters,
    seen: Parameters,
    seen_at: Instant,
    refused: bool,
}

/// What the operator should know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// The last change before the reset was lost.
    ChangeLost,
    /// What was saved is damaged; the defaults hold.
    Damaged,
    /// The flash refuses; changes hold until the next reset only.
    NotSaved,
}

impl News {
    /// How bad it is.
    #[must_use]
    pub const fn severity(self) -> Severity {
        Severity::Warning
    }
}

impl fmt::Display for News {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            News::ChangeLost => "gleaner: last parameter change was lost",
            News::Damaged => "gleaner: parameters damaged, defaults hold",
            News::NotSaved => "gleaner: parameters not saved, flash refuses",
        })
    }
}

impl<F: NorFlash> Keeper<F> {
    /// Reads what was saved, and what there is to say about it.
    pub fn open(flash: F) -> (Keeper<F>, Option<News>) {
        let (store, parameters, found) = ParameterStore::open(flash);
        let news = match found {
            Found::Nothing | Found::Saved => None,
            Found::Older => Some(News::ChangeLost),
            Found::Damaged => Some(News::Damaged),
        };
        let seen = parameters.clone();
        (Keeper { store, saved: parameters, seen, seen_at: Instant::ZERO, refused: false }, news)
    }

    /// The parameters that hold after the last reset.
    #[must_use]
    pub const fn saved(&self) -> &Parameters {
        &self.saved
    }

    /// One look at the parameters, from the decision loop.
    pub fn poll(&mut self, now: Instant, parameters: &Parameters, state: State) -> Option<News> {
        let mut wanted = parameters.clone();
        // 0 is in the parameter's range.
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
                // Once, until the next change: each try may wear the flash.
                self.refused = true;
                return Some(News::NotSaved);
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

    /// Two seconds and a bit after `at`, at the rate of the decision loop.
    fn settle(keeper: &mut Keeper<Double>, at: u64, speed: f32, state: State) -> Option<News> {
        let parameters = with_speed(speed);
        (0..=101)
            .filter_map(|tick| keeper.poll(Instant::from_millis(at + tick * 20), &parameters, state))
            .last()
    }

    #[test]
    fn a_change_is_saved_when_it_has_settled_and_the_request_to_engage_never_is() {
        let double = Double::new();
        let (mut keeper, news) = Keeper::open(double.clone());
        assert_eq!(news, None);
        for turn in 0..50_u64 {
            let speed = 2.0 + turn as f32 / 10.0;
            assert_eq!(keeper.poll(Instant::from_millis(turn * 100), &with_speed(speed), State::Idle), None);
        }
        assert_eq!(double.operations(), 0, "still being turned");
        assert_eq!(settle(&mut keeper, 5_000, 8.0, State::Idle), None);
        let operations = double.operations();
        assert!(operations > 0);
        assert_eq!(settle(&mut keeper, 10_000, 8.0, State::Idle), None);
        assert_eq!(double.operations(), operations, "once");
        let (again, _) = Keeper::open(double);
        assert_eq!((again.saved().speed().0, again.saved().enable()), (8.0, Enable::Off));
    }

    #[test]
    fn in_flight_no_sector_is_erased_and_afterwards_the_change_is_kept_all_the_same() {
        let double = Double::new();
        let (mut keeper, _) = Keeper::open(double.clone());
        for (minute, speed) in [(0, 2.0), (1, 3.0), (2, 4.0), (3, 5.0)] {
            settle(&mut keeper, minute * 60_000, speed, State::Idle);
        }
        let operations = double.operations();
        assert_eq!(settle(&mut keeper, 300_000, 6.0, State::Engaged), None);
        assert_eq!(double.operations(), operations, "the sector is full");
        assert_eq!(settle(&mut keeper, 400_000, 6.0, State::Done), None);
        assert_eq!(Keeper::open(double).0.saved().speed().0, 6.0);
    }

    #[test]
    fn a_flash_that_refuses_is_said_once_for_each_change() {
        let double = Double::new();
        let (mut keeper, _) = Keeper::open(double.clone());
        double.power_for(Some(0));
        assert_eq!(settle(&mut keeper, 0, 2.0, State::Idle), Some(News::NotSaved));
        let operations = double.operations();
        assert_eq!(settle(&mut keeper, 60_000, 2.0, State::Idle), None);
        assert_eq!(double.operations(), operations);
        assert_eq!(settle(&mut keeper, 120_000, 3.0, State::Idle), Some(News::NotSaved));
        assert!(
            [News::ChangeLost, News::Damaged, News::NotSaved]
                .iter()
                .all(|news| std::format!("{news}").len() <= 50)
        );
    }
}
