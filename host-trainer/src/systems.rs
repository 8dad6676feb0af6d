//! The systems that can be trained: names, algorithms, parameter counts. The only file that names all of them.
//!
//! The paper prints 91,781 parameters for MOSAC-ATT and 165,829 for MOSAC-CGL. Its text does not give the layer sizes
//! behind these numbers. Ours follow the text, and the counts differ:
//!
//! | system | network that selects actions | parameters |
//! |---|---|---|
//! | Gleaner | as drawn in [`crate::net`]: MOSAC-ATT with 81 cells of a yield map instead of 100 cells of heights, the vantage point of each device, and a head of 64 units instead of the 128 of the text, to stay below the paper's count | 89,989 |
//! | MOSAC-ATT | the same with 10 x 10 heights, 5 features per device and a head of 128 | 107,845 |
//! | MOSAC-ATT, four layers | the same with 10 x 10 cells of 4 layers | 127,045 |
//! | MOSAC-CGL | two branches of two 5 x 5 x 16 convolutions on 10 x 10 and 15 x 11 cells of 4 layers, 336 + 64 features, battery, both weights, 256, 256, 5 | 186,565 |
//! | DDQN-CGL | the same with ten values | 187,850 |
//! | MOSAC-FTV | 4 + 12 x 5 features, both weights, 256, 256, 5 | 84,229 |
//!
//! 165,829 would need 320 features from the convolutions and two beside them: a global map of 12 x 12 cells, which a
//! 40 x 30 grid centred and pooled by 5 does not give, and a preference of one number. The paper takes MOSAC-FTV from
//! earlier work without its sizes; it has the same hidden layers here.

use crate::judge::evaluation::Decider;
use crate::keep::checkpoint::CheckpointError;
use crate::keep::snapshot::{SNAPSHOT, Snapshot};
use crate::learn::algorithm::Algorithm;
use crate::learn::ddqn::Ddqn;
use crate::learn::mosac::Mosac;
use crate::learn::policy::NetworkPolicy;
use crate::net::Architecture;
use crate::observe::layers::LayeredTokens;
use crate::observe::maps::Maps;
use crate::observe::paper_tokens::PaperTokens;
use crate::observe::tokens::PolicyTokens;
use crate::observe::vector::FeatureVector;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use thiserror::Error;

/// Soft actor-critic with attention on the tokens of the shipped policy.
pub type Gleaner = Mosac<PolicyTokens>;
/// Soft actor-critic with attention on the paper's tokens.
pub type MosacAtt = Mosac<PaperTokens>;
/// The same with all four layers of the local map.
pub type MosacAttLayers = Mosac<LayeredTokens>;
/// Soft actor-critic on centred maps.
pub type MosacCgl = Mosac<Maps>;
/// Soft actor-critic on a feature vector.
pub type MosacFtv = Mosac<FeatureVector>;
/// Double deep Q-network on centred maps.
pub type DdqnCgl = Ddqn<Maps>;

/// A learning algorithm with an encoding (paper, section V-B).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum System {
    /// Soft actor-critic, tokens with the yield map, attention: the shipped policy.
    #[default]
    Gleaner,
    /// Soft actor-critic, the paper's tokens, attention.
    MosacAtt,
    /// Soft actor-critic, the paper's tokens with four map layers, attention.
    MosacAttLayers,
    /// Soft actor-critic, centred local and global maps, convolutions.
    MosacCgl,
    /// Double deep Q-network, the same maps.
    DdqnCgl,
    /// Soft actor-critic, feature vector, feed-forward.
    MosacFtv,
}

/// A name that belongs to no system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("unknown system: use gleaner, mosac-att, mosac-att-four-layers, mosac-cgl, ddqn-cgl or mosac-ftv")]
pub struct UnknownSystem;

/// Calls a generic function with the algorithm of a system.
macro_rules! with_algorithm {
    ($system:expr, $algorithm:ident => $body:expr) => {
        match $system {
            System::Gleaner => {
                type $algorithm = Gleaner;
                $body
            }
            System::MosacAtt => {
                type $algorithm = MosacAtt;
                $body
            }
            System::MosacAttLayers => {
                type $algorithm = MosacAttLayers;
                $body
            }
            System::MosacCgl => {
                type $algorithm = MosacCgl;
                $body
            }
            System::DdqnCgl => {
                type $algorithm = DdqnCgl;
                $body
            }
            System::MosacFtv => {
                type $algorithm = MosacFtv;
                $body
            }
        }
    };
}

