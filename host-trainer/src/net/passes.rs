//! The forward and the backward pass.

use super::attention::{attend, attend_backward};
use super::batch::Batch;
use super::rowwise::{add_and_norm, norm_backward, rectify, rectify_backward};
use super::shape::{EncoderLayout, FIXED_TOKENS, HEAD_INPUTS, LAYERS, Layout, Linear, Shape, WIDTH};
use super::workspace::{Activations, CHUNK, LayerActivations, Scratch, Tokens, Workspace};

/// Runs the network on a batch; returns the outputs, `[samples, shape.outputs]`.
///
/// Keeps in `workspace` what [`backward`] needs.
///
/// # Panics
/// When `parameters` does not have the length that `shape` asks for.
///
/// # Cost
/// About 0.64 million multiply-adds a sample with six devices.
pub fn forward<'a>(
    shape: &Shape,
    parameters: &[f32],
    batch: &Batch,
    workspace: &'a mut Workspace,
) -> &'a [f32] {
    let layout = layout_for(shape, parameters);
    let chunks = batch.len().div_ceil(CHUNK);
    workspace.chunks.resize_with(chunks.max(workspace.chunks.len()), Activations::default);
    workspace.outputs.resize(batch.len() * shape.outputs, 0.0);
    let outputs = workspace.outputs.chunks_mut(CHUNK * shape.outputs);
    for (index, (chunk, outputs)) in workspace.chunks.iter_mut().zip(outputs).enumerate() {
        let first = index * CHUNK;
        chunk.prepare(*shape, batch, first..batch.len().min(first + CHUNK));
        forward_chunk(&layout, parameters, batch, chunk, outputs);
    }
    &workspace.outputs
}

/// Adds to `gradients` the gradient of a loss whose gradient by the outputs is `d_outputs`.
///
/// `workspace` must come from [`forward`] with the same shape, parameters and batch.
///
/// # Panics
/// When a length does not fit `shape` and `batch`.
pub fn backward(
    shape: &Shape,
    parameters: &[f32],
    batch: &Batch,
    workspace: &mut Workspace,
    d_outputs: &[f32],
    gradients: &mut [f32],
) {
    let layout = layout_for(shape, parameters);
    assert_eq!(gradients.len(), layout.len, "one gradient a parameter");
    assert_eq!(d_outputs.len(), batch.len() * shape.outputs, "one gradient an output");
    let Workspace { chunks, scratch, .. } = workspace;
    for (chunk, d_outputs) in chunks.iter().zip(d_outputs.chunks(CHUNK * shape.outputs)) {
        backward_chunk(&layout, parameters, batch, chunk, scratch, d_outputs, gradients);
    }
}

/// [`forward`] and [`backward`] in one, a few samples at a time, so that the activations are still
/// in the cache on the way back. The same result to the last bit.
///
/// `loss` is called with a range of samples, their outputs `[samples, outputs]`, and the place for
/// the gradients by these outputs, all of which it must write.
pub fn forward_backward(
    shape: &Shape,
    parameters: &[f32],
    batch: &Batch,
    workspace: &mut Workspace,
    mut loss: impl FnMut(std::ops::Range<usize>, &[f32], &mut [f32]),
    gradients: &mut [f32],
) {
    let layout = layout_for(shape, parameters);
    assert_eq!(gradients.len(), layout.len, "one gradient a parameter");
    workspace.chunks.resize_with(workspace.chunks.len().max(1), Activations::default);
    workspace.outputs.resize(batch.len() * shape.outputs, 0.0);
    let Workspace { chunks, scratch, outputs } = workspace;
    let chunk = &mut chunks[0];
    let mut d_outputs = [0.0; 256];
    assert!(CHUNK * shape.outputs <= d_outputs.len(), "at most 16 outputs");
    for (index, outputs) in outputs.chunks_mut(CHUNK * shape.outputs).enumerate() {
        let first = index * CHUNK;
        let samples = first..batch.len().min(first + CHUNK);
        chunk.prepare(*shape, batch, samples.clone());
        forward_chunk(&layout, parameters, batch, chunk, outputs);
        let d_outputs = &mut d_outputs[..outputs.len()];
        loss(samples, outputs, d_outputs);
        backward_chunk(&layout, parameters, batch, chunk, scratch, d_outputs, gradients);
    }
}

