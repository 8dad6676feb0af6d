//! Arbitrary bytes as an ONNX model: the reader of its metadata and the converter never panic, and what is accepted
//! can be written again.

use gleaner_policy::native::WeightFormat;
use gleaner_policy::onnx::{convert, unseal};

pub fn run(data: &[u8]) {
    let unsealed = unseal(data);
    if let Ok(blob) = convert(data, WeightFormat::F32) {
        assert!(unsealed.is_ok() && !blob.is_empty());
    }
    if let Err(error) = unsealed {
        assert!(!error.to_string().contains('\n'), "an error is one line: {error}");
    }
}
