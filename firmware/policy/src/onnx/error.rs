//! Why a model file is refused.

use super::ConvertError;
use crate::SelfTestError;
use crate::native::BlobError;

/// Why a model file is refused: what, where, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The bytes are no ONNX model.
    #[error("not an ONNX model ({0}): give the path of an exported model, or copy the file again")]
    NotOnnx(String),
    /// The content is not what was sealed.
    #[error("damaged model: its content has SHA-256 {found}, sealed was {sealed}: copy the file again")]
    Damaged {
        /// What the metadata say.
        sealed: String,
        /// What the content has.
        found: String,
    },
    /// A metadata entry is not there.
    #[error(
        "the model has no metadata entry `{0}`: export it with `gleaner-train export`, or seal it with `gleaner seal`"
    )]
    MissingMetadata(&'static str),
    /// A metadata entry cannot be read.
    #[error("metadata entry `{key}` of the model: {cause}: seal the model again with `gleaner seal`")]
    BadMetadata {
        /// Which entry.
        key: &'static str,
        /// What is wrong with it.
        cause: String,
    },
    /// The model was trained for another observation contract.
    #[error(
        "schema {model:#018x} of the model is not this program's {program:#018x}: retrain, or use the gleaner \
         version that trained it"
    )]
    Schema {
        /// The model's schema hash.
        model: u64,
        /// [`crate::schema::hash`] of this program.
        program: u64,
    },
    /// The model sees another number of devices.
    #[error(
        "the model sees {model} devices, this program shows it {program}: retrain, or use the gleaner version \
         that trained it"
    )]
    KMax {
        /// The model's K_max.
        model: usize,
        /// [`crate::K_MAX`].
        program: usize,
    },
    /// The model's actions are others, or in another order.
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
    /// The graph's inputs or outputs are not the contract's.
    #[error("{0}: correct the export")]
    Interface(String),
    /// The engine cannot run the graph.
    #[error("tract cannot run the model ({0}): correct the export")]
    Engine(String),
    /// The file of the native engine is not fit for it.
    #[error("{0}")]
    Blob(#[from] BlobError),
    /// The file of the native engine was given to another one.
    #[error("this is the native engine's own file: choose the engine native, or give the ONNX file")]
    NativeOnly,
    /// The model has no form for the native engine.
    #[error("{0}")]
    Convert(Box<ConvertError>),
    /// The golden pairs are not reproduced.
    #[error("self-test failed: {0}: do not fly; export the model again, or report this machine")]
    SelfTest(#[from] SelfTestError),
}
