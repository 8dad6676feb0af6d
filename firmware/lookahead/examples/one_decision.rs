//! One decision with look-ahead, and its explanation.

use gleaner_guard::Guard;
use gleaner_lookahead::{Budget, ChannelModel, FitSettings, LookAhead, View};
use gleaner_policy::{DeviceState, Preference};
use gleaner_units::{BatteryUnits, Cell, CellSet, Grid, HeightMap, Metres, Rays};

fn main() {
    let grid = Grid::new(40, 30, Metres(20.0)).expect("a small grid");
    let heights = HeightMap::flat(grid);
    let sight = Rays { heights: &heights, altitude_m: 60 };
    let guard = Guard::new(&CellSet::full(grid), Cell::new(30, 18), BatteryUnits(0.0)).expect("a terminal");
    let devices = [DeviceState { cell: Cell::new(12, 20), remaining: 6000.0, snr: None }];
    let view = View {
        cell: Cell::new(10, 6),
        battery: BatteryUnits(80.0),
        preference: Preference::DATA,
        guard: &guard,
        devices: &devices,
    };

    let mut lookahead = LookAhead::<12>::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
    lookahead.begin(Some(&sight), &devices, 1);
    // From the engine and from the guard.
    let (logits, mask) = ([0.0; 5], guard.mask(view.cell, view.battery));
    let choice = lookahead.propose(&view, &logits, mask, Budget::LINUX).expect("an allowed action");
    println!("{} ({:?}), expected: {:?}", choice.action.name(), choice.source, choice.expected);
    for outlook in lookahead.what_if(&view, Budget::LINUX).into_iter().flatten() {
        println!("w_data {}: {:?}", outlook.w_data, outlook.expected);
    }
}
