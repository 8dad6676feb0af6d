//! The tract engine.

use super::error::{InferError, ModelError};
use super::interface::{INPUTS, OUTPUTS};
use super::metadata::{ModelInfo, unseal};
use crate::schema::DEVICE_FEATURES;
use crate::{Attention, Golden, Inference, K_MAX, LOCAL_MAP_CELLS, Policy, Tokens, self_test};
use gleaner_units::Action;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::internal::{TypedSimpleState, format_err, tract_ndarray::ArrayD};

/// The tract engine with a model: one observation at a time, on the calling thread.
pub struct TractPolicy {
    info: ModelInfo,
    goldens: Vec<Golden>,
    state: TypedSimpleState,
    /// In [`INPUTS`] order; overwritten for each inference.
    inputs: [Arc<Tensor>; INPUTS.len()],
}

impl TractPolicy {
    /// Reads and checks a model and runs the self-test. Programs that fly load models with this function.
    ///
    /// # Errors
    /// [`ModelError`] for a model that must not fly. Never panics.
    pub fn load_checked(bytes: &[u8]) -> Result<TractPolicy, ModelError> {
        let mut policy = TractPolicy::from_bytes(bytes)?;
        let goldens = std::mem::take(&mut policy.goldens);
        let verdict = catch(|| Ok(self_test(&mut policy, &goldens)))?;
        policy.goldens = goldens;
        verdict?;
        Ok(policy)
    }

    /// As [`TractPolicy::load_checked`] without the self-test, to measure the difference to the golden pairs. Do not fly
    /// with it.
    ///
    /// # Errors
    /// All but [`ModelError::SelfTest`].
    pub fn from_bytes(bytes: &[u8]) -> Result<TractPolicy, ModelError> {
        let (_, info, goldens) = unseal(bytes)?;
        let state = catch(|| build(bytes).map_err(|cause| ModelError::Engine(one_line(&cause))))?;
        let inputs = INPUTS.map(|port| Arc::new(zeros(port.shape)));
        Ok(TractPolicy { info, goldens, state, inputs })
    }

    /// Origin and identity of the model.
    #[must_use]
    pub fn info(&self) -> &ModelInfo {
        &self.info
    }

    /// The golden pairs.
    #[must_use]
    pub fn goldens(&self) -> &[Golden] {
        &self.goldens
    }

    fn write_inputs(&mut self, tokens: &Tokens) -> TractResult<()> {
        let mut present = [0.0; K_MAX];
        let mut rows = [[0.0; DEVICE_FEATURES]; K_MAX];
        for ((row, flag), device) in rows.iter_mut().zip(&mut present).zip(&tokens.devices) {
            *row = *device;
            *flag = 1.0;
        }
        let [uav, devices, mask, preference, map] = &mut self.inputs;
        overwrite(uav, &tokens.uav)?;
        overwrite(devices, rows.as_flattened())?;
        overwrite(mask, &present)?;
        overwrite(preference, &tokens.preference)?;
        overwrite(map, &tokens.local_map)
    }

    fn run(&mut self, tokens: &Tokens) -> TractResult<Inference> {
        self.write_inputs(tokens)?;
        let inputs = self.inputs.iter().map(|input| TValue::from_const(input.clone())).collect();
        let outputs = self.state.run(inputs)?;
        let mut answer = Inference { logits: [0.0; Action::COUNT], attention: Attention::NONE };
        if let [logits, attention] = &outputs[..] {
            answer.logits.copy_from_slice(logits.try_as_plain_ram()?.as_slice::<f32>()?);
            let attention = attention.try_as_plain_ram()?;
            answer.attention.0.as_flattened_mut().copy_from_slice(attention.as_slice::<f32>()?);
        }
        Ok(answer)
    }
}

impl Policy for TractPolicy {
    type Error = InferError;

    /// # Cost
    /// About 0.7 million multiply-adds with any number of devices, because absent ones are computed too. tract allocates
    /// its intermediate tensors in each call.
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, InferError> {
        if tokens.local_map.len() != LOCAL_MAP_CELLS {
            return Err(InferError::LocalMap { cells: tokens.local_map.len() });
        }
        let answer = self.run(tokens).map_err(|cause| {
            // State of the failed run must not reach the next one.
            let _ = self.state.reset_turn();
            InferError::Engine(one_line(&cause))
        })?;
        let attention = answer.attention.0.as_flattened();
        if answer.logits.iter().chain(attention).all(|number| number.is_finite()) {
            Ok(answer)
        } else {
            Err(InferError::NotFinite)
        }
    }
}

/// The optimised graph with a batch of one.
fn build(mut bytes: &[u8]) -> TractResult<TypedSimpleState> {
    let mut graph = tract_onnx::onnx().model_for_read(&mut bytes)?;
    graph.set_input_names(INPUTS.map(|port| port.name))?;
    graph.select_outputs_by_name(OUTPUTS.map(|port| port.name))?;
    for (index, port) in INPUTS.iter().enumerate() {
        graph.set_input_fact(index, f32::fact(with_batch(port.shape)).into())?;
    }
    let graph = graph.into_optimized()?;
    for (index, port) in OUTPUTS.iter().enumerate() {
        let fact = graph.output_fact(index)?;
        let shape = with_batch(port.shape);
        if fact.datum_type != f32::datum_type() || fact.shape.as_concrete() != Some(&shape[..]) {
            return Err(format_err!("output `{}` has the type {fact:?}", port.name));
        }
    }
    graph.into_runnable()?.spawn()
}

fn with_batch(shape: &[usize]) -> Vec<usize> {
    [&[1], shape].concat()
}

fn zeros(shape: &[usize]) -> Tensor {
    ArrayD::<f32>::zeros(with_batch(shape)).into()
}

/// Overwrites a tensor; copies it first if tract still holds a reference.
fn overwrite(tensor: &mut Arc<Tensor>, numbers: &[f32]) -> TractResult<()> {
    Arc::make_mut(tensor).try_as_plain_ram_mut()?.as_slice_mut::<f32>()?.copy_from_slice(numbers);
    Ok(())
}

/// Turns a panic of tract, which some malformed graphs cause, into an error.
fn catch<T>(work: impl FnOnce() -> Result<T, ModelError>) -> Result<T, ModelError> {
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(ModelError::Engine("it panicked on the graph".into())))
}

fn one_line(cause: &TractError) -> String {
    format!("{cause:#}").split_whitespace().collect::<Vec<_>>().join(" ")
}
