//! The network at the size of a training batch: 96 samples with six devices.
//!
//!     cargo bench -p gleaner-host-trainer --bench update

mod twin;

use criterion::{Criterion, criterion_group, criterion_main};
use gleaner_host_trainer::net::{Shape, forward, forward_backward};

fn network(c: &mut Criterion) {
    let mut twin = twin::Twin::new();
    let name = |what: &str| format!("{what}, {} samples", twin::SAMPLES);
    c.bench_function(&name("actor forward"), |bencher| {
        let twin::Twin { actor, before, workspace, .. } = &mut twin;
        bencher.iter(|| forward(&Shape::actor(), &actor.parameters, before, workspace)[0]);
    });
    c.bench_function(&name("critic forward and backward"), |bencher| {
        let twin::Twin { critics: [critic, _], before, workspace, .. } = &mut twin;
        let square = |_: std::ops::Range<usize>, outputs: &[f32], d: &mut [f32]| d.copy_from_slice(outputs);
        bencher.iter(|| {
            critic.gradients.fill(0.0);
            let gradients = &mut critic.gradients;
            forward_backward(&Shape::critic(), &critic.parameters, before, workspace, square, gradients);
        });
    });
    c.bench_function(&name("whole update"), |bencher| bencher.iter(|| twin.update()));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = network
}
criterion_main!(benches);
