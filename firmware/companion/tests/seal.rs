//! `gleaner seal`: an exported model becomes one that flies.

mod fixture;

use fixture::{Fixture, LOGITS, model, outcome};
use gleaner_policy::onnx::pb::ModelProto;
use prost::Message;
use std::process::Command;

/// The fixture's model as an exporter writes it: without metadata.
fn exported() -> ModelProto {
    let mut model = ModelProto::decode(&model(LOGITS)[..]).unwrap();
    model.metadata_props.clear();
    model
}

fn seal(fixture: &Fixture, model: &ModelProto) -> (Option<i32>, String, String) {
    fixture.write("exported.onnx", model.encode_to_vec());
    let mut gleaner = Command::new(env!("CARGO_BIN_EXE_gleaner"));
    gleaner.arg("seal").arg(fixture.path("exported.onnx")).arg("--out").arg(fixture.path("policy.onnx"));
    outcome(&gleaner.args(["--name", "mine"]).output().unwrap())
}

#[test]
fn a_sealed_model_passes_the_check() {
    let fixture = Fixture::new();
    fixture.write("policy.onnx", exported().encode_to_vec());
    let check = || outcome(&fixture.gleaner("check").args(["--wait", "0"]).output().unwrap());
    let (code, stdout, _) = check();
    assert_eq!(code, Some(1), "{stdout}");
    assert!(stdout.contains("gleaner seal"), "it says what to do: {stdout}");
    let (code, stdout, stderr) = seal(&fixture, &exported());
    assert_eq!((code, stderr.as_str()), (Some(0), ""), "{stdout}");
    assert!(stdout.contains("golden pairs") && stdout.contains("the same answer to every"), "{stdout}");
    let (code, stdout, _) = check();
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("ok    model      mine 1"), "{stdout}");
}

#[test]
fn a_model_that_breaks_the_contract_is_refused_in_one_line() {
    let mut renamed = exported();
    renamed.graph.as_mut().unwrap().input[0].name = "drone".into();
    let mut wide = exported();
    for number in &mut wide.graph.as_mut().unwrap().initializer {
        if number.name == "answer" {
            number.raw_data = [1e9_f32, 4.0, 3.0, 2.0, 1.0].into_iter().flat_map(f32::to_le_bytes).collect();
        }
    }
    for (model, part) in [
        (renamed, "has no input `uav`"),
        (wide, "a logit of 1e9 for observation 0: keep logits below 1e4"),
        (ModelProto::default(), "not an ONNX model"),
    ] {
        let fixture = Fixture::new();
        let (code, stdout, stderr) = seal(&fixture, &model);
        assert_eq!((code, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1), "{stderr}");
        assert!(stderr.contains(part), "{stderr}");
    }
}
