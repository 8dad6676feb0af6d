//! Why a model file is refused or cannot be converted.

use crate::native::BlobError;
use crate::{LOCAL_MAP_CELLS, SelfTestError};

/// Why a model file is refused.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The bytes are not a whole ONNX model.
    #[error(
        "damaged, or not an ONNX model ({0}): copy the file again, or give the path of an exported model"
    )]
    NotOnnx(String),
    /// A whole ONNX file whose content does not match its seal.
    #[error(
        "altered after sealing, SHA-256 {found} instead of {sealed}: seal a change of your own with `gleaner seal`, or \
         copy the file again"
    )]
    Altered {
        /// Digest in the metadata.
        sealed: String,
        /// Digest of the content.
        found: String,
    },
    /// A metadata entry is missing.
    #[error(
        "the model has no metadata entry `{0}`: export it with `gleaner-train export`, or seal it with `gleaner seal`"
    )]
    MissingMetadata(&'static str),
    /// A metadata entry cannot be read.
    #[error("metadata entry `{key}` of the model: {cause}: seal the model again with `gleaner seal`")]
    BadMetadata {
        /// Key of the entry.
        key: &'static str,
        /// The fault.
        cause: String,
    },
    /// The model was trained for another observation contract.
    #[error(
        "schema {model:#018x} of the model is not this program's {program:#018x}: retrain, or use the gleaner \
         version that trained it"
    )]
    Schema {
        /// The model's hash.
        model: u64,
        /// [`crate::schema::hash`] of this program.
        program: u64,
    },
    /// The model takes another number of devices.
    #[error(
        "the model takes {model} devices, this program provides {program}: retrain, or use the gleaner version \
         that trained it"
    )]
    KMax {
        /// The model's K_max.
        model: usize,
        /// [`crate::K_MAX`].
        program: usize,
    },
    /// The model has other actions, or another order.
    #[error(
        "the model's actions are `{model}`, this program's are `{program}`: retrain, or use the gleaner version \
         that trained it"
    )]
    ActionOrder {
        /// The model's, comma-separated.
        model: String,
        /// This program's, comma-separated.
        program: String,
    },
    /// The graph has other inputs or outputs than the contract.
    #[error("{0}: correct the export")]
    Interface(String),
    /// The engine cannot run the graph.
    #[error("tract cannot run the model ({0}): correct the export")]
    Engine(String),
    /// The native engine refuses its model file.
    #[error("{0}")]
    Blob(#[from] BlobError),
    /// A native model file was given to another engine.
    #[error("a model file of the native engine: choose the engine native, or give the ONNX file")]
    NativeOnly,
    /// tract is not part of this build.
    #[error("this program is built without tract: choose the engine native, or build with --features tract")]
    NoTract,
    /// The model cannot be converted for the native engine.
    #[error("{0}")]
    Convert(Box<ConvertError>),
    /// The engine does not reproduce a golden pair.
    #[error("self-test failed: {0}: do not fly; export the model again, or report this machine")]
    SelfTest(#[from] SelfTestError),
}

/// Why a model cannot be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The model is invalid for every engine.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A weight is missing or has another shape.
    #[error(
        "the model has no weight `{name}` of {rows} x {columns} numbers: use the engine tract, or export the model \
         with `gleaner-train export`"
    )]
    Weight {
        /// Name in the graph.
        name: String,
        /// Outputs.
        rows: usize,
        /// Inputs; 1 for a bias.
        columns: usize,
    },
    /// Name or version is too long for the blob.
    #[error("the {what} `{text}` is longer than {room} bytes: export the model with a shorter one")]
    TooLong {
        /// `name` or `version`.
        what: &'static str,
        /// The text.
        text: String,
        /// Most bytes.
        room: usize,
    },
    /// With the shorter weights a golden pair selects another action.
    #[error("with these weights golden pair {pair} selects another action: convert with --weights f32")]
    Disagrees {
        /// Index of the golden pair.
        pair: usize,
    },
    /// The graph has other operations than the native engine's network.
    #[error("the graph has {found} operations `{operator}` instead of {expected}: use the engine tract")]
    Graph {
        /// Name of the operator.
        operator: &'static str,
        /// Nodes in the graph.
        found: usize,
        /// Nodes in the network.
        expected: usize,
    },
}

/// Why an inference failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InferError {
    /// The local map is incomplete.
    #[error("the local map has {cells} cells, not {LOCAL_MAP_CELLS}")]
    LocalMap {
        /// Its cells.
        cells: usize,
    },
    /// An output is infinite or not a number.
    #[error("an output of the model is not finite")]
    NotFinite,
    /// tract reported an error.
    #[error("tract: {0}")]
    Engine(String),
}
