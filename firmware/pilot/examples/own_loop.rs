//! Runs the whole pilot in a loop of your own: bytes in, poll, bytes out. Nothing in the crate opens a port or reads a
//! clock, so the same loop runs on a desktop, in a simulator and on a microcontroller. Run it from the repository's root:
//!
//! ```sh
//! cargo run --release -p gleaner-pilot --features std --example own_loop
//! ```

use gleaner_pilot::{Onboard, Parameters, Settings, mission_file};
use gleaner_policy::native::{Aligned, Model, NativePolicy, Workspace};
use gleaner_policy::self_test;
use gleaner_units::{Duration, Instant};

/// The model as the native engine reads it, aligned for its numbers.
static MODEL: Aligned<[u8; include_bytes!("../../../models/gleaner.gln").len()]> =
    Aligned(*include_bytes!("../../../models/gleaner.gln"));

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The mission: a TOML text, and a function that returns the city file that it names.
    let mission = mission_file::read(include_str!("../../companion/dist/mission.toml"), |_city| {
        Ok(include_str!("../../companion/dist/city.csv").to_owned())
    })?;

    // The model, proven with its golden pairs. Without them the pilot communicates but does not engage.
    let model = Model::read(&MODEL.0).expect("a valid model");
    let mut workspace = Workspace::new();
    let mut policy = NativePolicy::new(model, &mut workspace);
    let tested = self_test(&mut policy, model.goldens());

    let mut pilot = Onboard::new(mission, Parameters::default(), Settings::default(), policy, tested)?;
    let mut buffer = [0; 280];
    let mut sent = 0;
    for tick in 0..20 * 20 {
        let now = Instant::ZERO + Duration::from_millis(tick * 50);
        // Replace these by what your ports have received since the last tick.
        pilot.receive_link(now, &[]);
        pilot.receive_radio(now, &[]);
        pilot.poll(now);
        if let Some(decision) = pilot.decision() {
            println!("{decision:?}");
        }
        loop {
            let length = pilot.transmit(&mut buffer);
            if length == 0 {
                break;
            }
            // Replace this by writing `&buffer[..length]` to the autopilot's port.
            sent += length;
        }
    }
    println!(
        "{} after 20 s: state {}, {sent} bytes for the autopilot",
        env!("CARGO_PKG_NAME"),
        pilot.state().name()
    );
    Ok(())
}
