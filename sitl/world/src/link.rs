//! A city with a channel: the mean SNR of every link.

use crate::{Channel, City};
use gleaner_units::{Cell, Db, Metres};

/// A city with a channel, and the mean SNR by distance and link condition. It is immutable; share it with `Arc`.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    city: City,
    channel: Channel,
    /// By link condition (0 obstructed, 1 line of sight), then |dy| x width + |dx| in cells.
    mean_snr: [Vec<Db>; 2],
}

impl World {
    /// A city with a channel.
    #[must_use]
    pub fn new(city: City, channel: Channel) -> World {
        let grid = city.grid();
        let table = |line_of_sight: bool| {
            let (cell_m, altitude_m) = (grid.cell().0, f32::from(City::ALTITUDE_M));
            let snr = |dx: u16, dy: u16| {
                let (east_m, north_m) = (f32::from(dx) * cell_m, f32::from(dy) * cell_m);
                let distance_m = libm::sqrtf(east_m * east_m + north_m * north_m + altitude_m * altitude_m);
                channel.mean_snr(line_of_sight, Metres(distance_m))
            };
            (0..grid.height()).flat_map(|dy| (0..grid.width()).map(move |dx| snr(dx, dy))).collect()
        };
        let mean_snr = [table(false), table(true)];
        World { city, channel, mean_snr }
    }

    /// The default city with the default channel.
    #[must_use]
    pub fn default_world() -> World {
        World::new(City::default_city(), Channel::default())
    }

    /// The city.
    #[must_use]
    pub const fn city(&self) -> &City {
        &self.city
    }

    /// The channel.
    #[must_use]
    pub const fn channel(&self) -> &Channel {
        &self.channel
    }

    /// SNR between a device on the open cell `device` and the aircraft over `uav`, without shadowing and fading;
    /// `None` for a device on a building or a cell outside the city.
    #[must_use]
    pub fn mean_snr(&self, device: Cell, uav: Cell) -> Option<Db> {
        let row = self.city.sight().row(device)?;
        let index = self.city.grid().index(uav)?;
        Some(self.link(row, device, uav, index).1)
    }

    /// Link condition and mean SNR; `row` must be the device's in the sight table, `index` the aircraft's cell.
    pub(crate) fn link(&self, row: u32, device: Cell, uav: Cell, index: usize) -> (bool, Db) {
        let line_of_sight = self.city.sight().sees(row, index);
        let (dx, dy) = (usize::from(device.x.abs_diff(uav.x)), usize::from(device.y.abs_diff(uav.y)));
        let place = dy * usize::from(self.city.grid().width()) + dx;
        (line_of_sight, self.mean_snr[usize::from(line_of_sight)][place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_formula() {
        let world = World::default_world();
        let (device, uav) = (Cell::new(20, 15), Cell::new(25, 3));
        let distance = Metres((100.0_f32 * 100.0 + 240.0 * 240.0 + 60.0 * 60.0).sqrt());
        let expected = world.channel().mean_snr(world.city().line_of_sight(device, uav), distance);
        let snr = world.mean_snr(device, uav).unwrap();
        assert!((snr - expected).0.abs() < 1e-4, "{snr:?} {expected:?}");
        assert_eq!(world.mean_snr(Cell::new(2, 3), uav).is_none(), !world.city().is_open(Cell::new(2, 3)));
        assert_eq!(world.mean_snr(device, Cell::new(40, 3)), None);
    }
}
