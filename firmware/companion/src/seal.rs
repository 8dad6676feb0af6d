//! `gleaner seal`: makes an ONNX model of one's own flyable.

use crate::args::Sealing;
use crate::error::StartError;
use std::process::ExitCode;
#[cfg(feature = "tract")]
use {
    crate::contract::{SealError, sealed},
    crate::load,
    gleaner_policy::onnx::ModelCard,
    std::fs,
};

/// Writes the sealed file.
///
/// # Errors
/// The model cannot be read, does not keep the contract, or the file cannot be written.
#[cfg(feature = "tract")]
pub fn run(order: &Sealing) -> Result<ExitCode, StartError> {
    let path = &order.model;
    let bytes = load::model_bytes(Some(path))?;
    let card = ModelCard {
        name: order.name.clone(),
        version: order.model_version.clone(),
        command: "gleaner seal".into(),
        scenario: order.scenario.clone(),
        ..ModelCard::default()
    };
    let refused = |source: SealError| StartError::Seal { path: path.clone(), source };
    let sealed = sealed(&bytes, card).map_err(refused)?;
    fs::write(&order.out, &sealed.bytes)
        .map_err(|source| StartError::Write { path: order.out.clone(), source })?;
    println!(
        "wrote {}: {} parameters, {} golden pairs",
        order.out.display(),
        sealed.parameters,
        sealed.goldens
    );
    if !sealed.varies {
        println!("warning: the model gives the same answer to every observation");
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses: the graph of a model of one's own runs in tract only.
///
/// # Errors
/// Always.
#[cfg(not(feature = "tract"))]
pub fn run(_: &Sealing) -> Result<ExitCode, StartError> {
    Err(StartError::NoTract)
}
