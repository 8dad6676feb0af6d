//! One update on random data: the counterpart of `scripts/pytorch_update_bench.py`, step by step.

use gleaner_host_trainer::net::{Adam, Batch, Sample, Shape, Workspace, forward, forward_backward, polyak};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// 32 transitions times 3 preferences.
pub const SAMPLES: usize = 96;
const DEVICES: u8 = 6;
const ACTIONS: usize = 5;
const OBJECTIVES: usize = 2;
const VALUES: usize = ACTIONS * OBJECTIVES;
const NU: f32 = 0.1;

/// One network, its gradients and its optimiser.
pub struct TwinNetwork {
    pub parameters: Vec<f32>,
    pub gradients: Vec<f32>,
    adam: Adam,
}

/// All networks and buffers of an update.
pub struct Twin {
    pub actor: TwinNetwork,
    pub critics: [TwinNetwork; 2],
    targets: [Vec<f32>; 2],
    pub before: Batch,
    after: Batch,
    preferences: Vec<[f32; OBJECTIVES]>,
    actions: Vec<usize>,
    rewards: Vec<[f32; OBJECTIVES]>,
    pub workspace: Workspace,
}

impl TwinNetwork {
    fn new(shape: Shape, rng: &mut ChaCha8Rng) -> Self {
        let parameters = shape.initialise(rng);
        let count = parameters.len();
        Self { parameters, gradients: vec![0.0; count], adam: Adam::new(count, 1e-4) }
    }

    fn descend(&mut self) {
        self.adam.step(&mut self.parameters, &self.gradients);
    }
}

fn sample(rng: &mut ChaCha8Rng) -> Sample {
    let mut sample = Sample { device_count: DEVICES, ..Sample::default() };
    sample.uav.fill_with(|| rng.random());
    sample.preference.fill_with(|| rng.random());
    sample.local_map.fill_with(|| rng.random());
    sample.devices.as_flattened_mut().fill_with(|| rng.random());
    sample
}

fn policy(logits: &[f32; ACTIONS]) -> ([f32; ACTIONS], [f32; ACTIONS]) {
    let largest = logits.iter().copied().fold(f32::MIN, f32::max);
    let sum: f32 = logits.iter().map(|logit| (logit - largest).exp()).sum();
    let log = logits.map(|logit| logit - largest - sum.ln());
    (log.map(f32::exp), log)
}

impl Twin {
    pub fn new() -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let critics = [TwinNetwork::new(Shape::critic(), rng), TwinNetwork::new(Shape::critic(), rng)];
        let (mut before, mut after, mut preferences) = (Batch::new(), Batch::new(), Vec::new());
        for _ in 0..SAMPLES {
            let sample_before = sample(rng);
            preferences.push(sample_before.preference);
            before.push_sample(&sample_before);
            after.push_sample(&sample(rng));
        }
        Self {
            actor: TwinNetwork::new(Shape::actor(), rng),
            targets: critics.each_ref().map(|critic| critic.parameters.clone()),
            critics,
            before,
            after,
            preferences,
            actions: (0..SAMPLES).map(|_| rng.random_range(0..ACTIONS)).collect(),
            rewards: (0..SAMPLES).map(|_| [rng.random(), rng.random()]).collect(),
            workspace: Workspace::new(),
        }
    }

    /// One update: three forward passes for the targets; forward and backward passes of two critics and the actor; three
    /// Adam steps; two Polyak steps.
    pub fn update(&mut self) {
        let goals = self.targets();
        let mut lower = vec![[f32::INFINITY; VALUES]; SAMPLES];
        for critic in &mut self.critics {
            critic.gradients.fill(0.0);
            let actions = &self.actions;
            let squared_error = |range: std::ops::Range<usize>, outputs: &[f32], d: &mut [f32]| {
                d.fill(0.0);
                for (row, index) in range.enumerate() {
                    for (objective, goal) in goals[index].iter().enumerate() {
                        let at = row * VALUES + actions[index] * OBJECTIVES + objective;
                        d[at] = (outputs[at] - goal) / SAMPLES as f32;
                    }
                }
            };
            forward_backward(
                &Shape::critic(),
                &critic.parameters,
                &self.before,
                &mut self.workspace,
                squared_error,
                &mut critic.gradients,
            );
            for (lower, values) in lower.iter_mut().zip(self.workspace.outputs().as_chunks::<VALUES>().0) {
                for (lower, value) in lower.iter_mut().zip(values) {
                    *lower = lower.min(*value);
                }
            }
            critic.descend();
        }
        self.step_actor(&lower);
        for (target, critic) in self.targets.iter_mut().zip(&self.critics) {
            polyak(target, &critic.parameters, 0.005);
        }
    }

    fn targets(&mut self) -> Vec<[f32; OBJECTIVES]> {
        let workspace = &mut self.workspace;
        let logits = forward(&Shape::actor(), &self.actor.parameters, &self.after, workspace).to_vec();
        let first = forward(&Shape::critic(), &self.targets[0], &self.after, workspace).to_vec();
        let second = forward(&Shape::critic(), &self.targets[1], &self.after, workspace);
        let mut goals = self.rewards.clone();
        for (index, (goal, logits)) in goals.iter_mut().zip(logits.as_chunks().0).enumerate() {
            let (probability, log) = policy(logits);
            for (action, (probability, log)) in probability.into_iter().zip(log).enumerate() {
                for (objective, goal) in goal.iter_mut().enumerate() {
                    let at = index * VALUES + action * OBJECTIVES + objective;
                    *goal += 0.99 * probability * (first[at].min(second[at]) - NU * log);
                }
            }
        }
        goals
    }

    fn step_actor(&mut self, lower: &[[f32; VALUES]]) {
        self.actor.gradients.fill(0.0);
        let preferences = &self.preferences;
        let soft_value = |range: std::ops::Range<usize>, outputs: &[f32], d: &mut [f32]| {
            let rows = outputs.as_chunks::<ACTIONS>().0.iter().zip(d.as_chunks_mut::<ACTIONS>().0);
            for ((logits, d), index) in rows.zip(range) {
                let (probability, log) = policy(logits);
                let (values, weight) = (lower[index].as_chunks::<OBJECTIVES>().0, preferences[index]);
                let cost: [f32; ACTIONS] = std::array::from_fn(|action| {
                    let [data, energy] = values[action];
                    NU * log[action] - weight[0] * data - weight[1] * energy
                });
                let mean: f32 = probability.iter().zip(&cost).map(|(p, c)| p * c).sum();
                for (d, (p, c)) in d.iter_mut().zip(probability.into_iter().zip(cost)) {
                    *d = p * (c - mean) / SAMPLES as f32;
                }
            }
        };
        forward_backward(
            &Shape::actor(),
            &self.actor.parameters,
            &self.before,
            &mut self.workspace,
            soft_value,
            &mut self.actor.gradients,
        );
        self.actor.descend();
    }
}
