//! The oracle: the best tours that a planner with full knowledge of map, channel and devices finds. Its results are a
//! tight lower bound of the optimum.

use crate::env::flight::Reward;
use crate::judge::evaluation::{Missions, test_preferences};
use crate::planner::{Effort, Problem, Rates, Tour, W_DATA_MAX, initial_state};
use gleaner_lookahead::Model;
use gleaner_world::Realization;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// The oracle in one setting: a line of the file that `gleaner-train oracle` writes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OracleSetting {
    /// `rd` or `rb`.
    pub scenario: String,
    /// Number of devices, K.
    pub devices: usize,
    /// Battery units at the start, B.
    pub battery: u16,
    /// Realizations 0 to N - 1.
    pub realizations: u64,
    /// Expected results of the best tours.
    pub missions: Missions,
    /// Upper bound on the data at w = (1, 0), percent, for the first realizations; empty if it was not computed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub upper_bound_percent: Vec<f32>,
    /// Nodes of each bound's branch-and-bound tree.
    #[serde(default, skip_serializing_if = "is_none")]
    pub bound_parts: u32,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
const fn is_none(count: &u32) -> bool {
    *count == 0
}

impl OracleSetting {
    /// The same of the first `count` realizations; `None` if there are fewer.
    #[must_use]
    pub fn first(&self, count: u64) -> Option<OracleSetting> {
        let len = usize::try_from(count).ok()?;
        let missions: Option<_> = self.missions.0.iter().map(|all| Some(all.get(..len)?.to_vec())).collect();
        Some(OracleSetting {
            realizations: count,
            missions: Missions(missions?),
            // Means over other realizations are not comparable.
            upper_bound_percent: self.upper_bound_percent.get(..len).unwrap_or_default().to_vec(),
            ..self.clone()
        })
    }
}

/// Effort for the best tour of a mission under one preference. There are two searches: from scratch, and from the best tour
/// of the previous preference.
#[derive(Clone, Copy, Debug)]
pub struct Thoroughness {
    /// Tours that each search evaluates.
    pub tours: u32,
}

/// Temperatures of the search from scratch, first and last, utility.
const FROM_SCRATCH: [f32; 2] = [5.0, 0.03];
/// Temperatures of the search from the previous preference's tour, utility.
const FROM_PREVIOUS: [f32; 2] = [1.5, 0.03];

/// One mission under every test preference: percent of data, and minus battery units.
#[must_use]
pub fn consult(rates: &Rates, realization: &Realization, thoroughness: Thoroughness) -> Vec<Reward> {
    let known = rates.study(realization);
    let state = initial_state(realization);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut tour = Tour::default();
    test_preferences()
        .iter()
        .map(|preference| {
            let problem =
                Problem { model: &known, state: &state, w_data: preference.w_data().min(W_DATA_MAX) };
            let search = |from, temperatures, rng: &mut ChaCha8Rng| {
                problem.anneal(from, Effort { tours: thoroughness.tours, temperatures }, rng)
            };
            let first = search(Tour::default(), FROM_SCRATCH, &mut rng);
            let second = search(tour.clone(), FROM_PREVIOUS, &mut rng);
            tour = if second.0 > first.0 { second.1 } else { first.1 };
            let mut end = state;
            end.finish(&known, &tour);
            let percent = 100.0 * end.collected / known.initial_units().max(1.0);
            [percent, -0.5 * (state.hovers_left - end.hovers_left) as f32]
        })
        .collect()
}
