use gleaner_host_trainer::evaluation::{Network, realizations};
use gleaner_host_trainer::flight::Flight;
use gleaner_host_trainer::mosac::Distribution;
use gleaner_host_trainer::net::Shape;
use gleaner_host_trainer::learned::Learned;
use gleaner_host_trainer::system::System;
use gleaner_policy::Preference;
use gleaner_world::*;
use rand::{RngExt, SeedableRng};
use std::sync::Arc;
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    let learned = Learned::load_of(System::MosacAtt, std::path::Path::new(&dir)).unwrap().unwrap();
    let world = Arc::new(World::default_world());
    for kind in ScenarioKind::ALL {
        let drawn = realizations(&world, &kind.scenario(), 100).unwrap();
        for w in [1.0, 0.5] {
        for heat in [1e-6f32, 0.25, 0.5, 1.0] {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
            let mut flights: Vec<Flight> = drawn.iter().map(|(s, r)| Flight::new(&world, r, *s, Preference::new(w).unwrap()).unwrap()).collect();
            let mut net = Network::new(Shape::actor(), &learned.actor);
            let (mut h, mut n) = (0.0, 0.0);
            while flights.iter().any(|f| !f.is_over()) {
                let mut going: Vec<&mut Flight> = flights.iter_mut().filter(|f| !f.is_over()).collect();
                let logits = net.logits(going.iter().map(|f| f.observe().with(f.preference())).collect::<Vec<_>>());
                for (f, l) in going.iter_mut().zip(logits) {
                    let p = Distribution::new(&l.map(|x| x / heat), f.mask());
                    h -= p.expectation(|a| p.log_probability[a].max(-50.0)); n += 1.0;
                    let a = p.pick(rng.random());
                    f.step(a);
                }
            }
            let m = |i: usize| flights.iter().map(|f| f.total()[i]).sum::<f32>() / 100.0;
            println!("{kind} w {w} heat {heat}: data {:.2} energy {:.2} utility {:.2} entropy {:.3}", m(0), m(1), w * m(0) + (1.0 - w) * m(1), h / n);
        }
        }
    }
}
