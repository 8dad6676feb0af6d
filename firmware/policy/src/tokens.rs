//! From a situation to the arrays that enter the model.

use crate::outlook::{Direct, Outlook};
use crate::schema::{DEVICE_FEATURES, PREFERENCE_FEATURES, REACHABLE_SNR_DB, SNR_NOT_HEARD_DB, UAV_FEATURES};
use crate::{DeviceState, K_MAX, LOCAL_MAP_CELLS, Situation};
use gleaner_units::Cell;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The model's input in physical units, in [`crate::schema`] order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tokens {
    /// Spare battery, battery (battery units), terminal east, terminal north (m).
    pub uav: [f32; UAV_FEATURES],
    /// `w_data`, `w_energy`.
    pub preference: [f32; PREFERENCE_FEATURES],
    /// Yield of a stay around the aircraft (data units), row by row from the south-west; marks the terminal.
    pub local_map: Vec<f32, LOCAL_MAP_CELLS>,
    /// For each device present: east, north (m), remaining (data units), SNR (dB), reachable, vantage east, vantage
    /// north (m).
    pub devices: Vec<[f32; DEVICE_FEATURES], K_MAX>,
}

/// The mission's device in each device token: its index in the list given to [`Tokens::build`].
pub type Slots = Vec<u16, K_MAX>;

impl Tokens {
    /// Builds the tokens of a situation, and the list of devices that they describe.
    ///
    /// Of more than [`K_MAX`] devices, those with the highest SNR are kept, and at equal SNR (all unheard devices) the
    /// nearest. Devices keep their order.
    ///
    /// # Cost
    /// One line-of-sight test for each cell within range of each device that has data left, and two kilobytes of stack.
    /// A host with memory to spare uses a `TokenTable` (feature `std`) instead.
    pub fn build(
        situation: &Situation<'_>,
        devices: impl IntoIterator<Item = DeviceState>,
    ) -> (Tokens, Slots) {
        Tokens::assemble(situation, devices, &mut Direct::of(situation))
    }

    pub(crate) fn assemble(
        situation: &Situation<'_>,
        devices: impl IntoIterator<Item = DeviceState>,
        outlook: &mut impl Outlook,
    ) -> (Tokens, Slots) {
        let cell_m = situation.sight.grid().cell().0;
        let offset_m = |to: Cell| {
            let from = situation.cell;
            [(f32::from(to.x) - f32::from(from.x)) * cell_m, (f32::from(to.y) - f32::from(from.y)) * cell_m]
        };
        let [terminal_east_m, terminal_north_m] = offset_m(situation.terminal);
        let mut tokens = Tokens {
            uav: [situation.spare.0, situation.battery.0, terminal_east_m, terminal_north_m],
            preference: [situation.preference.w_data(), situation.preference.w_energy()],
            local_map: Vec::new(),
            devices: Vec::new(),
        };
        let mut slots = Slots::new();
        for (index, device) in (0..=u16::MAX).zip(devices) {
            outlook.add(&device);
            let [east_m, north_m] = offset_m(device.cell);
            let snr_db = device.snr_db();
            let reachable = snr_db.is_some_and(|snr_db| snr_db >= REACHABLE_SNR_DB);
            let [vantage_east_m, vantage_north_m] = outlook.vantage(device.cell).map(|cells| cells * cell_m);
            let token = [
                east_m,
                north_m,
                device.remaining_units(),
                snr_db.unwrap_or(SNR_NOT_HEARD_DB),
                f32::from(u8::from(reachable)),
                vantage_east_m,
                vantage_north_m,
            ];
            if tokens.devices.is_full() {
                replace_weakest(&mut tokens.devices, &mut slots, token, index);
            } else {
                let _ = tokens.devices.push(token);
                let _ = slots.push(index);
            }
        }
        tokens.local_map = outlook.patches(situation.terminal);
        (tokens, slots)
    }
}

/// Highest SNR first, then nearest.
fn precedes(a: &[f32; DEVICE_FEATURES], b: &[f32; DEVICE_FEATURES]) -> bool {
    let rank = |&[east_m, north_m, _, snr_db, ..]: &[f32; DEVICE_FEATURES]| {
        (snr_db, -(east_m * east_m + north_m * north_m))
    };
    rank(a) > rank(b)
}

