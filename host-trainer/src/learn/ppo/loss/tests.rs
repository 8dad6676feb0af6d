use super::*;
use gleaner_units::{Action, ActionMask};

const CONSTANTS: PpoSettings = PpoSettings::DEFAULT;

fn target(action: Action) -> Target {
    Target {
        sample: Sample::default(),
        mask: ActionMask::FULL,
        action,
        log_probability: 0.0,
        is_prompted: false,
        advantage: 0.0,
        shaped_return: 0.0,
        loss_of_ending: 0.0,
    }
}

/// Compares `gradient` with central differences of `loss`.
fn check_gradient(logits: [f32; ACTIONS], gradient: [f32; ACTIONS], loss: impl Fn(&[f32; ACTIONS]) -> f64) {
    for index in 0..ACTIONS {
        let shifted = |by: f32| {
            let mut logits = logits;
            logits[index] += by;
            loss(&logits)
        };
        let measured = (shifted(1e-2) - shifted(-1e-2)) / 2e-2;
        let error = (measured - f64::from(gradient[index])).abs();
        assert!(error < 1e-3, "{index}: {measured}, {gradient:?}");
    }
}

const LOGITS: [f32; ACTIONS] = [0.3, -0.5, 1.0, 0.1, 0.9];

#[test]
fn clipped_objective_gradient_matches_finite_differences() {
    let mask = ActionMask::FULL;
    let before = Distribution::new(&[0.3, -0.45, 0.97, 0.1, 0.9], mask);
    for advantage in [1.5, -2.0] {
        let log_probability = before.log_probability[Action::East.index()];
        let target = Target { advantage, log_probability, ..target(Action::East) };
        let mut gradient = [0.0; ACTIONS];
        target.gradient(&LOGITS, &mut gradient, &CONSTANTS);
        check_gradient(LOGITS, gradient, |logits| {
            let policy = Distribution::new(logits, mask);
            let ratio = f64::from(policy.log_probability[Action::East.index()] - log_probability).exp();
            -ratio * f64::from(advantage) - f64::from(CONSTANTS.entropy_coefficient * policy.entropy())
        });
    }
}

#[test]
fn unlikelihood_gradient_matches_finite_differences() {
    let (mask, loss_of_ending) = (ActionMask::FULL, 3.0);
    let target = Target { loss_of_ending, ..target(Action::East) };
    let mut gradient = [0.0; ACTIONS];
    target.add_unlikelihood(&Distribution::new(&LOGITS, mask), &mut gradient, CONSTANTS.unlikelihood);
    check_gradient(LOGITS, gradient, |logits| {
        let p = Distribution::new(logits, mask).probability[Action::East.index()];
        -f64::from(CONSTANTS.unlikelihood * loss_of_ending) * (1.0 - f64::from(p)).ln()
    });
}

#[test]
fn unlikelihood_does_not_vanish_for_a_certain_policy() {
    let target = Target { loss_of_ending: 3.0, ..target(Action::East) };
    let mut certain = [0.0; ACTIONS];
    certain[Action::East.index()] = 12.0;
    let mut gradient = [0.0; ACTIONS];
    let policy = Distribution::new(&certain, ActionMask::FULL);
    target.add_unlikelihood(&policy, &mut gradient, CONSTANTS.unlikelihood);
    assert!(gradient[Action::East.index()] > 2.99 * CONSTANTS.unlikelihood, "{gradient:?}");
    assert!(gradient.iter().sum::<f32>().abs() < 1e-4);
}

#[test]
fn prompts_are_imitated_when_good_and_unlikely() {
    let pull = |advantage, logits: [f32; ACTIONS]| {
        let target = Target { is_prompted: true, advantage, ..target(Action::East) };
        let mut gradient = [0.0; ACTIONS];
        target.gradient(&logits, &mut gradient, &CONSTANTS);
        -gradient[Action::East.index()]
    };
    let threshold = CONSTANTS.prompt_advantage;
    let [certain_hover, likely] = [[8.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]];
    assert!(pull(2.0, certain_hover) > 0.99 * (2.0 - threshold), "not for a certain policy");
    assert!(pull(threshold, certain_hover).abs() < 0.01, "at the threshold");
    assert!(pull(-3.0, certain_hover).abs() < 0.01, "below the threshold");
    assert!(pull(2.0, likely).abs() < 0.01, "for a likely action");
}

#[test]
fn forced_and_lossless_moves_have_no_unlikelihood() {
    let mut gradient = [0.0; ACTIONS];
    let forced = Distribution::new(&[0.0; ACTIONS], ActionMask::EMPTY.with(Action::North));
    Target { loss_of_ending: 5.0, ..target(Action::North) }.add_unlikelihood(&forced, &mut gradient, 1.0);
    let free = Distribution::new(&[0.0; ACTIONS], ActionMask::FULL);
    target(Action::North).add_unlikelihood(&free, &mut gradient, 1.0);
    assert_eq!(gradient, [0.0; ACTIONS]);
}
