//! The native engine's file: damaged and foreign files are refused with the reason.

use gleaner_policy::native::{AlignedBytes, BlobError, Model, NativePolicy, WeightFormat, Workspace};
use gleaner_policy::onnx::convert;
use gleaner_policy::{Engine, EngineKind, LOCAL_MAP_CELLS, SelfTestError, schema, self_test};
use gleaner_tests::programs::repository;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Offsets in the header.
const FORMAT: usize = 8;
const LENGTH: usize = 12;
const SCHEMA: usize = 16;
const SHAPE: usize = 24;
const WEIGHTS: usize = 56;
const GOLDENS: usize = 60;
const NAME: usize = 96;
const HEADER: usize = 144;
/// Words of a golden pair before the number of devices: aircraft, preference, map.
const DEVICES: usize = HEADER + 4 * (4 + 2 + LOCAL_MAP_CELLS);

fn onnx() -> Vec<u8> {
    std::fs::read(repository().join("models/gleaner.onnx")).expect("the shipped model")
}

fn blob(format: WeightFormat) -> Vec<u8> {
    convert(&onnx(), format).expect("a model that can be converted")
}

fn refusal(bytes: &[u8]) -> BlobError {
    match Model::read(AlignedBytes::new(bytes).as_slice()) {
        Ok(_) => panic!("a file that must be refused was read"),
        Err(refusal) => refusal,
    }
}

/// CRC-32 (ISO-HDLC), bit by bit: independent of the code under test.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}

/// Corrects length and checksum.
fn reseal(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = bytes.len() as u32;
    bytes[LENGTH..LENGTH + 4].copy_from_slice(&length.to_le_bytes());
    let end = bytes.len() - 4;
    let crc = crc32(&bytes[..end]);
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// The file with some bytes replaced and sealed again, as a faulty writer would produce it.
fn with(at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = blob(WeightFormat::I16);
    file[at..at + bytes.len()].copy_from_slice(bytes);
    reseal(file)
}

#[test]
fn a_truncated_file_is_refused() {
    for format in WeightFormat::ALL {
        let whole = AlignedBytes::new(&blob(format));
        let whole = whole.as_slice();
        assert!(Model::read(whole).is_ok());
        for length in 0..whole.len() {
            match Model::read(&whole[..length]) {
                Err(BlobError::Length { found, .. }) => assert_eq!(found, length),
                Err(other) => panic!("cut to {length} bytes: {other}"),
                Ok(_) => panic!("cut to {length} bytes it was read"),
            }
        }
        // Truncated and sealed again.
        for length in (HEADER + 4..whole.len()).step_by(4096) {
            assert!(matches!(refusal(&reseal(whole[..length].to_vec())), BlobError::Length { .. }));
        }
        let longer = [whole, &[0; 4]].concat();
        assert!(matches!(refusal(&longer), BlobError::Length { .. }));
        assert!(matches!(refusal(&reseal(longer)), BlobError::Length { .. }));
    }
}

#[test]
fn every_changed_byte_is_found() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let good = blob(WeightFormat::I16);
    let anywhere: Vec<usize> = (0..1500).map(|_| rng.random_range(HEADER..good.len())).collect();
    for at in (0..HEADER).chain(good.len() - 8..good.len()).chain(anywhere) {
        let mut bad = good.clone();
        bad[at] ^= rng.random_range(1..=u8::MAX);
        let found = refusal(&bad);
        let expected = match at {
            0..FORMAT => matches!(found, BlobError::Magic),
            FORMAT..LENGTH => matches!(found, BlobError::Format { .. }),
            LENGTH..SCHEMA => matches!(found, BlobError::Length { .. }),
            _ => matches!(found, BlobError::Checksum { .. }),
        };
        assert!(expected, "byte {at}: {found:?}");
    }
}

