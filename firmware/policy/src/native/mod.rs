//! The native engine: the attention network without operating system or heap, with weights used where they are in flash.
//!
//! # Glossary
//! - **blob**: the model file of this engine (`.gln`), made from the ONNX file by `onnx::convert`. [`Model`] reads it in
//!   place.
//! - **lane**: the position of one token in a block.
//! - **block**: up to five tokens side by side, feature by feature: `[features][lanes]`. Only the blocks that the present
//!   tokens need are computed.
//! - **panel**: the weights of neighbouring outputs of a linear layer, `[inputs][outputs]`, so that the kernel reads them
//!   in order.
//!
//! # Two implementations, and which one is exact
//! - [`NativePolicy`] is portable and **bit-exact**: every output is the same chain of additions and multiplications on
//!   every machine, so a microcontroller and a host give the same bits.
//! - `SimdPolicy` (feature `std`) uses the host's vector unit, fused multiply-adds and repacked weights. Its logits agree
//!   with [`NativePolicy`] within 1e-5, and its masked decisions on the 110,000 test observations are the same. It is not
//!   bit-exact. Use [`NativePolicy`] to compare a host with a board.
//!
//! # When you may trust it
//! [`Model::read`] checks that a blob is complete and has this program's observation contract. [`crate::self_test`] with
//! [`Model::goldens`] checks that the engine reproduces the trained model; every program runs it before flying. Lanes
//! without a token are computed like the others, and their results are not used.

mod aligned;
mod attention;
mod format;
mod forward;
mod kernel;
mod model;
mod network;
mod reader;
mod rowwise;
mod shape;
#[cfg(feature = "std")]
mod simd;

pub use aligned::Aligned;
#[cfg(feature = "std")]
pub use aligned::AlignedBytes;
pub use format::{FORMAT, MAGIC, WeightFormat};
#[cfg(feature = "std")]
pub(crate) use format::{Header, SOURCE_BYTES, crc32};
pub use forward::{NativeError, NativePolicy, Workspace};
pub use model::Model;
pub use reader::BlobError;
#[cfg(feature = "std")]
pub(crate) use shape::{
    FEED_FORWARD, HEAD_HIDDEN, HEAD_INPUTS, HEAD_WIDTH, LAYERS, LOGIT_PANELS, PANEL, WIDTH,
};
#[cfg(feature = "std")]
pub use simd::SimdPolicy;
