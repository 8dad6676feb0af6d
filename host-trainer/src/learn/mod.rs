//! The learning algorithms and the loop that runs them.

pub mod ddqn;
pub mod distil;
pub mod learner;
pub mod learning;
pub mod mosac;
pub mod ppo;
pub mod replay;
pub mod run;
pub mod settings;
