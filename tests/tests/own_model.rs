//! A policy of one's own: the network of `pytorch_policy.py`, sealed and checked.
//!
//! PyTorch takes half a gigabyte, so the tests do not run the example itself: `tests/python/onnx_policy.py` writes the same
//! graph with the package `onnx`, with the names and shapes that stand in the example's text.

use gleaner_policy::onnx::{INPUTS, OUTPUTS};
use gleaner_tests::programs::{path, repository};
use gleaner_tests::python;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn gleaner(folder: &Path, words: &[&str]) -> Output {
    Command::new(path("gleaner")).args(words).current_dir(folder).output().unwrap()
}

fn printed(output: &Output) -> String {
    String::from_utf8([&output.stdout[..], &output.stderr].concat()).unwrap()
}

#[test]
fn the_network_of_the_pytorch_example_is_sealed_and_may_fly() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let contract = python::run("onnx_policy.py", [folder.join("exported.onnx")]).unwrap();
    let contract: Value = serde_json::from_str(&contract).unwrap();
    assert_eq!(contract.as_object().unwrap().len(), INPUTS.len() + OUTPUTS.len());
    for port in INPUTS.iter().chain(&OUTPUTS) {
        assert_eq!(contract[port.name], serde_json::json!(port.shape), "{} in the example's text", port.name);
    }

    let config = repository().join("firmware/companion/dist/gleaner.toml");
    let mut check = vec!["check", "--wait", "0", "--config", config.to_str().unwrap()];
    check.extend(["--autopilot", "udpin:127.0.0.1:0", "--radio", "udpin:127.0.0.1:0"]);
    let unsealed = gleaner(folder, &[&check[..], &["--model", "exported.onnx"]].concat());
    assert_eq!(unsealed.status.code(), Some(1));
    assert!(printed(&unsealed).contains("gleaner seal"), "{}", printed(&unsealed));

    let sealed = gleaner(folder, &["seal", "exported.onnx", "--out", "policy.onnx", "--name", "mine"]);
    let said = printed(&sealed);
    assert!(sealed.status.success() && said.contains("golden pairs"), "{said}");
    assert!(!said.contains("warning"), "its answers differ: {said}");
    let checked = gleaner(folder, &[&check[..], &["--model", "policy.onnx"]].concat());
    let said = printed(&checked);
    assert!(checked.status.success(), "{said}");
    for line in ["ok    model      mine 1, ", "ok    engine     tract", "ok    self-test  "] {
        assert!(said.contains(line), "{line}: {said}");
    }

    let words = ["fly", "--json", "--model", "policy.onnx", "--engine", "tract", "--lookahead", "0"];
    let flown = Command::new(path("gleaner-sitl")).args(words).current_dir(folder).output().unwrap();
    let report: Value =
        serde_json::from_slice(&flown.stdout).unwrap_or_else(|_| panic!("{}", printed(&flown)));
    // It is not trained, and the guard brings it home all the same.
    assert_eq!((&report["violations"], &report["engine"]), (&0.into(), &"tract".into()), "{report}");
}
