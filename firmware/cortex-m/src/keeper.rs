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
