//! Paired timing.

use std::time::Instant;

/// Microseconds a call, one number for each repetition.
pub(super) struct Times(Vec<f64>);

impl Times {
    /// Times that a peer measured, microseconds.
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
        quantile(&self.0, 0.5)
    }

    /// `12.3 us (minimum 11.8)`.
    pub fn text(&self) -> String {
        let (median, minimum) = (self.median(), self.minimum());
        if median < 1.0 {
            format!("{:.0} ns (minimum {:.0})", median * 1e3, minimum * 1e3)
        } else {
            format!("{median:.1} us (minimum {minimum:.1})")
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

/// Name, and one call.
pub(super) type Contender<'a> = (&'static str, Box<dyn FnMut() + 'a>);

/// Times all contenders in turns: `repetitions` rounds of `calls` calls each.
pub(super) fn in_turns(contenders: &mut [Contender<'_>], repetitions: usize, calls: usize) -> Vec<Times> {
    let mut times: Vec<Times> = contenders.iter().map(|_| Times(Vec::new())).collect();
    for _ in 0..repetitions {
        for ((_, call), times) in contenders.iter_mut().zip(&mut times) {
            let start = Instant::now();
            for _ in 0..calls {
                call();
            }
            times.0.push(start.elapsed().as_secs_f64() * 1e6 / calls as f64);
        }
    }
    times
}
