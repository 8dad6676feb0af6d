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
//! `train` reads top to bottom; what it calls lives beside it: [`flight`] and [`encoding`] make samples,
//! [`replay`] keeps them, [`mosac`] or [`ddqn`] learns from them (what the loop asks of either is [`learner`]),
//! [`validation`] and [`evaluation`] judge, [`checkpoint`] survives a kill, [`learned`] is what is left, [`export`]
//! writes the model. The networks themselves are [`net`]; [`system`] lists what can be trained.
//!
//! The policies that fly come another way: [`distil`] copies the [`teacher`], who knows what the aircraft cannot see,
//! and [`refine`] lets the pupil learn from its own flights. What one loop asks of all three ways is [`learning`]. What
//! they are measured against is the [`oracle`]: the best tour that the [`planner`] finds for someone who knows
//! everything, and a proven bound on what anyone can have.

pub mod checkpoint;
pub mod curves;
pub mod ddqn;
pub mod distil;
pub mod encoding;
pub mod evaluation;
pub mod explanation;
pub mod export;
pub mod flight;
pub mod greedy;
pub mod learned;
pub mod learner;
pub mod learning;
pub mod maps;
pub mod mosac;
pub mod net;
pub mod observation;
pub mod oracle;
pub mod paper;
pub mod paper_tokens;
pub mod pareto;
pub mod parts;
pub mod planner;
pub mod refine;
pub mod replay;
pub mod report;
pub mod robustness;
pub mod settings;
pub mod system;
pub mod teacher;
pub mod train;
pub mod validation;
pub mod variety;
pub mod whole;
