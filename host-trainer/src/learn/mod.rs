//! The learning algorithms.
//!
//! [`run`] is the off-policy loop of [`mosac`] and [`ddqn`]; [`distil`] imitates a teacher; [`ppo`] refines a policy
//! from its own flights. All three are a [`trainer::Trainer`].

pub mod algorithm;
mod constants;
pub mod ddqn;
pub mod distil;
pub mod mosac;
mod n_step;
pub mod policy;
pub mod ppo;
pub mod replay;
mod resume;
pub mod run;
mod teaching;
pub mod trainer;
