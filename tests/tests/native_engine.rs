//! The native engine against tract: one model, two engines, the same decisions.

use gleaner_policy::native::WeightFormat;
use gleaner_policy::onnx::convert;
use gleaner_tests::programs::repository;

/// ONNX is the only source: what is flashed is made from what was trained.
#[test]
fn the_committed_blob_is_the_conversion_of_the_committed_model() {
    let read = |name: &str| std::fs::read(repository().join("models").join(name)).expect("a file of models/");
    let converted = convert(&read("gleaner.onnx"), WeightFormat::F32).expect("a model that can be converted");
    assert!(
        converted == read("gleaner.gln"),
        "models/gleaner.gln is not made from models/gleaner.onnx: type cargo run --release -p gleaner-companion -- \
         convert models/gleaner.onnx --out models/gleaner.gln"
    );
}
