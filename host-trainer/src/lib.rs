//! Trains, evaluates and exports policies: multi-objective soft actor-critic with attention (MOSAC-ATT, `paper`, section
//! IV), the systems that the paper compares it with, and the way to the shipped policy.
//!
//! # Glossary
//! - **flight**: an episode of the world under the safety envelope and one preference.
//! - **reward**: percent of the data, and minus battery units; always a vector.
//! - **step** (environment step): one slot of one flight. **update**: one gradient step of all networks on one batch.
//! - **entropy coefficient** nu: weight of the entropy in the objective. **temperature** tau: divisor of the logits in the
//!   exploring softmax.
//! - **encoding**: what a system observes of a flight and stores of a state. **system**: an algorithm with an encoding.
//! - **realization**: a scenario with its devices drawn. Evaluation realizations are never trained on.
//! - **snapshot**: the parameters of a policy with the settings that trained them. **checkpoint**: everything that the
//!   next update depends on.
//!
//! # Modules
//! | module | contents | uses |
//! |---|---|---|
//! | [`net`] | networks: forward and backward passes, Adam | - |
//! | [`mod@env`] | missions and flights | - |
//! | [`settings`] | hyper-parameters and presets | `env` |
//! | [`observe`] | encodings | `net`, `env` |
//! | [`keep`] | checkpoints, snapshots, learning curves | `settings` |
//! | [`planner`] | the teacher, the oracle and the proven bound: planners with full knowledge | `env` |
//! | [`judge`] | metrics, validation, the paper's settings | all above |
//! | [`learn`] | MOSAC, DDQN, distillation, refinement | all above |
//! | [`systems`] | the systems by name | `learn`, `judge` |
//! | [`export`], [`report`] | ONNX models, the report | `net`, `judge` |
//!
//! The shipped policy is made by [`learn::distil`] from the planner and then by [`learn::ppo`] from its own flights.

pub mod env;
pub mod export;
pub mod judge;
pub mod keep;
pub mod learn;
pub mod net;
pub mod observe;
pub mod planner;
pub mod report;
pub mod settings;
pub mod systems;