#[test]
fn another_schema_is_refused_with_advice() {
    let schema = schema::hash() ^ 1;
    let found = refusal(&with(SCHEMA, &schema.to_le_bytes()));
    assert_eq!(found, BlobError::Schema { model: schema, program: schema::hash() });
    assert_eq!(
        found.to_string(),
        format!(
            "schema {schema:#018x} of the model is not this program's {:#018x}: convert it again with `gleaner convert`",
            schema::hash()
        )
    );
    for number in 0..8 {
        assert_eq!(refusal(&with(SHAPE + 4 * number, &99_u32.to_le_bytes())), BlobError::Shape);
    }
    assert_eq!(refusal(&with(WEIGHTS, &9_u32.to_le_bytes())), BlobError::Weights { found: 9 });
    assert_eq!(refusal(&with(NAME, &[0xff])), BlobError::Name);
    assert_eq!(refusal(&with(DEVICES, &13_u32.to_le_bytes())), BlobError::Golden { pair: 0 });
    for goldens in [0, 1, 1000, u32::MAX] {
        assert!(matches!(refusal(&with(GOLDENS, &goldens.to_le_bytes())), BlobError::Length { .. }));
    }
    // The other format is longer.
    assert!(matches!(refusal(&with(WEIGHTS, &0_u32.to_le_bytes())), BlobError::Length { .. }));
    assert_eq!(refusal(b"not a model at all"), BlobError::Magic);
    let shifted = AlignedBytes::new(&[&[0][..], &blob(WeightFormat::I16)].concat());
    assert!(matches!(Model::read(&shifted.as_slice()[1..]), Err(BlobError::Misaligned)));
}

#[test]
fn noise_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let header = &blob(WeightFormat::I16)[..HEADER];
    for _ in 0..2000 {
        let length = rng.random_range(0..3000);
        let noise: Vec<u8> = (0..length).map(|_| rng.random()).collect();
        refusal(&noise);
        // Noise behind a valid header, sealed.
        refusal(&reseal([header, &noise, &[0; 4]].concat()));
    }
}

#[test]
fn a_model_that_fails_its_golden_pair_is_refused() {
    // The last number before the checksum is a weight of padding; the head's bias of `hover` is not.
    let good = blob(WeightFormat::F32);
    let mut changed = good.clone();
    let weights = 64 * 8 * 4;
    let bias = good.len() - 4 - weights - 8 * 4;
    let number = f32::from_le_bytes(good[bias..bias + 4].try_into().unwrap()) + 0.001;
    changed[bias..bias + 4].copy_from_slice(&number.to_le_bytes());
    let changed = reseal(changed);
    let aligned = AlignedBytes::new(&changed);
    let model = Model::read(aligned.as_slice()).expect("whole, but another model");
    let mut workspace = Workspace::new();
    let verdict = self_test(&mut NativePolicy::new(model, &mut workspace), model.goldens());
    assert!(matches!(verdict, Err(SelfTestError::Differs { pair: 0, .. })), "{verdict:?}");
    let refused = Engine::load_checked(&changed, EngineKind::Native).err().expect("refused");
    assert!(refused.to_string().starts_with("self-test failed: golden pair 0 differs by "), "{refused}");
}

#[test]
fn each_engine_names_the_file_it_needs() {
    let engine = Engine::load_checked(&onnx(), EngineKind::Native).expect("converted in memory");
    let own = Engine::load_checked(&blob(WeightFormat::F32), EngineKind::Native).expect("its own file");
    let tract = Engine::load_checked(&onnx(), EngineKind::Tract).expect("the ONNX file");
    assert_eq!((engine.sha256(), own.sha256()), (tract.sha256(), tract.sha256()));
    assert_eq!((engine.name(), own.name()), (tract.name(), tract.name()));
    assert_eq!(own.goldens(), tract.goldens(), "to the last bit");
    let name = engine.to_string();
    assert!(name.starts_with("native, ") && name.ends_with(", weights f32"), "{name}");
    let refused = Engine::load_checked(&blob(WeightFormat::F32), EngineKind::Tract).err().expect("refused");
    assert!(refused.to_string().ends_with("choose the engine native, or give the ONNX file"), "{refused}");
    let refused = Engine::load_checked(b"\x89GLN\r\n\x1a\n", EngineKind::Native).err().expect("refused");
    assert_eq!(
        refused.to_string(),
        "the model has 8 bytes instead of 16: convert it again with `gleaner convert`"
    );
}