impl System {
    /// All systems, those of the paper in its order.
    pub const ALL: [System; 6] = [
        System::Gleaner,
        System::MosacAtt,
        System::MosacAttLayers,
        System::DdqnCgl,
        System::MosacCgl,
        System::MosacFtv,
    ];

    /// Name in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        with_algorithm!(self, A => A::NAME)
    }

    /// Name in tables, the paper's where it has one.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            System::Gleaner => "Gleaner",
            System::MosacAtt => "MOSAC-ATT",
            System::MosacAttLayers => "MOSAC-ATT, four layers",
            System::MosacCgl => "MOSAC-CGL",
            System::DdqnCgl => "DDQN-CGL",
            System::MosacFtv => "MOSAC-FTV",
        }
    }

    /// Parameters of the network that selects actions.
    #[must_use]
    pub fn parameter_count(self) -> usize {
        with_algorithm!(self, A => A::network().parameter_count())
    }

    /// The count that the paper prints.
    #[must_use]
    pub const fn parameter_count_in_paper(self) -> Option<usize> {
        match self {
            System::MosacAtt => Some(91_781),
            System::MosacCgl => Some(165_829),
            System::Gleaner | System::MosacAttLayers | System::DdqnCgl | System::MosacFtv => None,
        }
    }

    /// The policy of a snapshot of this system, for evaluations in any city.
    #[must_use]
    pub fn policy(self, snapshot: &Snapshot) -> Box<dyn Decider + '_> {
        with_algorithm!(self, A => Box::new(NetworkPolicy::<A>::new(&snapshot.actor)))
    }

    /// Whether its network has attention.
    #[must_use]
    pub const fn has_attention(self) -> bool {
        matches!(self, System::Gleaner | System::MosacAtt | System::MosacAttLayers)
    }

    /// Whether its models can be exported for the aircraft.
    #[must_use]
    pub const fn is_exportable(self) -> bool {
        matches!(self, System::Gleaner)
    }
}

impl fmt::Display for System {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for System {
    type Err = UnknownSystem;

    fn from_str(name: &str) -> Result<System, UnknownSystem> {
        System::ALL.into_iter().find(|system| system.name() == name).ok_or(UnknownSystem)
    }
}

/// Why a snapshot cannot be used.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// The file.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// It names no known system.
    #[error("{}: names no system of this version; train again", path.display())]
    UnknownSystem {
        /// The file.
        path: PathBuf,
    },
    /// Its network has another size.
    #[error(
        "{}: has {found} parameters, but {system} has {expected} in this version; train again",
        path.display()
    )]
    OtherNetwork {
        /// The file.
        path: PathBuf,
        /// The system that it names.
        system: System,
        /// Parameters in the file.
        found: usize,
        /// Parameters of the system.
        expected: usize,
    },
    /// It belongs to another system than the command needs.
    #[error("{}: holds a policy of {found}; give a run of {expected}", path.display())]
    OtherSystem {
        /// The file.
        path: PathBuf,
        /// Its system.
        found: System,
        /// The system that the command needs.
        expected: System,
    },
}

/// Reads and checks the snapshot in `folder`; `None` if there is none yet.
///
/// # Errors
/// See [`SnapshotError`].
pub fn load(folder: &Path) -> Result<Option<(System, Snapshot)>, SnapshotError> {
    let Some(snapshot) = Snapshot::load(folder)? else { return Ok(None) };
    let path = || folder.join(SNAPSHOT);
    let Ok(system) = snapshot.system.parse::<System>() else {
        return Err(SnapshotError::UnknownSystem { path: path() });
    };
    let (found, expected) = (snapshot.actor.len(), system.parameter_count());
    if found != expected {
        return Err(SnapshotError::OtherNetwork { path: path(), system, found, expected });
    }
    Ok(Some((system, snapshot)))
}

/// As [`load`], for a command that needs one system.
///
/// # Errors
/// See [`SnapshotError`].
pub fn load_of(expected: System, folder: &Path) -> Result<Option<Snapshot>, SnapshotError> {
    match load(folder)? {
        Some((found, _)) if found != expected => {
            Err(SnapshotError::OtherSystem { path: folder.join(SNAPSHOT), found, expected })
        }
        loaded => Ok(loaded.map(|(_, snapshot)| snapshot)),
    }
}

#[cfg(test)]
mod tests;
