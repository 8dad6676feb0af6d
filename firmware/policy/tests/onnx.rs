//! The reader of model files, on a model small enough to write down here: one linear layer over all inputs.

use gleaner_policy::onnx::pb::attribute_proto::AttributeType;
use gleaner_policy::onnx::pb::tensor_proto::{DataLocation, DataType};
use gleaner_policy::onnx::pb::tensor_shape_proto::{Dimension, dimension::Value as Dim};
use gleaner_policy::onnx::pb::*;
use gleaner_policy::onnx::{
    INPUTS, InferError, Metadata, ModelCard, ModelError, OUTPUTS, Port, TractPolicy, seal,
};
use gleaner_policy::{Golden, K_MAX, LOCAL_MAP_CELLS, Policy, SelfTestError, TOKENS, Tokens};
use proptest::prelude::*;
use prost::Message;
use std::sync::LazyLock;

/// Numbers of all inputs together.
const WIDTH: usize = 4 + 12 * 7 + 12 + 2 + LOCAL_MAP_CELLS;

fn weight(action: usize, number: usize) -> f32 {
    ((action * 31 + number * 7) % 19) as f32 / 64.0 - 0.125
}

/// What the tiny model must answer, from the contract's order of numbers.
fn expected(tokens: &Tokens) -> [f32; 5] {
    let mut numbers = tokens.uav.to_vec();
    let present = tokens.devices.len();
    numbers.extend(tokens.devices.iter().flatten());
    numbers.extend(vec![0.0; (K_MAX - present) * 7]);
    numbers.extend((0..K_MAX).map(|slot| f32::from(u8::from(slot < present))));
    numbers.extend(tokens.preference);
    numbers.extend(&tokens.local_map);
    std::array::from_fn(|action| {
        numbers.iter().enumerate().map(|(at, number)| number * weight(action, at)).sum()
    })
}

fn tokens() -> Tokens {
    Tokens {
        uav: [48.0, 80.0, 400.0, -240.0],
        preference: [0.25, 0.75],
        local_map: (0..LOCAL_MAP_CELLS).map(|cell| 64.0 * cell as f32).collect(),
        devices: [[20.0, -40.0, 6000.0, 5.0, 1.0, 0.0, 0.0], [60.0, 0.0, 10.0, -34.0, 0.0, 20.0, 40.0]]
            .into_iter()
            .collect(),
    }
}

fn node(op_type: &str, inputs: &[&str], output: &str, attribute: Vec<AttributeProto>) -> NodeProto {
    NodeProto {
        op_type: op_type.into(),
        name: output.into(),
        input: inputs.iter().map(|&name| name.into()).collect(),
        output: vec![output.into()],
        attribute,
        ..Default::default()
    }
}

