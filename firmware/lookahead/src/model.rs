//! What a planner assumes about a mission.

use crate::draw::Draw;
use crate::links::Links;
use crate::rates::Rates;
use gleaner_guard::Guard;
use gleaner_units::{Cell, Grid};
use rand_core::Rng;

/// A device that holds no more than this, data units, counts as empty: less than a thousandth of its initial load.
pub const EMPTY_UNITS: f32 = 1.0;
/// Candidate cells that are compared for each stop that the search draws.
const CANDIDATES: usize = 3;
/// The largest distance of such a cell from the device it is drawn for, cells along each axis.
const CANDIDATE_REACH: i16 = 7;

/// A device that sends in a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Its index.
    pub device: usize,
    /// What the slot carries from it in the mean, data units.
    pub units: f32,
}

/// A mission without random draws.
pub trait Model {
    /// The grid of cells.
    fn grid(&self) -> Grid;

    /// The cell that ends the mission.
    fn terminal(&self) -> Cell;

    /// Moves to the terminal inside the fence; `None` outside the fence or cut off from the terminal.
    fn moves_home(&self, cell: Cell) -> Option<u16>;

    /// Battery that is kept back, in hovers (half battery units).
    fn reserve_hovers(&self) -> i32;

    /// Where the devices are.
    fn devices(&self) -> &[Cell];

    /// The data of all devices at the start, data units: what percentages refer to.
    fn initial_units(&self) -> f32;

    /// The device that sends in a slot over `cell` when the devices hold `remaining` data units.
    fn transmission(&self, cell: Cell, remaining: &[f32]) -> Option<Transmission>;

    /// A random cell where a stop may pay.
    fn draw_stop(&self, remaining: &[f32], rng: &mut impl Rng) -> Cell;
}

/// The model on board: map, guard and channel fit.
#[derive(Clone, Copy, Debug)]
pub struct Onboard<'a, const D: usize> {
    /// Line of sight.
    pub links: &'a Links<D>,
    /// Expected data per slot.
    pub rates: &'a Rates,
    /// Fence, terminal and reserve.
    pub guard: &'a Guard,
    /// The data of all devices at the start, data units.
    pub initial_units: f32,
}

impl<const D: usize> Onboard<'_, D> {
    /// Data units per slot from each device, in index order.
    fn units_from(&self, cell: Cell) -> impl Iterator<Item = u16> {
        let index = self.links.grid().index(cell);
        index.into_iter().flat_map(move |index| {
            self.links.from_cell(index).map(move |(device, in_sight)| {
                let (dx, dy) = (u32::from(device.x.abs_diff(cell.x)), u32::from(device.y.abs_diff(cell.y)));
                self.rates.units_per_slot(in_sight, dx * dx + dy * dy)
            })
        })
    }
}

impl<const D: usize> Model for Onboard<'_, D> {
    fn grid(&self) -> Grid {
        self.links.grid()
    }

    fn terminal(&self) -> Cell {
        self.guard.terminal()
    }

    fn moves_home(&self, cell: Cell) -> Option<u16> {
        self.guard.distance(cell)
    }

    fn reserve_hovers(&self) -> i32 {
        libm::ceilf(2.0 * self.guard.reserve().0) as i32
    }

    fn devices(&self) -> &[Cell] {
        self.links.devices()
    }

    fn initial_units(&self) -> f32 {
        self.initial_units
    }

    fn transmission(&self, cell: Cell, remaining: &[f32]) -> Option<Transmission> {
        let mut best = (0, 0);
        for (device, (units, &remaining)) in self.units_from(cell).zip(remaining).enumerate() {
            if remaining > EMPTY_UNITS && units > best.1 {
                best = (device, units);
            }
        }
        (best.1 > 0).then_some(Transmission { device: best.0, units: f32::from(best.1) })
    }

    /// The best of some cells around a random device that has data: the one that receives most from all such devices.
    fn draw_stop(&self, remaining: &[f32], rng: &mut impl Rng) -> Cell {
        let devices = self.links.devices();
        let mut best = (self.guard.terminal(), 0);
        for _ in 0..CANDIDATES {
            let at = rng.below(devices.len());
            let (east, north) = (rng.offset(CANDIDATE_REACH), rng.offset(CANDIDATE_REACH));
            let Some(device) =
                devices.get(at).filter(|_| remaining.get(at).is_some_and(|&r| r > EMPTY_UNITS))
            else {
                continue;
            };
            let cell = Cell::new(device.x.saturating_add(east), device.y.saturating_add(north));
            if self.guard.distance(cell).is_none() {
                continue;
            }
            let with_data = self.units_from(cell).zip(remaining).filter(|(_, r)| **r > EMPTY_UNITS);
            let units: u32 = with_data.map(|(units, _)| u32::from(units)).sum();
            if units > best.1 {
                best = (cell, units);
            }
        }
        best.0
    }
}
