//! Forward and backward pass.

use super::attention::{attend, attend_backward};
use super::batch::Batch;
use super::matrix::CutWeights;
use super::rowwise::{add_and_norm, norm_backward, rectify_backward};
use super::shape::{EncoderLayout, FIXED_TOKENS, HEAD_INPUTS, LAYERS, Layout, Linear, Shape, WIDTH};
use super::workspace::{Activations, CHUNK, LayerActivations, Scratch, Tokens, Workspace};

/// Runs the network on a batch; returns the outputs, `[samples, shape.outputs]`.
///
/// Stores the activations that [`backward`] needs in `workspace`.
///
/// # Panics
/// When `parameters` has another length than `shape`.
///
/// # Cost
/// About 0.64 million multiply-adds per sample with six devices.
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
    workspace.forward_weights.cut_forward(layout.linears(), parameters);
    let net = Net { layout: &layout, parameters, weights: &workspace.forward_weights };
    let outputs = workspace.outputs.chunks_mut(CHUNK * shape.outputs);
    for (index, (chunk, outputs)) in workspace.chunks.iter_mut().zip(outputs).enumerate() {
        let first = index * CHUNK;
        chunk.prepare(*shape, batch, first..batch.len().min(first + CHUNK));
        forward_chunk(net, batch, chunk, outputs);
    }
    &workspace.outputs
}

/// The outputs of [`forward`], bit for bit, without the activations for [`backward`]. All chunks use the same memory, so
/// that large batches stay in the cache. Afterwards [`Workspace::attention`] is valid for the last chunk only.
pub fn answer<'a>(
    shape: &Shape,
    parameters: &[f32],
    batch: &Batch,
    workspace: &'a mut Workspace,
) -> &'a [f32] {
    let layout = layout_for(shape, parameters);
    workspace.chunks.resize_with(workspace.chunks.len().max(1), Activations::default);
    workspace.outputs.resize(batch.len() * shape.outputs, 0.0);
    workspace.forward_weights.cut_forward(layout.linears(), parameters);
    let net = Net { layout: &layout, parameters, weights: &workspace.forward_weights };
    let chunk = &mut workspace.chunks[0];
    for (index, outputs) in workspace.outputs.chunks_mut(CHUNK * shape.outputs).enumerate() {
        let first = index * CHUNK;
        chunk.prepare(*shape, batch, first..batch.len().min(first + CHUNK));
        forward_chunk(net, batch, chunk, outputs);
    }
    &workspace.outputs
}

/// Adds the gradient of a loss to `gradients`, from `d_outputs`, its gradient with respect to the outputs.
///
/// `workspace` must come from [`forward`] with the same shape, parameters and batch.
///
/// # Panics
/// When a length does not match `shape` and `batch`.
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
    workspace.backward_weights.cut_backward(layout.linears(), parameters);
    let Workspace { chunks, scratch, backward_weights: weights, .. } = workspace;
    let net = Net { layout: &layout, parameters, weights };
    for (chunk, d_outputs) in chunks.iter().zip(d_outputs.chunks(CHUNK * shape.outputs)) {
        backward_chunk(net, batch, chunk, scratch, d_outputs, gradients);
    }
}

/// [`forward`] and [`backward`] chunk by chunk, so that the activations are still in the cache for the backward pass. The
/// result is the same bit for bit.
///
/// `loss` receives a range of samples and their outputs `[samples, outputs]`, and writes the loss's gradient with respect
/// to each of these outputs.
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
    workspace.forward_weights.cut_forward(layout.linears(), parameters);
    workspace.backward_weights.cut_backward(layout.linears(), parameters);
    let Workspace { chunks, scratch, outputs, forward_weights, backward_weights } = workspace;
    let ahead = Net { layout: &layout, parameters, weights: forward_weights };
    let back = Net { weights: backward_weights, ..ahead };
    let chunk = &mut chunks[0];
    let mut d_outputs = std::mem::take(&mut scratch.d_outputs);
    for (index, outputs) in outputs.chunks_mut(CHUNK * shape.outputs).enumerate() {
        let first = index * CHUNK;
        let samples = first..batch.len().min(first + CHUNK);
        chunk.prepare(*shape, batch, samples.clone());
        forward_chunk(ahead, batch, chunk, outputs);
        d_outputs.resize(outputs.len(), 0.0);
        loss(samples, outputs, &mut d_outputs);
        backward_chunk(back, batch, chunk, scratch, &d_outputs, gradients);
    }
    scratch.d_outputs = d_outputs;
}

/// A network, and its weights in panels for one pass.
#[derive(Clone, Copy)]
struct Net<'a> {
    layout: &'a Layout,
    parameters: &'a [f32],
    weights: &'a CutWeights,
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

fn forward_chunk(net: Net<'_>, batch: &Batch, chunk: &mut Activations, outputs: &mut [f32]) {
    let Net { layout, parameters, weights } = net;
    let projectors = projectors(layout);
    let inputs = chunk.inputs(batch, projectors.map(|projector| projector.inputs));
    let mut place = &mut chunk.embedded[..];
    for (projector, input) in projectors.into_iter().zip(inputs) {
        let (block, rest) = place.split_at_mut(input.len() / projector.inputs * WIDTH);
        projector.forward(parameters, weights, input, block);
        place = rest;
    }
    let mut x = &chunk.embedded;
    for (encoder, layer) in layout.encoder.iter().zip(&mut chunk.layers) {
        forward_layer(net, encoder, &chunk.tokens, x, layer);
        x = &layer.out;
    }
    join(&chunk.tokens, x, &mut chunk.joined, &mut chunk.pooled_from);
    layout.head[0].forward_rectified(parameters, weights, &chunk.joined, &mut chunk.hidden);
    layout.head[1].forward(parameters, weights, &chunk.hidden, outputs);
}

