//! The actor as an ONNX graph.
//!
//! The tokens of all samples are rows of one matrix, `[N * 15, 64]`, so that every linear layer is one `Gemm` with the
//! weight in the trainer's layout. Absent devices are masked at three places: their features are set to zero, the
//! attention gives them no weight, and the pooling skips them.

use super::builder::{Builder, float, int, ints};
use crate::net::{HEAD_WIDTH, HEADS, LAYER_NORM_EPSILON, LAYERS, Shape, WIDTH};
use gleaner_policy::onnx::pb::GraphProto;
use gleaner_policy::onnx::{INPUTS, OUTPUTS};
use gleaner_policy::schema::{self, Normalisation};
use gleaner_policy::{FIRST_DEVICE_TOKEN, K_MAX, TOKENS};

/// Added to the score of an absent key. It is far below any score, so that the weight after the softmax is exactly zero,
/// and finite, so that no engine computes NaN.
const MASKED_SCORE: f32 = -1e9;
/// Less than any feature: the value of absent devices in the pooling.
const LOWEST: f32 = f32::MIN;

/// The graph of an actor with [`INPUTS`] and [`OUTPUTS`].
pub(super) fn actor(parameters: &[f32], shape: Shape) -> GraphProto {
    let mut net = Net { graph: Builder::new("gleaner-policy", &INPUTS) };
    for tensor in shape.tensors() {
        let matrix = [tensor.rows, tensor.cols];
        let is_matrix = tensor.name.ends_with("weight") && !tensor.name.contains("norm");
        let dims = if is_matrix { &matrix[..] } else { &matrix[..1] };
        net.graph.floats(&tensor.name, dims, tensor.of(parameters));
    }
    net.constants();
    net.masks();
    let mut tokens = net.embed();
    for layer in 0..LAYERS {
        tokens = net.encode(layer, &tokens);
    }
    net.attention_out();
    let features = net.pool(&tokens);
    let hidden = net.linear("head.0", &features, "head.hidden");
    let hidden = net.graph.node("Relu", &[&hidden], "head.relu");
    net.linear("head.1", &hidden, "logits");
    net.graph.finish(&OUTPUTS)
}

struct Net {
    graph: Builder,
}

impl Net {
    fn constants(&mut self) {
        let graph = &mut self.graph;
        graph.floats("zero", &[1], &[0.0]);
        graph.floats("half", &[1], &[0.5]);
        graph.floats("lowest", &[1], &[LOWEST]);
        graph.floats("masked_score", &[1], &[MASKED_SCORE]);
        graph.floats("score_scale", &[1], &[1.0 / (HEAD_WIDTH as f32).sqrt()]);
        graph.integers("axis.0", &[0]);
        graph.integers("axis.1", &[1]);
        graph.integers("axis.2", &[2]);
        graph.integers("axes.1_2", &[1, 2]);
        graph.integers("rows.device_features", &[-1, schema::normalisations("devices").count() as i64]);
        graph.integers("rows.width", &[-1, WIDTH as i64]);
        graph.integers("per_sample.one", &[-1, 1, WIDTH as i64]);
        graph.integers("per_sample.devices", &[-1, K_MAX as i64, WIDTH as i64]);
        graph.integers("per_sample.tokens", &[-1, TOKENS as i64, WIDTH as i64]);
        graph.integers("per_sample.qkv", &[-1, TOKENS as i64, 3, HEADS as i64, HEAD_WIDTH as i64]);
        graph.integers("split.tokens", &[1, 1, 1, K_MAX as i64]);
    }

    /// `present` `[N,12,1]`, boolean; `tokens.flag` `[N,15]`, 1 or 0; `key_bias` `[N,1,1,15]`.
    fn masks(&mut self) {
        let graph = &mut self.graph;
        let flat = graph.node("Greater", &["device_mask", "half"], "present.flat");
        graph.node("Unsqueeze", &[&flat, "axis.2"], "present");
        let flags = graph.node_with("Cast", &[&flat], "devices.flag", vec![int("to", 1)]);
        let pads = graph.integers("pads.fixed_tokens", &[0, FIRST_DEVICE_TOKEN as i64, 0, 0]);
        let one = graph.floats("one", &[], &[1.0]);
        let tokens = graph.node("Pad", &[&flags, &pads, &one], "tokens.flag");
        let absent = graph.node("Sub", &[&one, &tokens], "tokens.absent");
        let bias = graph.node("Mul", &[&absent, "masked_score"], "tokens.score");
        graph.node("Unsqueeze", &[&bias, "axes.1_2"], "key_bias");
    }

