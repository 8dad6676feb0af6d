//! CPU milliseconds of one update, the minimum of several rounds, in one line for a script. The command is
//! `python3 host-trainer/scripts/compare_with_pytorch.py`.

mod processor;
mod twin;

use processor::cpu_ms;
use std::time::Instant;

const WARM_UP: usize = 5;
const ROUNDS: usize = 6;
const UPDATES_A_ROUND: usize = 20;

fn main() {
    let mut twin = twin::Twin::new();
    for _ in 0..WARM_UP {
        twin.update();
    }
    let (mut least_cpu, mut least_wall) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        let (cpu, wall) = (cpu_ms(), Instant::now());
        for _ in 0..UPDATES_A_ROUND {
            twin.update();
        }
        let each = 1.0 / UPDATES_A_ROUND as f64;
        least_wall = least_wall.min(wall.elapsed().as_secs_f64() * 1e3 * each);
        if let (Some(before), Some(after)) = (cpu, cpu_ms()) {
            least_cpu = least_cpu.min((after - before) * each);
        }
    }
    // Printed so that the compiler cannot remove the computation.
    let sum: f32 = twin.actor.parameters.iter().sum();
    println!("gleaner cpu_ms {least_cpu:.2} wall_ms {least_wall:.2} (sum of parameters {sum:.4})");
}
