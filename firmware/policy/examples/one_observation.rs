//! Asks the shipped policy for one decision. Run it from the repository's root:
//!
//! ```sh
//! cargo run --release -p gleaner-policy --example one_observation
//! ```

use gleaner_policy::native::{Aligned, Model, NativePolicy, Workspace};
use gleaner_policy::{ChannelOffset, DeviceState, Policy, Preference, Situation, Tokens};
use gleaner_units::{Action, BatteryUnits, Cell, Db, Grid, HeightMap, Metres, Rays};

/// The model as the native engine reads it, aligned for its numbers.
static MODEL: Aligned<[u8; include_bytes!("../../../models/gleaner.gln").len()]> =
    Aligned(*include_bytes!("../../../models/gleaner.gln"));

fn main() {
    let mut workspace = Workspace::new();
    let mut policy = NativePolicy::new(Model::read(&MODEL.0).expect("a valid model"), &mut workspace);

    // Open ground of 40 x 30 cells of 20 m, seen from 60 m; one device, four cells to the east.
    let heights = HeightMap::flat(Grid::new(40, 30, Metres(20.0)).expect("a valid grid"));
    let situation = Situation {
        cell: Cell::new(10, 10),
        battery: BatteryUnits(80.0),
        spare: BatteryUnits(60.0),
        terminal: Cell::new(30, 10),
        preference: Preference::DATA,
        sight: &Rays { heights: &heights, altitude_m: 60 },
        channel: ChannelOffset::NONE,
    };
    let device = DeviceState { cell: Cell::new(14, 10), remaining: 6000.0, snr: Some(Db(9.0)) };

    let (tokens, _) = Tokens::build(&situation, [device]);
    let inference = policy.infer(&tokens).expect("finite logits");
    for action in Action::ALL {
        println!("{:<6} {:8.3}", action.name(), inference.logits[action.index()]);
    }
    // In flight, `firmware/guard` masks the logits before the largest one wins.
    let best = Action::ALL
        .into_iter()
        .max_by(|a, b| inference.logits[a.index()].total_cmp(&inference.logits[b.index()]));
    println!("decision: {}", best.expect("five actions").name());
}
