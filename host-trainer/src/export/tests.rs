use super::*;
use gleaner_policy::onnx::TractPolicy;
use gleaner_policy::{LOCAL_MAP_CELLS, Policy};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::HashSet;

fn fresh() -> Vec<f32> {
    Shape::actor().initialise(&mut ChaCha8Rng::seed_from_u64(3))
}

fn card() -> ModelCard {
    ModelCard { name: "rd".into(), seed: 3, steps: 150_000, city_hash: u64::MAX, ..ModelCard::default() }
}

fn observation(devices: usize) -> Tokens {
    Tokens {
        uav: [40.0, 72.0, 300.0, -260.0],
        preference: [0.5, 0.5],
        local_map: (0..LOCAL_MAP_CELLS).map(|cell| 64.0 * cell as f32).collect(),
        devices: (0..devices)
            .map(|n| [20.0 * n as f32, 40.0, 900.0 * n as f32, 12.0, 1.0, 10.0 * n as f32, 20.0])
            .collect(),
    }
}

#[test]
fn what_is_written_can_be_loaded_and_read_back() {
    let actor = fresh();
    let observations = [0, 1, 6, 12].map(observation);
    let goldens = golden_pairs(&actor, Shape::actor(), &observations);
    let file = export(&actor, Shape::actor(), &card(), &goldens).unwrap();
    assert_eq!(file, export(&actor, Shape::actor(), &card(), &goldens).unwrap(), "the same bytes each time");
    let mut policy = TractPolicy::load_checked(&file).unwrap();
    assert_eq!(policy.info().card, card());
    assert_eq!(policy.info().parameters, 89_989);
    assert_eq!(policy.goldens(), goldens, "to the last bit");
    assert_eq!(read_actor(&file).unwrap(), actor);
    let answer = policy.infer(&observations[2]).unwrap();
    assert!((answer.logits[0] - goldens[2].logits[0]).abs() < 1e-5);
    assert_ne!(goldens[1].logits, goldens[2].logits, "the pairs differ");
}

#[test]
fn names_in_the_graph_are_unique() {
    // Other engines find values by name.
    let graph = graph::actor(&fresh(), Shape::actor());
    let mut seen = HashSet::new();
    let values = graph.initializer.iter().map(|tensor| &tensor.name);
    for name in values.chain(graph.node.iter().flat_map(|node| &node.output)) {
        assert!(seen.insert(name), "{name} is there twice");
    }
    let used: HashSet<&String> = graph.node.iter().flat_map(|node| &node.input).collect();
    for tensor in &graph.initializer {
        assert!(used.contains(&tensor.name), "{} is not used", tensor.name);
    }
}

#[test]
fn what_cannot_fly_is_not_written() {
    let goldens = golden_pairs(&fresh(), Shape::actor(), &[observation(2)]);
    let write = |actor: &[f32], shape, goldens: &[Golden]| export(actor, shape, &card(), goldens);
    let critic = Shape::critic();
    let parameters = vec![0.0; critic.parameter_count()];
    assert_eq!(write(&parameters, critic, &goldens), Err(ExportError::NotAnActor { outputs: 10 }));
    assert_eq!(
        write(&parameters, Shape::actor(), &goldens),
        Err(ExportError::Length { expected: 89_989, found: parameters.len() })
    );
    let mut diverged = fresh();
    diverged[4 * 64 + 2] = f32::NAN;
    let cause = ExportError::NotFinite { tensor: "project_uav.bias".into(), index: 2 };
    assert_eq!(write(&diverged, Shape::actor(), &goldens), Err(cause));
    assert_eq!(write(&fresh(), Shape::actor(), &[]), Err(ExportError::NoGolden));
}
