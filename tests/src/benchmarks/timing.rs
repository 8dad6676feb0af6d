//! Paired timing.

use super::peer::Peer;
use anyhow::Result;
use std::cell::RefCell;
use std::time::Instant;

/// Microseconds a call, one number for each repetition.
pub(super) struct Times(Vec<f64>);

impl Times {
    /// Measured times, microseconds.
    pub fn from_micros(micros: Vec<f64>) -> Times {
        Times(micros)
    }

    /// Divides each time by the number of items that a call processes.
    pub fn divide(&mut self, items: f64) {
        self.0.iter_mut().for_each(|time| *time /= items);
    }

    /// The smallest.
    pub fn minimum(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The median.
    pub fn median(&self) -> f64 {
        self.quantile(0.5)
    }

    /// The time that this share of the repetitions does not exceed.
    pub fn quantile(&self, at: f64) -> f64 {
        quantile(&self.0, at)
    }

    /// `12.3 us (minimum 11.8)`.
    pub fn text(&self) -> String {
        let (median, minimum) = (self.median(), self.minimum());
        if median < 1.0 {
            format!("{:.0} ns (minimum {:.0})", median * 1e3, minimum * 1e3)
        } else if median < 1e4 {
            format!("{median:.1} us (minimum {minimum:.1})")
        } else {
            format!("{:.1} ms (minimum {:.1})", median / 1e3, minimum / 1e3)
        }
    }

    /// Median and quartiles of peer / ours, repetition by repetition: `3.5 (3.4..3.6)`.
    pub fn ratio(&self, peer: &Times) -> String {
        let ratios: Vec<f64> = peer.0.iter().zip(&self.0).map(|(peer, ours)| peer / ours).collect();
        let [low, median, high] = [0.25, 0.5, 0.75].map(|at| quantile(&ratios, at));
        format!("{median:.2} ({low:.2}..{high:.2})")
    }
}

fn quantile(numbers: &[f64], at: f64) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = (sorted.len().saturating_sub(1)) as f64 * at;
    sorted.get(index as usize).copied().unwrap_or(f64::NAN)
}

/// One round of a contender: microseconds per call.
type Round<'a> = Box<dyn FnMut() -> Result<f64> + 'a>;

/// Something that is timed in turns with others.
pub(super) struct Contender<'a> {
    /// Its name in the table.
    pub name: &'static str,
    round: Round<'a>,
}

impl<'a> Contender<'a> {
    /// Our own code: `calls` calls per round.
    pub fn ours(name: &'static str, calls: usize, mut call: impl FnMut() + 'a) -> Contender<'a> {
        let round = move || {
            let start = Instant::now();
            for _ in 0..calls {
                call();
            }
            Ok(start.elapsed().as_secs_f64() * 1e6 / calls as f64)
        };
        Contender { name, round: Box::new(round) }
    }

    /// A contender of a peer.
    pub fn peer(name: &'static str, peer: &'a RefCell<Peer>, contender: String) -> Contender<'a> {
        Contender { name, round: Box::new(move || peer.borrow_mut().round(&contender)) }
    }
}

/// Times all contenders in turns, in this many rounds.
pub(super) fn in_turns(contenders: &mut [Contender<'_>], rounds: usize) -> Result<Vec<Times>> {
    let mut times: Vec<Times> = contenders.iter().map(|_| Times(Vec::new())).collect();
    for _ in 0..rounds {
        for (contender, times) in contenders.iter_mut().zip(&mut times) {
            times.0.push((contender.round)()?);
        }
    }
    Ok(times)
}
