//! Seeds of all random draws.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Seed of one realization or one episode.
///
/// The number and the repeat are the key of a ChaCha generator with 8 rounds. The purpose of a draw is the generator's
/// stream number: training layout 0, slots 1, choices 2; evaluation layout 3, slots 4, choices 5; cities 6. Training and
/// evaluation therefore never share a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Seed {
    evaluation: bool,
    number: u64,
    repeat: u32,
}

/// Purpose of random draws. Each has its own stream, so that more draws for one do not shift those for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Cells and data of the devices.
    Layout,
    /// Shadowing and fading during the flight.
    Slots,
    /// Draws of the policy: exploration, random paths.
    Choices,
}

impl Seed {
    /// A seed for training.
    #[must_use]
    pub const fn training(number: u64) -> Seed {
        Seed { evaluation: false, number, repeat: 0 }
    }

    /// A seed for evaluation. Published figures use the numbers 0 to 99.
    #[must_use]
    pub const fn evaluation(number: u64) -> Seed {
        Seed { evaluation: true, number, repeat: 0 }
    }

    /// The same seed for another flight of its realization: other shadowing. The plain seed is repeat 0.
    #[must_use]
    pub const fn repeat(self, repeat: u32) -> Seed {
        Seed { repeat, ..self }
    }

    /// Its number.
    #[must_use]
    pub const fn number(self) -> u64 {
        self.number
    }

    /// The generator for one purpose.
    #[must_use]
    pub fn rng(self, stream: Stream) -> ChaCha8Rng {
        let base = if self.evaluation { 3 } else { 0 };
        keyed(self.number, self.repeat, base + stream as u64)
    }
}

/// The generator of random cities.
pub(crate) fn city_rng(number: u64) -> ChaCha8Rng {
    keyed(number, 0, 6)
}

fn keyed(number: u64, repeat: u32, stream: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&number.to_le_bytes());
    key[8..12].copy_from_slice(&repeat.to_le_bytes());
    let mut rng = ChaCha8Rng::from_seed(key);
    rng.set_stream(stream);
    rng
}

/// Uniform in (0, 1): never 0, so that its logarithm is finite.
pub(crate) fn open_unit(rng: &mut impl Rng) -> f32 {
    ((rng.next_u32() >> 8) as f32 + 0.5) / 16_777_216.0
}

/// Uniform in 0..count. `count` must not be 0.
pub(crate) fn below(rng: &mut impl Rng, count: u32) -> u32 {
    rng.random_range(0..count)
}

/// Two independent standard normal numbers (Box and Muller), at most 5.9 from zero.
pub(crate) fn normal_pair(rng: &mut impl Rng) -> (f32, f32) {
    let radius = libm::sqrtf(-2.0 * libm::logf(open_unit(rng)));
    let (sine, cosine) = libm::sincosf(core::f32::consts::TAU * open_unit(rng));
    (radius * cosine, radius * sine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_repeat_and_stream_is_another_sequence() {
        let mut firsts = Vec::new();
        for number in 0..20 {
            for repeat in 0..5 {
                for stream in [Stream::Layout, Stream::Slots, Stream::Choices] {
                    for seed in [Seed::training(number), Seed::evaluation(number)] {
                        firsts.push(seed.repeat(repeat).rng(stream).next_u64());
                    }
                }
            }
            firsts.push(city_rng(number).next_u64());
        }
        let count = firsts.len();
        firsts.sort_unstable();
        firsts.dedup();
        assert_eq!(firsts.len(), count);
    }

    #[test]
    fn normals_have_mean_0_variance_1_and_the_right_tails() {
        let mut rng = Seed::training(1).rng(Stream::Slots);
        let draws: Vec<f64> = (0..200_000)
            .flat_map(|_| {
                let (a, b) = normal_pair(&mut rng);
                [f64::from(a), f64::from(b)]
            })
            .collect();
        let count = draws.len() as f64;
        let mean = draws.iter().sum::<f64>() / count;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / count - mean * mean;
        let beyond = |limit: f64| draws.iter().filter(|x| x.abs() > limit).count() as f64 / count;
        let product = draws.chunks(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (count / 2.0);
        assert!(mean.abs() < 0.006, "{mean}");
        assert!((variance - 1.0).abs() < 0.008, "{variance}");
        assert!((beyond(1.0) - 0.3173).abs() < 0.003, "{}", beyond(1.0));
        assert!((beyond(3.0) - 0.0027).abs() < 0.0004, "{}", beyond(3.0));
        assert!(product.abs() < 0.008, "{product}");
    }
}
