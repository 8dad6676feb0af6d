//! Measures systems: the metrics, settings and analyses of the paper.

pub mod comparison;
pub mod evaluation;
pub mod explanation;
pub mod interval;
pub mod lookahead;
pub mod paper;
pub mod pareto;
pub mod robustness;
pub mod validation;