    /// Normalises and projects; returns the tokens `[N * 15, 64]`.
    fn embed(&mut self) -> String {
        let uav = self.normalise("uav");
        let uav = self.project_one("project_uav", &uav);
        let preference = self.normalise("preference");
        let preference = self.project_one("project_preference", &preference);
        let map = self.normalise("local_map");
        let map = self.project_one("project_map", &map);
        let devices = self.normalise("devices");
        let devices = self.graph.node("Where", &["present", &devices, "zero"], "devices.masked");
        let devices = self.graph.node("Reshape", &[&devices, "rows.device_features"], "devices.rows");
        let devices = self.linear("project_device", &devices, "project_device.rows");
        let devices = self.graph.node("Reshape", &[&devices, "per_sample.devices"], "project_device.tokens");
        let all = [uav.as_str(), &preference, &map, &devices];
        let tokens = self.graph.node_with("Concat", &all, "tokens", vec![int("axis", 1)]);
        self.graph.node("Reshape", &[&tokens, "rows.width"], "tokens.rows")
    }

    /// `((x + shift) / scale)`, clipped, from the schema's table. Operations without effect are left out.
    fn normalise(&mut self, tensor: &str) -> String {
        let table: Vec<Normalisation> = schema::normalisations(tensor).collect();
        let mut value = tensor.to_owned();
        let mut apply = |operator: &str, part: &str, numbers: Vec<f32>, changes: bool| {
            if changes {
                let constant = format!("{tensor}.{part}");
                self.graph.floats(&constant, &[numbers.len()], &numbers);
                value = self.graph.node(operator, &[&value, &constant], &format!("{constant}.applied"));
            }
        };
        let column = |number: fn(&Normalisation) -> f32| table.iter().map(number).collect::<Vec<f32>>();
        let any = |column: &[f32], test: fn(f32) -> bool| column.iter().any(|&number| test(number));
        let shift = column(|row| row.shift);
        let scale = column(|row| row.scale);
        let low = column(|row| row.low.max(f32::MIN));
        let high = column(|row| row.high.min(f32::MAX));
        let [shifts, scales] = [any(&shift, |x| x != 0.0), any(&scale, |x| x != 1.0)];
        let [raises, lowers] = [any(&low, |x| x > f32::MIN), any(&high, |x| x < f32::MAX)];
        apply("Add", "shift", shift, shifts);
        apply("Div", "scale", scale, scales);
        apply("Max", "low", low, raises);
        apply("Min", "high", high, lowers);
        value
    }

    /// A token that each sample has once, `[N,1,64]`.
    fn project_one(&mut self, layer: &str, x: &str) -> String {
        let rows = self.linear(layer, x, &format!("{layer}.rows"));
        self.graph.node("Reshape", &[&rows, "per_sample.one"], &format!("{layer}.tokens"))
    }

    /// `x W^T + b` on rows.
    fn linear(&mut self, layer: &str, x: &str, output: &str) -> String {
        let (weight, bias) = (format!("{layer}.weight"), format!("{layer}.bias"));
        self.graph.node_with("Gemm", &[x, &weight, &bias], output, vec![int("transB", 1)])
    }

    /// One encoder layer: `x = norm(x + attention(x))`, `x = norm(x + ff(x))`.
    fn encode(&mut self, layer: usize, x: &str) -> String {
        let name = |part: &str| format!("encoder.{layer}.{part}");
        let mixed = self.attend(layer, x);
        let out = self.linear(&name("out"), &mixed, &name("out.rows"));
        let x = self.add_and_norm(&name("norm1"), x, &out);
        let hidden = self.linear(&name("ff1"), &x, &name("ff1.rows"));
        let hidden = self.graph.node("Relu", &[&hidden], &name("ff1.relu"));
        let out = self.linear(&name("ff2"), &hidden, &name("ff2.rows"));
        self.add_and_norm(&name("norm2"), &x, &out)
    }

    fn add_and_norm(&mut self, norm: &str, x: &str, change: &str) -> String {
        let sum = self.graph.node("Add", &[x, change], &format!("{norm}.sum"));
        let (gain, bias) = (format!("{norm}.weight"), format!("{norm}.bias"));
        let attributes = vec![int("axis", -1), float("epsilon", LAYER_NORM_EPSILON)];
        let inputs = [sum.as_str(), &gain, &bias];
        self.graph.node_with("LayerNormalization", &inputs, &format!("{norm}.rows"), attributes)
    }