fn forward_layer(
    net: Net<'_>,
    encoder: &EncoderLayout,
    tokens: &Tokens,
    x: &[f32],
    layer: &mut LayerActivations,
) {
    let Net { parameters, weights, .. } = net;
    encoder.qkv.forward(parameters, weights, x, &mut layer.qkv);
    attend(tokens, &layer.qkv, &mut layer.probabilities, &mut layer.mixed);
    encoder.out.forward(parameters, weights, &layer.mixed, &mut layer.middle);
    add_and_norm(
        x,
        encoder.norm1.gain(parameters),
        encoder.norm1.bias(parameters),
        &mut layer.middle,
        &mut layer.normalised1,
        &mut layer.inverse_deviation1,
    );
    encoder.ff1.forward_rectified(parameters, weights, &layer.middle, &mut layer.hidden);
    encoder.ff2.forward(parameters, weights, &layer.hidden, &mut layer.out);
    add_and_norm(
        &layer.middle,
        encoder.norm2.gain(parameters),
        encoder.norm2.bias(parameters),
        &mut layer.out,
        &mut layer.normalised2,
        &mut layer.inverse_deviation2,
    );
}

/// Concatenates the three fixed tokens and the maximum over the devices. Without devices the maximum is 0.
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
    net: Net<'_>,
    batch: &Batch,
    chunk: &Activations,
    scratch: &mut Scratch,
    d_outputs: &[f32],
    gradients: &mut [f32],
) {
    let Net { layout, weights, .. } = net;
    scratch.prepare(chunk);
    let [head0, head1] = &layout.head;
    head1.backward_parameters(&chunk.hidden, d_outputs, &mut scratch.panels, gradients);
    head1.backward_input(weights, d_outputs, &mut scratch.d_head);
    rectify_backward(&chunk.hidden, &mut scratch.d_head);
    head0.backward_parameters(&chunk.joined, &scratch.d_head, &mut scratch.panels, gradients);
    head0.backward_input(weights, &scratch.d_head, &mut scratch.d_joined);
    separate(&chunk.tokens, &scratch.d_joined, &chunk.pooled_from, &mut scratch.d_tokens);

    for index in (0..LAYERS).rev() {
        let x = if index == 0 { &chunk.embedded } else { &chunk.layers[index - 1].out };
        let (encoder, layer) = (&layout.encoder[index], &chunk.layers[index]);
        backward_layer(net, encoder, &chunk.tokens, x, layer, scratch, gradients);
    }

    let mut d = &scratch.d_tokens[..];
    let projectors = projectors(layout);
    let inputs = chunk.inputs(batch, projectors.map(|projector| projector.inputs));
    for (projector, input) in projectors.into_iter().zip(inputs) {
        let (block, rest) = d.split_at(input.len() / projector.inputs * WIDTH);
        projector.backward_parameters(input, block, &mut scratch.panels, gradients);
        d = rest;
    }
}

/// Backward pass of one encoder layer. On entry `scratch.d_tokens` is the gradient with respect to the layer's output, on
/// return that with respect to its input `x`.
fn backward_layer(
    net: Net<'_>,
    encoder: &EncoderLayout,
    tokens: &Tokens,
    x: &[f32],
    layer: &LayerActivations,
    scratch: &mut Scratch,
    gradients: &mut [f32],
) {
    let Net { parameters, weights, .. } = net;
    let Scratch { d_tokens: d, d_hidden, d_mixed, d_qkv, panels, .. } = scratch;
    let (d_gain, d_bias) = encoder.norm2.split_mut(gradients);
    let gain = encoder.norm2.gain(parameters);
    norm_backward(gain, &layer.normalised2, &layer.inverse_deviation2, d, d_gain, d_bias);
    encoder.ff2.backward_parameters(&layer.hidden, d, panels, gradients);
    encoder.ff2.backward_input(weights, d, d_hidden);
    rectify_backward(&layer.hidden, d_hidden);
    encoder.ff1.backward_parameters(&layer.middle, d_hidden, panels, gradients);
    encoder.ff1.add_backward_input(weights, d_hidden, d);

    let (d_gain, d_bias) = encoder.norm1.split_mut(gradients);
    let gain = encoder.norm1.gain(parameters);
    norm_backward(gain, &layer.normalised1, &layer.inverse_deviation1, d, d_gain, d_bias);
    encoder.out.backward_parameters(&layer.mixed, d, panels, gradients);
    encoder.out.backward_input(weights, d, d_mixed);
    attend_backward(tokens, &layer.qkv, &layer.probabilities, d_mixed, d_qkv);
    encoder.qkv.backward_parameters(x, d_qkv, panels, gradients);
    encoder.qkv.add_backward_input(weights, d_qkv, d);
}

/// Backward pass of [`join`].
fn separate(tokens: &Tokens, d_joined: &[f32], pooled_from: &[u32], d_tokens: &mut [f32]) {
    let places = d_joined.chunks_exact(HEAD_INPUTS).zip(pooled_from.chunks_exact(WIDTH));
    for ((_, rows), (d_joined, from)) in tokens.samples().zip(places) {
        let (fixed, pooled) = d_joined.split_at(FIXED_TOKENS * WIDTH);
        for (d, &row) in fixed.chunks_exact(WIDTH).zip(rows) {
            d_tokens[row as usize * WIDTH..][..WIDTH].copy_from_slice(d);
        }
        for &row in &rows[FIXED_TOKENS..] {
            d_tokens[row as usize * WIDTH..][..WIDTH].fill(0.0);
        }
        if rows.len() > FIXED_TOKENS {
            for (column, (&row, d)) in from.iter().zip(pooled).enumerate() {
                d_tokens[row as usize * WIDTH + column] = *d;
            }
        }
    }
}
