//! The paper's attention analysis (section V-E) and its example missions (figure 5).

use crate::env::flight::Flight;
use crate::judge::evaluation::{Decider, DeciderError};
use gleaner_policy::{Attention, FIRST_DEVICE_TOKEN, Preference, TOKENS};
use gleaner_world::{Realization, Seed, World};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Names of the token kinds, in the order of [`Shares`] and of the tokens.
pub const KINDS: [&str; 4] = ["UAV", "preference", "local map", "devices"];

/// Share of all attention that each kind of token receives: the column sums of the attention matrix, divided by the number
/// of queries and summed by kind. The four shares sum to one.
pub type Shares = [f32; KINDS.len()];

/// The shares of one matrix; zeros for an empty one.
#[must_use]
pub fn shares(attention: &Attention) -> Shares {
    let received = attention.received();
    let total: f32 = received.iter().sum();
    let mut shares = Shares::default();
    for (token, received) in received.iter().enumerate() {
        if total > 0.0 {
            shares[token.min(FIRST_DEVICE_TOKEN)] += received / total;
        }
    }
    shares
}

/// Attention of one system under one preference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gaze {
    /// Weight of data.
    pub w_data: f32,
    /// The matrix at the first slot of the example, row = query; rows and columns of absent devices are zero.
    pub initial: Vec<[f32; TOKENS]>,
    /// The mean of [`shares`] over the slots of each mission, then over the missions.
    pub along: Shares,
}

/// Flies every realization under one preference and records the attention; `None` for a system without attention. The
/// example is `realizations[example]`.
///
/// # Errors
/// The decider failed.
///
/// # Panics
/// When the realizations belong to another world.
pub fn watch(
    world: &Arc<World>,
    realizations: &[(Seed, Realization)],
    example: usize,
    preference: Preference,
    decider: &mut dyn Decider,
) -> Result<Option<Gaze>, DeciderError> {
    let mut gaze = Gaze { w_data: preference.w_data(), initial: Vec::new(), along: Shares::default() };
    for (index, (seed, realization)) in realizations.iter().enumerate() {
        let mut flight = Flight::new(world, realization, *seed, preference).expect("drawn for this world");
        let (mut sums, mut slots) = (Shares::default(), 0_u16);
        while !flight.is_over() {
            let Some(attention) = decider.attention(&flight)? else { return Ok(None) };
            for (sum, share) in sums.iter_mut().zip(shares(&attention)) {
                *sum += share;
            }
            if index == example && slots == 0 {
                gaze.initial = attention.0.to_vec();
            }
            slots += 1;
            flight.step(decide_one(decider, &flight)?);
        }
        for (along, sum) in gaze.along.iter_mut().zip(sums) {
            *along += sum / f32::from(slots) / realizations.len() as f32;
        }
    }
    Ok(Some(gaze))
}

/// One flown mission, slot by slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Weight of data.
    pub w_data: f32,
    /// Column and row of the cell at the start of each slot, and at the end those of the terminal.
    pub cells: Vec<(i16, i16)>,
    /// Column and row of each device, and the share of its data that was collected.
    pub devices: Vec<(i16, i16, f32)>,
    /// Percent of the data.
    pub data_percent: f32,
    /// Battery units used.
    pub energy: f32,
}

/// Flies one mission and records the path.
///
/// # Errors
/// The decider failed.
///
/// # Panics
/// When the realization belongs to another world.
pub fn track(
    world: &Arc<World>,
    (seed, realization): &(Seed, Realization),
    preference: Preference,
    decider: &mut dyn Decider,
) -> Result<Track, DeciderError> {
    let mut flight = Flight::new(world, realization, *seed, preference).expect("drawn for this world");
    let mut cells = Vec::new();
    let mut note = |flight: &Flight| {
        let cell = flight.episode().uav();
        cells.push((cell.x, cell.y));
    };
    note(&flight);
    while !flight.is_over() {
        flight.step(decide_one(decider, &flight)?);
        note(&flight);
    }
    let devices =
        flight.episode().devices().iter().map(|device| {
            (device.cell.x, device.cell.y, 1.0 - device.remaining_units / device.initial_units)
        });
    let [data_percent, energy] = flight.total();
    Ok(Track {
        w_data: preference.w_data(),
        devices: devices.collect(),
        cells,
        data_percent,
        energy: -energy,
    })
}

fn decide_one(decider: &mut dyn Decider, flight: &Flight) -> Result<gleaner_units::Action, DeciderError> {
    let actions = decider.decide(&[flight])?;
    actions.first().copied().ok_or_else(|| DeciderError("no action for a flight".into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::evaluation::{Network, realizations};
    use crate::net::Shape;
    use gleaner_world::Scenario;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn shares_add_to_one_and_devices_are_one_kind() {
        let mut attention = Attention::NONE;
        // Two queries: one attends to the preference, one to two devices.
        attention.0[0][1] = 1.0;
        attention.0[3][3] = 0.5;
        attention.0[3][4] = 0.5;
        assert_eq!(shares(&attention), [0.0, 0.5, 0.0, 0.5]);
        assert_eq!(shares(&Attention::NONE), [0.0; 4]);
    }

    #[test]
    fn a_mission_is_watched_and_tracked_from_start_to_terminal() {
        let world = Arc::new(World::default_world());
        let drawn = realizations(&world, &Scenario::reach_destination(), 2).unwrap();
        let actor = Shape::actor().initialise(&mut ChaCha8Rng::seed_from_u64(1));
        let mut network = Network::new(Shape::actor(), &actor);
        let gaze = watch(&world, &drawn, 1, Preference::DATA, &mut network).unwrap().unwrap();
        assert!((gaze.along.iter().sum::<f32>() - 1.0).abs() < 1e-4, "{gaze:?}");
        let row: f32 = gaze.initial[0].iter().sum();
        assert!((row - 1.0).abs() < 1e-4 && gaze.initial[14] == [0.0; TOKENS], "six devices are present");

        let track = track(&world, &drawn[0], Preference::DATA, &mut network).unwrap();
        assert_eq!((track.cells.first(), track.cells.last()), (Some(&(10, 6)), Some(&(30, 18))));
        let moved = |pair: &[(i16, i16)]| pair[0] != pair[1];
        let energy: f32 = track.cells.windows(2).map(|pair| if moved(pair) { 1.0 } else { 0.5 }).sum();
        assert_eq!(energy, track.energy);
        let collected: f32 = track.devices.iter().map(|device| device.2).sum::<f32>() / 6.0;
        assert!((0.0..=1.0).contains(&collected) && track.devices.len() == 6);
    }
}
