//! The oracle: what a planner that knows map, channel and devices plans for. A strong lower bound of the optimum, not
//! the optimum.

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
    /// What the best tours bring in the mean.
    pub missions: Missions,
    /// Percent of the data at w = (1, 0) that nobody can exceed, for the first realizations; empty when it was not
    /// computed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub upper_bound_percent: Vec<f32>,
    /// How many parts of each mission's possibilities were looked at for that.
    #[serde(default, skip_serializing_if = "is_none")]
    pub bound_parts: u32,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
const fn is_none(count: &u32) -> bool {
    *count == 0
}

impl OracleSetting {
    /// The same of the first `count` realizations; `None` if there are not so many.
    #[must_use]
    pub fn first(&self, count: u64) -> Option<OracleSetting> {
        let len = usize::try_from(count).ok()?;
        let missions: Option<_> = self.missions.0.iter().map(|all| Some(all.get(..len)?.to_vec())).collect();
        Some(OracleSetting {
            realizations: count,
            missions: Missions(missions?),
            // The mean over fewer missions is another one.
            upper_bound_percent: self.upper_bound_percent.get(..len).unwrap_or_default().to_vec(),
            ..self.clone()
        })
    }
}

/// How hard to look for the best tour of a mission under one preference: two searches, one of them from the best
/// tour of the preference before.
#[derive(Clone, Copy, Debug)]
pub struct Thoroughness {
    /// Tours that each search flies in the mean.
    pub tours: u32,
}

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
            let anew = Effort { tours: thoroughness.tours, temperatures: [5.0, 0.03] };
            let onward = Effort { tours: thoroughness.tours, temperatures: [1.5, 0.03] };
            let first = problem.anneal(Tour::default(), anew, &mut rng);
            let second = problem.anneal(tour.clone(), onward, &mut rng);
            tour = if second.0 > first.0 { second.1 } else { first.1 };
            let mut end = state;
            end.finish(&known, &tour);
            let percent = 100.0 * end.collected / known.initial_units().max(1.0);
            [percent, -0.5 * (state.hovers_left - end.hovers_left) as f32]
        })
        .collect()
}