/// Replaces the weakest device by `token` if `token` is stronger. The devices stay in mission order.
fn replace_weakest(
    tokens: &mut Vec<[f32; DEVICE_FEATURES], K_MAX>,
    slots: &mut Slots,
    token: [f32; DEVICE_FEATURES],
    index: u16,
) {
    let weakest = (0..K_MAX)
        .zip(tokens.iter())
        .reduce(|worst, next| if precedes(next.1, worst.1) { worst } else { next })
        .filter(|(_, weakest)| precedes(&token, weakest))
        .map(|(slot, _)| slot);
    // Always true. Without the test a panic would remain in the board's image.
    if let Some(slot) = weakest.filter(|&slot| slot < tokens.len() && slot < slots.len()) {
        tokens.remove(slot);
        slots.remove(slot);
        let _ = tokens.push(token);
        let _ = slots.push(index);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ChannelOffset, Preference};
    use gleaner_units::{BatteryUnits, Db, Grid, HeightMap, Metres, Rays};
    use proptest::prelude::*;

    fn city() -> HeightMap {
        HeightMap::flat(Grid::new(40, 30, Metres(20.0)).unwrap())
    }

    fn situation<'a>(sight: &'a Rays<'_>, x: i16, y: i16) -> Situation<'a> {
        Situation {
            cell: Cell::new(x, y),
            battery: BatteryUnits(80.0),
            spare: BatteryUnits(48.0),
            terminal: Cell::new(30, 18),
            preference: Preference::new(0.25).unwrap(),
            sight,
            channel: ChannelOffset::NONE,
        }
    }

    #[test]
    fn offsets_in_metres_and_values_of_absent_quantities() {
        let heights = city();
        let sight = Rays { heights: &heights, altitude_m: 60 };
        let heard = DeviceState { cell: Cell::new(11, 4), remaining: 6000.0, snr: Some(Db(5.0)) };
        let unheard = DeviceState { snr: None, ..heard };
        let broken = DeviceState { snr: Some(Db(f32::NAN)), remaining: f32::NAN, ..heard };
        let (tokens, slots) = Tokens::build(&situation(&sight, 10, 6), [heard, unheard, broken]);
        assert_eq!(tokens.uav, [48.0, 80.0, 400.0, 240.0]);
        assert_eq!(tokens.preference, [0.25, 0.75]);
        assert_eq!(tokens.devices[0], [20.0, -40.0, 6000.0, 5.0, 1.0, 0.0, 0.0]);
        assert_eq!(tokens.devices[1], [20.0, -40.0, 6000.0, SNR_NOT_HEARD_DB, 0.0, 0.0, 0.0]);
        assert_eq!(tokens.devices[2], [20.0, -40.0, 0.0, SNR_NOT_HEARD_DB, 0.0, 0.0, 0.0]);
        assert_eq!(slots.as_slice(), [0, 1, 2]);
    }

    #[test]
    fn yield_map_includes_unheard_devices() {
        let heights = city();
        let sight = Rays { heights: &heights, altitude_m: 60 };
        let unheard = DeviceState { cell: Cell::new(10, 6), remaining: 6000.0, snr: None };
        let (tokens, _) = Tokens::build(&situation(&sight, 10, 6), [unheard]);
        assert_eq!(tokens.local_map.len(), LOCAL_MAP_CELLS);
        assert_eq!(tokens.local_map[LOCAL_MAP_CELLS / 2], 5952.0, "above the device, in steps of 64");
        let (empty, _) = Tokens::build(&situation(&sight, 10, 6), []);
        assert_eq!(empty.local_map, [0.0; LOCAL_MAP_CELLS]);
    }

    proptest! {
        #[test]
        fn strongest_devices_are_kept(
            snrs in prop::collection::vec(prop::option::of(-30i16..25), 0..40),
        ) {
            let heights = city();
            let sight = Rays { heights: &heights, altitude_m: 60 };
            let devices: std::vec::Vec<DeviceState> = snrs
                .iter()
                .enumerate()
                .map(|(index, snr)| DeviceState {
                    cell: Cell::new(index as i16, 3),
                    remaining: index as f32,
                    snr: snr.map(|db| Db(f32::from(db))),
                })
                .collect();
            let (tokens, slots) = Tokens::build(&situation(&sight, 10, 6), devices.iter().copied());
            prop_assert_eq!(tokens.devices.len(), devices.len().min(K_MAX));
            prop_assert!(slots.windows(2).all(|pair| pair[0] < pair[1]), "mission order");
            let key = |device: &DeviceState| {
                (device.snr.map_or(SNR_NOT_HEARD_DB, |snr| snr.0), -(device.cell.x - 10).abs())
            };
            for (slot, token) in slots.iter().zip(&tokens.devices) {
                prop_assert_eq!(f32::from(*slot), token[2], "the slot is the index of the device in the token");
            }
            for (index, unseen) in devices.iter().enumerate().filter(|(i, _)| !slots.contains(&(*i as u16))) {
                for &slot in &slots {
                    prop_assert!(key(unseen) <= key(&devices[slot as usize]), "{} over {}", slot, index);
                }
            }
        }
    }
}
