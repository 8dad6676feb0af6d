//! `gleaner convert`: from the ONNX file to the file of the native engine.

use crate::args::Conversion;
use crate::error::StartError;
use crate::load;
use gleaner_policy::onnx;
use std::fs;
use std::process::ExitCode;

/// Writes the file, after the native engine has reproduced the golden pairs with it.
///
/// # Errors
/// The model cannot be read or converted, or the file cannot be written.
pub fn convert(conversion: &Conversion) -> Result<ExitCode, StartError> {
    let (path, out) = (&conversion.model, &conversion.out);
    let bytes = load::model_bytes(Some(path))?;
    let blob = onnx::convert(&bytes, conversion.weights)
        .map_err(|source| StartError::Convert { path: path.clone(), source })?;
    fs::write(out, &blob).map_err(|source| StartError::Write { path: out.clone(), source })?;
    let (weights, length) = (conversion.weights.name(), blob.len());
    println!("wrote {}: weights {weights}, {length} bytes, golden pairs reproduced", out.display());
    Ok(ExitCode::SUCCESS)
}
