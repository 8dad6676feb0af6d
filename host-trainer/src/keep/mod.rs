//! Files that survive a kill: checkpoints, snapshots, learning curves, finished parts.

pub mod checkpoint;
pub mod curves;
pub mod parts;
pub mod snapshot;
pub mod whole;