fn layout_for(shape: &Shape, parameters: &[f32]) -> Layout {
    let layout = Layout::new(*shape);
    assert_eq!(parameters.len(), layout.len, "the flat vector must fit the shape");
    layout
}

/// The projectors in the order of the token rows.
fn projectors(layout: &Layout) -> [Linear; 4] {
    [layout.project_uav, layout.project_preference, layout.project_map, layout.project_device]
}

fn forward_chunk(
    layout: &Layout,
    parameters: &[f32],
    batch: &Batch,
    chunk: &mut Activations,
    outputs: &mut [f32],
) {
    let samples = chunk.samples.len();
    let inputs = chunk.inputs(batch);
    let mut place = &mut chunk.embedded[..];
    for (projector, input) in projectors(layout).into_iter().zip(inputs) {
        let rows = input.len() / projector.inputs;
        let (block, rest) = place.split_at_mut(rows * WIDTH);
        projector.forward(parameters, rows, input, block);
        place = rest;
    }
    let mut x = &chunk.embedded;
    for (encoder, layer) in layout.encoder.iter().zip(&mut chunk.layers) {
        forward_layer(encoder, parameters, &chunk.tokens, x, layer);
        x = &layer.out;
    }
    join(&chunk.tokens, x, &mut chunk.joined, &mut chunk.pooled_from);
    layout.head[0].forward(parameters, samples, &chunk.joined, &mut chunk.hidden);
    rectify(&mut chunk.hidden);
    layout.head[1].forward(parameters, samples, &chunk.hidden, outputs);
}

fn forward_layer(
    encoder: &EncoderLayout,
    parameters: &[f32],
    tokens: &Tokens,
    x: &[f32],
    layer: &mut LayerActivations,
) {
    let rows = tokens.len();
    encoder.qkv.forward(parameters, rows, x, &mut layer.qkv);
    attend(tokens, &layer.qkv, &mut layer.probabilities, &mut layer.mixed);
    encoder.out.forward(parameters, rows, &layer.mixed, &mut layer.middle);
    add_and_norm(
        x,
        encoder.norm1.gain(parameters),
        encoder.norm1.bias(parameters),
        &mut layer.middle,
        &mut layer.normalised1,
        &mut layer.inverse_deviation1,
    );
    encoder.ff1.forward(parameters, rows, &layer.middle, &mut layer.hidden);
    rectify(&mut layer.hidden);
    encoder.ff2.forward(parameters, rows, &layer.hidden, &mut layer.out);
    add_and_norm(
        &layer.middle,
        encoder.norm2.gain(parameters),
        encoder.norm2.bias(parameters),
        &mut layer.out,
        &mut layer.normalised2,
        &mut layer.inverse_deviation2,
    );
}

/// Lays the three fixed tokens and the maximum over the devices side by side; the maximum over no
/// devices is 0.
fn join(tokens: &Tokens, x: &[f32], joined: &mut [f32], pooled_from: &mut [u32]) {
    let places = joined.chunks_exact_mut(HEAD_INPUTS).zip(pooled_from.chunks_exact_mut(WIDTH));
    for ((_, rows), (joined, from)) in tokens.samples().zip(places) {
        let (fixed, pooled) = joined.split_at_mut(FIXED_TOKENS * WIDTH);
        for (place, &row) in fixed.chunks_exact_mut(WIDTH).zip(rows) {
            place.copy_from_slice(token(x, row));
        }
        let Some((&first, others)) = rows[FIXED_TOKENS..].split_first() else {
            pooled.fill(0.0);
            continue;
        };
        pooled.copy_from_slice(token(x, first));
        from.fill(first);
        for &row in others {
            for ((best, from), &value) in pooled.iter_mut().zip(from.iter_mut()).zip(token(x, row)) {
                let larger = value > *best;
                *best = if larger { value } else { *best };
                *from = if larger { row } else { *from };
            }
        }
    }
}

fn token(x: &[f32], row: u32) -> &[f32] {
    &x[row as usize * WIDTH..][..WIDTH]
}