fn int(name: &str, i: i64) -> AttributeProto {
    AttributeProto { name: name.into(), r#type: AttributeType::Int as i32, i, ..Default::default() }
}

fn tensor(name: &str, kind: DataType, dims: &[usize], raw_data: Vec<u8>) -> TensorProto {
    let dims = dims.iter().map(|&length| length as i64).collect();
    TensorProto { name: name.into(), dims, data_type: kind as i32, raw_data, ..Default::default() }
}

fn floats(name: &str, dims: &[usize], numbers: impl Iterator<Item = f32>) -> TensorProto {
    tensor(name, DataType::Float, dims, numbers.flat_map(f32::to_le_bytes).collect())
}

fn integers(name: &str, numbers: &[i64]) -> TensorProto {
    tensor(name, DataType::Int64, &[numbers.len()], numbers.iter().flat_map(|n| n.to_le_bytes()).collect())
}

fn port(port: &Port) -> ValueInfoProto {
    let dimension = |value| Dimension { value: Some(value), ..Default::default() };
    let mut dim = vec![dimension(Dim::DimParam("N".into()))];
    dim.extend(port.shape.iter().map(|&length| dimension(Dim::DimValue(length as i64))));
    let tensor =
        type_proto::Tensor { elem_type: DataType::Float as i32, shape: Some(TensorShapeProto { dim }) };
    let kind = TypeProto { value: Some(type_proto::Value::TensorType(tensor)), ..Default::default() };
    ValueInfoProto { name: port.name.into(), r#type: Some(kind), ..Default::default() }
}

fn tiny() -> ModelProto {
    let all = ["uav", "devices.flat", "device_mask", "preference", "local_map"];
    let graph = GraphProto {
        name: "tiny".into(),
        node: vec![
            node("Reshape", &["devices", "flat"], "devices.flat", vec![]),
            node("Concat", &all, "all", vec![int("axis", 1)]),
            node("Gemm", &["all", "weight", "bias"], "logits", vec![int("transB", 1)]),
            node("Gemm", &["uav", "look", "even"], "looks", vec![]),
            node("Reshape", &["looks", "square"], "attention", vec![]),
        ],
        initializer: vec![
            integers("flat", &[-1, 84]),
            integers("square", &[-1, TOKENS as i64, TOKENS as i64]),
            floats("weight", &[5, WIDTH], (0..5 * WIDTH).map(|at| weight(at / WIDTH, at % WIDTH))),
            floats("bias", &[5], [0.0; 5].into_iter()),
            floats("look", &[4, TOKENS * TOKENS], std::iter::repeat_n(0.0, 4 * TOKENS * TOKENS)),
            floats("even", &[TOKENS * TOKENS], (0..TOKENS * TOKENS).map(|at| at as f32)),
        ],
        input: INPUTS.iter().map(port).collect(),
        output: OUTPUTS.iter().map(port).collect(),
        ..Default::default()
    };
    ModelProto {
        ir_version: 8,
        opset_import: vec![OperatorSetIdProto { domain: String::new(), version: 17 }],
        graph: Some(graph),
        ..Default::default()
    }
}

fn metadata() -> Metadata {
    let card = ModelCard {
        name: "tiny".into(),
        version: "0.1.0".into(),
        commit: "0123abc".into(),
        command: "none".into(),
        seed: u64::MAX,
        steps: 7,
        scenario: "rd".into(),
        city_hash: 0x00ab,
    };
    let golden = Golden { tokens: tokens(), logits: expected(&tokens()) };
    Metadata { card, parameters: 5 * WIDTH, goldens: vec![golden] }
}

static FILE: LazyLock<Vec<u8>> = LazyLock::new(|| seal(tiny(), &metadata()));

fn refusal(bytes: &[u8]) -> ModelError {
    match TractPolicy::load_checked(bytes) {
        Ok(_) => panic!("a file that must be refused was loaded"),
        Err(refusal) => refusal,
    }
}

/// The file with one metadata entry changed or removed, and a correct seal.
fn with_entry(key: &str, value: Option<&str>) -> Vec<u8> {
    use sha2::{Digest, Sha256};
    let mut model = ModelProto::decode(&FILE[..]).unwrap();
    model.metadata_props.retain(|entry| entry.key != "sha256" && (entry.key != key || value.is_some()));
    for entry in model.metadata_props.iter_mut().filter(|entry| entry.key == key) {
        entry.value = value.unwrap_or_default().into();
    }
    let digest = Sha256::digest(model.encode_to_vec()).iter().map(|byte| format!("{byte:02x}")).collect();
    model.metadata_props.push(StringStringEntryProto { key: "sha256".into(), value: digest });
    model.encode_to_vec()
}

#[test]
fn every_number_reaches_its_place_and_the_card_is_read() {
    let mut policy = TractPolicy::load_checked(&FILE).unwrap();
    assert_eq!(policy.info().card, metadata().card);
    assert_eq!(policy.info().parameters, 5 * WIDTH);
    assert_eq!(policy.info().schema_hash, gleaner_policy::schema::hash());
    assert_eq!(policy.info().sha256.len(), 64);
    assert_eq!(policy.goldens(), metadata().goldens);
    let mut fewer = tokens();
    fewer.devices.pop();
    for tokens in [tokens(), fewer.clone(), tokens()] {
        let answer = policy.infer(&tokens).unwrap();
        for (logit, expected) in answer.logits.iter().zip(expected(&tokens)) {
            assert!((logit - expected).abs() < 1e-3, "{logit} is not {expected}");
        }
        assert_eq!(answer.attention.0[2][3], (2 * TOKENS + 3) as f32);
    }
}

#[test]
fn invalid_tokens_give_an_error_and_leave_no_trace() {
    let mut policy = TractPolicy::load_checked(&FILE).unwrap();
    let answer = policy.infer(&tokens()).unwrap();
    let mut short = tokens();
    short.local_map.pop();
    assert_eq!(policy.infer(&short), Err(InferError::LocalMap { cells: LOCAL_MAP_CELLS - 1 }));
    let mut endless = tokens();
    endless.uav[0] = f32::INFINITY;
    assert_eq!(policy.infer(&endless), Err(InferError::NotFinite));
    assert_eq!(policy.infer(&tokens()), Ok(answer));
}

#[test]
fn another_contract_is_refused_with_a_line_that_says_so() {
    let line = |key, value| refusal(&with_entry(key, Some(value))).to_string();
    let ours = gleaner_policy::schema::hash();
    assert_eq!(
        line("schema_hash", "0x00000000000000ff"),
        format!(
            "schema 0x00000000000000ff of the model is not this program's {ours:#018x}: retrain, or use the \
             gleaner version that trained it"
        )
    );
    assert!(line("k_max", "6").starts_with("the model takes 6 devices, this program provides 12"));
    assert!(line("action_order", "hover,east").starts_with("the model's actions are `hover,east`"));
    assert!(line("steps", "many").starts_with("metadata entry `steps` of the model: `many`: "));
    assert!(line("golden", "[{}]").starts_with("metadata entry `golden` of the model: "));
    assert!(matches!(refusal(&with_entry("k_max", None)), ModelError::MissingMetadata("k_max")));
    assert!(matches!(refusal(&tiny().encode_to_vec()), ModelError::MissingMetadata("sha256")));
    assert!(matches!(refusal(b"hello"), ModelError::NotOnnx(_)));
    assert!(matches!(refusal(b""), ModelError::NotOnnx(_)));
}

#[test]
fn a_model_that_does_not_reproduce_its_golden_pairs_is_refused() {
    let mut other = tiny();
    let initializer = &mut other.graph.as_mut().unwrap().initializer[3];
    *initializer = floats("bias", &[5], [0.0, 0.01, 0.0, 0.0, 0.0].into_iter());
    let file = seal(other, &metadata());
    assert!(matches!(refusal(&file), ModelError::SelfTest(SelfTestError::Differs { pair: 0, .. })));
    let silent = seal(tiny(), &Metadata { goldens: vec![], ..metadata() });
    assert!(matches!(refusal(&silent), ModelError::SelfTest(SelfTestError::NoGolden)));
    assert!(TractPolicy::from_bytes(&silent).is_ok());
}

#[test]
fn another_interface_is_refused_with_a_line_that_says_so() {
    let line = |change: fn(&mut GraphProto)| {
        let mut model = tiny();
        change(model.graph.as_mut().unwrap());
        refusal(&seal(model, &metadata())).to_string()
    };
    let starts = |change, start: &str| {
        let line = line(change);
        assert!(line.starts_with(start), "{line}");
    };
    starts(|graph| drop(graph.input.remove(0)), "the model has no input `uav`");
    starts(|graph| graph.output[1].name = "looks".into(), "the model has no output `attention`");
    starts(
        |graph| graph.input[0] = port(&Port { name: "uav", shape: &[3] }),
        "input `uav` is f32 [N,3], not f32 [N,4]",
    );
    starts(
        |graph| graph.input.push(port(&Port { name: "rain", shape: &[1] })),
        "the model has an unknown input `rain`",
    );
    starts(|graph| graph.node[2].output[0] = "x".into(), "no node computes the output `logits`");
    starts(
        |graph| graph.initializer[2].data_location = Some(DataLocation::External as i32),
        "the weight `weight` is in another file",
    );
    starts(|graph| graph.node[2].op_type = "Magic".into(), "tract cannot run the model (");
    starts(|graph| graph.node[2].input[0] = "nowhere".into(), "tract cannot run the model (");
    starts(|graph| graph.initializer[2].raw_data.truncate(9), "tract cannot run the model (");
    starts(|graph| graph.node[3].input[1] = "weight".into(), "tract cannot run the model (");
    starts(|graph| drop(graph.node.remove(0)), "tract cannot run the model (");
}

proptest! {
    #[test]
    fn a_truncated_file_is_refused(length in 0..FILE.len()) {
        refusal(&FILE[..length]);
    }

    #[test]
    fn a_flipped_bit_is_found(at in 0..FILE.len(), bit in 0..8) {
        let mut file = FILE.clone();
        file[at] ^= 1_u8 << bit;
        refusal(&file);
    }

    #[test]
    fn noise_is_refused(noise in prop::collection::vec(any::<u8>(), 0..300)) {
        refusal(&noise);
    }
}
