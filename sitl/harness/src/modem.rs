//! The devices on the ground, and the radio modem on board that reports their signals.
//!
//! # The same process as in training
//! The channel is drawn once per *slot*, as in the paper and in [`gleaner_world::Episode`], not by time. A slot begins
//! with a decision and serves one device at the present cell with the SNR that was reported there. Then the links of
//! all devices are drawn for the cell that the aircraft is sent to. A flight therefore collects exactly what an episode
//! of the same seed and the same actions collects; a test compares the two.
//!
//! The reports for the next cell go out as soon as the slot is decided, while the aircraft is still on its way. The pilot
//! decides for a cell up to one cell before it is there. A real radio then still reports the signal of the cell before, so
//! the simulation is optimistic there: it keeps the slots of training.

use gleaner_radio::Report;
use gleaner_units::{Action, Cell, Duration, Instant};
use gleaner_world::{Device, Field, Realization, ScenarioError, Seed, Serving, Stream, World};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Time between two rounds of reports, on the pilot's clock.
const ROUND: Duration = Duration::from_millis(200);

/// The modem and the devices in its range.
#[derive(Clone, Debug)]
pub struct Modem {
    world: Arc<World>,
    field: Field,
    rng: ChaCha8Rng,
    /// Device ids in the reports, by index.
    ids: Vec<u32>,
    cell: Cell,
    round: Duration,
    next_round: Instant,
}

/// The id of the device with this index in a mission that was drawn.
#[must_use]
pub fn device_id(index: usize) -> u32 {
    index as u32 + 1
}

impl Modem {
    /// A modem at the start of a realization. `seed` is that of the shadowing.
    ///
    /// # Errors
    /// The realization belongs to another city.
    pub fn new(world: Arc<World>, realization: &Realization, seed: Seed) -> Result<Modem, ScenarioError> {
        let mut field = Field::new(&world, realization)?;
        let mut rng = seed.rng(Stream::Slots);
        field.listen(&world, realization.start(), &mut rng);
        let cell = realization.start();
        let ids = (0..field.devices().len()).map(device_id).collect();
        Ok(Modem { world, field, rng, ids, cell, round: ROUND, next_round: Instant::ZERO })
    }

    /// The same with the device ids of a mission file.
    #[must_use]
    pub fn with_ids(self, ids: Vec<u32>) -> Modem {
        Modem { ids, ..self }
    }

    /// The same for a pilot whose clock counts one second while `speedup` seconds pass here.
    #[must_use]
    pub fn with_speedup(self, speedup: f32) -> Modem {
        Modem { round: Duration::from_secs_f32(ROUND.as_secs_f32() * speedup), ..self }
    }

    /// One slot: serves at `cell`, then hears the devices at the cell that `action` leads to. Reports follow at once.
    pub fn slot(&mut self, cell: Cell, action: Action) -> Option<Serving> {
        self.carry_to(cell);
        let serving = self.field.serve(&self.world);
        self.cell = cell.after(action);
        self.field.listen(&self.world, self.cell, &mut self.rng);
        self.next_round = Instant::ZERO;
        serving
    }

    /// The aircraft is over `cell`, outside a slot of the pilot.
    pub fn carry_to(&mut self, cell: Cell) {
        if self.cell != cell {
            self.cell = cell;
            self.field.listen(&self.world, cell, &mut self.rng);
            self.next_round = Instant::ZERO;
        }
    }

    /// The reports that are due, at 5 Hz: one for every device whose link is known.
    pub fn reports(&mut self, now: Instant) -> Vec<Report> {
        if now < self.next_round {
            return Vec::new();
        }
        self.next_round = now + self.round;
        let heard = self.field.devices().iter().enumerate().filter(|(_, device)| device.snr.0.is_finite());
        let report = |(index, device): (usize, &Device)| Report {
            device: self.ids.get(index).copied().unwrap_or_default(),
            snr: device.snr,
            remaining: Some(device.remaining_units),
            age_ms: 0,
        };
        // Outside the city no link is known.
        heard.map(report).collect()
    }

    /// What the devices hold.
    #[must_use]
    pub const fn field(&self) -> &Field {
        &self.field
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_world::{Episode, Scenario};

    fn setup() -> (Arc<World>, Realization) {
        let world = Arc::new(World::default_world());
        let realization =
            Realization::draw(world.city(), &Scenario::reach_destination(), Seed::evaluation(3)).unwrap();
        (world, realization)
    }

    #[test]
    fn slots_equal_those_of_an_episode() {
        let (world, realization) = setup();
        let mut modem = Modem::new(Arc::clone(&world), &realization, Seed::evaluation(3)).unwrap();
        let mut episode = Episode::new(world, &realization, Seed::evaluation(3)).unwrap();
        for turn in 0..60 {
            let action = Action::ALL[[4, 1, 0, 4, 3][turn % 5]];
            let serving = modem.slot(episode.uav(), action);
            let step = episode.step(action).unwrap();
            assert_eq!(serving.map(|serving| serving.device), step.served);
            assert_eq!(modem.field(), episode.field());
        }
    }

    #[test]
    fn reports_come_at_5_hz_and_at_once_after_a_slot() {
        let (world, realization) = setup();
        let mut modem = Modem::new(world, &realization, Seed::evaluation(3)).unwrap();
        let reports = modem.reports(Instant::from_millis(20));
        assert_eq!(reports.len(), 6);
        for (report, device) in reports.iter().zip(modem.field().devices()) {
            assert_eq!((report.snr, report.remaining), (device.snr, Some(device.remaining_units)));
        }
        assert!(modem.reports(Instant::from_millis(200)).is_empty());
        assert_eq!(modem.reports(Instant::from_millis(220)).len(), 6);
        modem.slot(realization.start(), Action::East);
        assert_eq!(modem.reports(Instant::from_millis(240)).len(), 6);
        modem.carry_to(Cell::new(-1, 3));
        assert!(modem.reports(Instant::from_millis(900)).is_empty(), "outside the city");
    }
}