    /// Attention among the tokens of each sample. The weights `[N,4,15,15]` are the value `...weights`.
    fn attend(&mut self, layer: usize, x: &str) -> String {
        let name = |part: &str| format!("encoder.{layer}.attention.{part}");
        let rows = self.linear(&format!("encoder.{layer}.qkv"), x, &name("qkv"));
        let graph = &mut self.graph;
        let split = graph.node("Reshape", &[&rows, "per_sample.qkv"], &name("qkv.split"));
        let order = vec![ints("perm", &[2, 0, 3, 1, 4])];
        let stacked = graph.node_with("Transpose", &[&split], &name("qkv.stacked"), order);
        let stacks = [name("q.stack"), name("k.stack"), name("v.stack")];
        let outputs = stacks.each_ref().map(String::as_str);
        graph.split_with("Split", &[&stacked], &outputs, vec![int("axis", 0)]);
        let [q, k, v] = ["q", "k", "v"]
            .map(|part| graph.node("Squeeze", &[&name(&format!("{part}.stack")), "axis.0"], &name(part)));
        let q = graph.node("Mul", &[&q, "score_scale"], &name("q.scaled"));
        let k = graph.node_with("Transpose", &[&k], &name("k.columns"), vec![ints("perm", &[0, 1, 3, 2])]);
        let scores = graph.node("MatMul", &[&q, &k], &name("scores"));
        let scores = graph.node("Add", &[&scores, "key_bias"], &name("scores.masked"));
        let weights = graph.node_with("Softmax", &[&scores], &name("weights"), vec![int("axis", -1)]);
        let mixed = graph.node("MatMul", &[&weights, &v], &name("mixed"));
        let order = vec![ints("perm", &[0, 2, 1, 3])];
        let mixed = graph.node_with("Transpose", &[&mixed], &name("mixed.tokens"), order);
        graph.node("Reshape", &[&mixed, "rows.width"], &name("mixed.rows"))
    }

    /// The last layer's weights, mean over the heads; zero for absent devices.
    fn attention_out(&mut self) {
        let weights = format!("encoder.{}.attention.weights", LAYERS - 1);
        let graph = &mut self.graph;
        let heads = vec![ints("axes", &[1]), int("keepdims", 0)];
        let mean = graph.node_with("ReduceMean", &[&weights], "attention.mean", heads);
        let queries = graph.node("Unsqueeze", &["tokens.flag", "axis.2"], "attention.queries");
        let keys = graph.node("Unsqueeze", &["tokens.flag", "axis.1"], "attention.keys");
        let rows = graph.node("Mul", &[&mean, &queries], "attention.rows");
        graph.node("Mul", &[&rows, &keys], "attention");
    }

    /// The head's inputs, `[N,256]`: UAV, preference, map, and the maximum of each device feature.
    fn pool(&mut self, rows: &str) -> String {
        let graph = &mut self.graph;
        let tokens = graph.node("Reshape", &[rows, "per_sample.tokens"], "encoded");
        let parts = ["encoded.uav", "encoded.preference", "encoded.map", "encoded.devices"];
        graph.split_with("Split", &[&tokens, "split.tokens"], &parts, vec![int("axis", 1)]);
        let devices = graph.node("Where", &["present", parts[3], "lowest"], "pool.devices");
        let over_devices = || vec![ints("axes", &[1]), int("keepdims", 1)];
        let largest = graph.node_with("ReduceMax", &[&devices], "pool.largest", over_devices());
        let any = graph.node_with("ReduceMax", &["devices.flag"], "pool.any", over_devices());
        let any = graph.node("Greater", &[&any, "half"], "pool.any.truth");
        let any = graph.node("Unsqueeze", &[&any, "axis.2"], "pool.any.present");
        let pooled = graph.node("Where", &[&any, &largest, "zero"], "pool");
        let all = [parts[0], parts[1], parts[2], &pooled];
        let features = graph.node_with("Concat", &all, "head.tokens", vec![int("axis", 1)]);
        let flat = graph.integers("per_sample.head", &[-1, 4 * WIDTH as i64]);
        graph.node("Reshape", &[&features, &flat], "head.features")
    }
}
