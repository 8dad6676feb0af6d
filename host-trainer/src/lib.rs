//! Learns, evaluates and exports policies: multi-objective soft actor-critic with the attention network
//! (MOSAC-ATT, `paper`, section IV), and the systems that the paper compares it with.
//!
//! # Glossary
//! - **flight**: an episode of the world with the guard on, under one preference.
//! - **reward**: percent of the data and minus battery units, always as a vector.
//! - **update**: one gradient step of all networks on one batch; **step**: one slot of one flight.
//! - **temperature**: two of them, as in the paper: nu weighs the entropy in the objectives, tau heats the softmax
//!   that explores.
//! - **system**: a learning algorithm with an **encoding**, which is how it sees a state and what it remembers of it.
//! - **realization**: devices drawn for a scenario; evaluation realizations are never trained on.
//!
//! # How it hangs together
//! `train` reads top to bottom; what it calls lives beside it: [`env::flight`] and [`observe::encoding`] make samples,
//! [`learn::replay`] keeps them, [`learn::mosac`] or [`learn::ddqn`] learns from them (what the loop asks of either is [`learn::learner`]),
//! [`judge::validation`] and [`judge::evaluation`] judge, [`keep::checkpoint`] survives a kill, [`keep::snapshot`] is what is left, [`export`]
//! writes the model. The networks themselves are [`net`]; [`systems`] lists what can be trained.
//!
//! The policies that fly come another way: [`learn::distil`] copies the [`planner::teacher`], who knows what the aircraft cannot see,
//! and [`learn::ppo`] lets the pupil learn from its own flights. What one loop asks of all three ways is [`learn::learning`]. What
//! they are measured against is the [`planner::oracle`]: the best tour that the [`planner`] finds for someone who knows
//! everything, and a proven bound on what anyone can have.

pub mod env;
pub mod export;
pub mod judge;
pub mod keep;
pub mod learn;
pub mod net;
pub mod observe;
pub mod planner;
pub mod report;
pub mod systems;