fn backward_chunk(
    layout: &Layout,
    parameters: &[f32],
    batch: &Batch,
    chunk: &Activations,
    scratch: &mut Scratch,
    d_outputs: &[f32],
    gradients: &mut [f32],
) {
    let samples = chunk.samples.len();
    let [head0, head1] = &layout.head;
    head1.backward_parameters(samples, &chunk.hidden, d_outputs, gradients);
    let d_head = cleared(&mut scratch.d_head, chunk.hidden.len());
    head1.backward_input(parameters, samples, d_outputs, d_head);
    rectify_backward(&chunk.hidden, d_head);
    head0.backward_parameters(samples, &chunk.joined, d_head, gradients);
    let d_joined = cleared(&mut scratch.d_joined, chunk.joined.len());
    head0.backward_input(parameters, samples, d_head, d_joined);
    cleared(&mut scratch.d_tokens, chunk.embedded.len());
    separate(&chunk.tokens, &scratch.d_joined, &chunk.pooled_from, &mut scratch.d_tokens);

    for index in (0..LAYERS).rev() {
        let x = if index == 0 { &chunk.embedded } else { &chunk.layers[index - 1].out };
        let (encoder, layer) = (&layout.encoder[index], &chunk.layers[index]);
        backward_layer(encoder, parameters, &chunk.tokens, x, layer, scratch, gradients);
    }

    let mut d = &scratch.d_tokens[..];
    for (projector, input) in projectors(layout).into_iter().zip(chunk.inputs(batch)) {
        let rows = input.len() / projector.inputs;
        let (block, rest) = d.split_at(rows * WIDTH);
        projector.backward_parameters(rows, input, block, gradients);
        d = rest;
    }
}

/// Turns `scratch.d_tokens` from the gradient of the layer's output into that of its input `x`.
fn backward_layer(
    encoder: &EncoderLayout,
    parameters: &[f32],
    tokens: &Tokens,
    x: &[f32],
    layer: &LayerActivations,
    scratch: &mut Scratch,
    gradients: &mut [f32],
) {
    let rows = tokens.len();
    let d = &mut scratch.d_tokens[..];
    let (d_gain, d_bias) = encoder.norm2.split_mut(gradients);
    let gain = encoder.norm2.gain(parameters);
    norm_backward(gain, &layer.normalised2, &layer.inverse_deviation2, d, d_gain, d_bias);
    encoder.ff2.backward_parameters(rows, &layer.hidden, d, gradients);
    let d_hidden = cleared(&mut scratch.d_hidden, layer.hidden.len());
    encoder.ff2.backward_input(parameters, rows, d, d_hidden);
    rectify_backward(&layer.hidden, d_hidden);
    encoder.ff1.backward_parameters(rows, &layer.middle, d_hidden, gradients);
    encoder.ff1.backward_input(parameters, rows, d_hidden, d);

    let (d_gain, d_bias) = encoder.norm1.split_mut(gradients);
    let gain = encoder.norm1.gain(parameters);
    norm_backward(gain, &layer.normalised1, &layer.inverse_deviation1, d, d_gain, d_bias);
    encoder.out.backward_parameters(rows, &layer.mixed, d, gradients);
    let d_mixed = cleared(&mut scratch.d_mixed, layer.mixed.len());
    encoder.out.backward_input(parameters, rows, d, d_mixed);
    let d_qkv = cleared(&mut scratch.d_qkv, layer.qkv.len());
    attend_backward(tokens, &layer.qkv, &layer.probabilities, d_mixed, d_qkv);
    encoder.qkv.backward_parameters(rows, x, d_qkv, gradients);
    encoder.qkv.backward_input(parameters, rows, d_qkv, d);
}

/// The way back through [`join`].
fn separate(tokens: &Tokens, d_joined: &[f32], pooled_from: &[u32], d_tokens: &mut [f32]) {
    let places = d_joined.chunks_exact(HEAD_INPUTS).zip(pooled_from.chunks_exact(WIDTH));
    for ((_, rows), (d_joined, from)) in tokens.samples().zip(places) {
        let (fixed, pooled) = d_joined.split_at(FIXED_TOKENS * WIDTH);
        for (d, &row) in fixed.chunks_exact(WIDTH).zip(rows) {
            d_tokens[row as usize * WIDTH..][..WIDTH].copy_from_slice(d);
        }
        if rows.len() > FIXED_TOKENS {
            for (column, (&row, d)) in from.iter().zip(pooled).enumerate() {
                d_tokens[row as usize * WIDTH + column] = *d;
            }
        }
    }
}

/// A matrix of zeros in memory that is already there.
fn cleared(matrix: &mut Vec<f32>, len: usize) -> &mut [f32] {
    matrix.clear();
    matrix.resize(len, 0.0);
    matrix
}
