//! The metadata of a model file: writing, reading and the seal.

use super::error::ModelError;
use super::interface;
use super::pb::{ModelProto, StringStringEntryProto};
use crate::schema::{self, FEATURES};
use crate::{Golden, K_MAX};
use gleaner_units::Action;
use prost::Message;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The metadata keys, in file order.
mod key {
    pub const NAME: &str = "name";
    pub const VERSION: &str = "version";
    pub const COMMIT: &str = "commit";
    pub const COMMAND: &str = "command";
    pub const SEED: &str = "seed";
    pub const STEPS: &str = "steps";
    pub const SCENARIO: &str = "scenario";
    pub const CITY_HASH: &str = "city_hash";
    pub const PARAMETERS: &str = "parameters";
    pub const K_MAX: &str = "k_max";
    pub const ACTION_ORDER: &str = "action_order";
    pub const SCHEMA_HASH: &str = "schema_hash";
    pub const NORMALISATION: &str = "normalisation";
    pub const GOLDEN: &str = "golden";
    pub const SHA256: &str = "sha256";
}

/// Origin of a model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelCard {
    /// Name of the model.
    pub name: String,
    /// Version of the program that trained it.
    pub version: String,
    /// Source commit of that program.
    pub commit: String,
    /// Command that reproduces the training.
    pub command: String,
    /// Random seed of the training.
    pub seed: u64,
    /// Environment steps of the training.
    pub steps: u64,
    /// Training scenario.
    pub scenario: String,
    /// Hash of the training city.
    pub city_hash: u64,
}

/// Description of a loaded model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelInfo {
    /// Its origin.
    #[serde(flatten)]
    pub card: ModelCard,
    /// Trained parameters.
    pub parameters: usize,
    /// [`schema::hash`] of its observation contract; after loading, this program's.
    pub schema_hash: u64,
    /// SHA-256 of the content, 64 hexadecimal digits, which identifies the model.
    pub sha256: String,
}

/// Metadata that the trainer provides. The observation contract (schema hash, K_max, action order, normalisation) is
/// that of the writing program.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// Its origin.
    pub card: ModelCard,
    /// Trained parameters.
    pub parameters: usize,
    /// The golden pairs.
    pub goldens: Vec<Golden>,
}

impl Metadata {
    /// The entries, without the seal.
    fn entries(&self) -> Vec<(&'static str, String)> {
        let card = &self.card;
        vec![
            (key::NAME, card.name.clone()),
            (key::VERSION, card.version.clone()),
            (key::COMMIT, card.commit.clone()),
            (key::COMMAND, card.command.clone()),
            (key::SEED, card.seed.to_string()),
            (key::STEPS, card.steps.to_string()),
            (key::SCENARIO, card.scenario.clone()),
            (key::CITY_HASH, hex(card.city_hash)),
            (key::PARAMETERS, self.parameters.to_string()),
            (key::K_MAX, K_MAX.to_string()),
            (key::ACTION_ORDER, action_order()),
            (key::SCHEMA_HASH, hex(schema::hash())),
            (key::NORMALISATION, normalisation().to_string()),
            (key::GOLDEN, serde_json::json!(self.goldens).to_string()),
        ]
    }

    /// Reads the entries that [`seal`] wrote and compares the contract with this program's.
    ///
    /// # Errors
    /// The first entry that is missing, malformed or of another contract.
    fn read(model: &ModelProto, sha256: String) -> Result<(ModelInfo, Vec<Golden>), ModelError> {
        let schema_hash = parse_hex(model, key::SCHEMA_HASH)?;
        if schema_hash != schema::hash() {
            return Err(ModelError::Schema { model: schema_hash, program: schema::hash() });
        }
        let k_max = parse(model, key::K_MAX)?;
        if k_max != K_MAX {
            return Err(ModelError::KMax { model: k_max, program: K_MAX });
        }
        let actions = entry(model, key::ACTION_ORDER)?;
        if actions != action_order() {
            return Err(ModelError::ActionOrder { model: actions.into(), program: action_order() });
        }
        let card = ModelCard {
            name: entry(model, key::NAME)?.into(),
            version: entry(model, key::VERSION)?.into(),
            commit: entry(model, key::COMMIT)?.into(),
            command: entry(model, key::COMMAND)?.into(),
            seed: parse(model, key::SEED)?,
            steps: parse(model, key::STEPS)?,
            scenario: entry(model, key::SCENARIO)?.into(),
            city_hash: parse_hex(model, key::CITY_HASH)?,
        };
        let goldens = serde_json::from_str(entry(model, key::GOLDEN)?)
            .map_err(|cause| ModelError::BadMetadata { key: key::GOLDEN, cause: cause.to_string() })?;
        let parameters = parse(model, key::PARAMETERS)?;
        Ok((ModelInfo { card, parameters, schema_hash, sha256 }, goldens))
    }
}

/// Adds metadata and seal to `model`, replacing any metadata, and encodes the file.
#[must_use]
pub fn seal(mut model: ModelProto, metadata: &Metadata) -> Vec<u8> {
    let property = |(key, value): (&str, String)| StringStringEntryProto { key: key.into(), value };
    model.metadata_props = metadata.entries().into_iter().map(property).collect();
    let sha256 = sha256(&model);
    model.metadata_props.push(property((key::SHA256, sha256)));
    model.encode_to_vec()
}

/// Decodes a file and checks seal, contract and interface. Runs no engine.
///
/// # Errors
/// [`ModelError`], except those of engine and self-test.
pub fn unseal(bytes: &[u8]) -> Result<(ModelProto, ModelInfo, Vec<Golden>), ModelError> {
    let model = ModelProto::decode(bytes).map_err(|cause| ModelError::NotOnnx(cause.to_string()))?;
    let Some(graph) = &model.graph else {
        return Err(ModelError::NotOnnx("it has no graph".into()));
    };
    let sealed = entry(&model, key::SHA256)?;
    let mut content = model.clone();
    content.metadata_props.retain(|property| property.key != key::SHA256);
    let found = sha256(&content);
    if sealed != found {
        return Err(ModelError::Altered { sealed: sealed.into(), found });
    }
    let (info, goldens) = Metadata::read(&model, found)?;
    interface::check(graph)?;
    Ok((model, info, goldens))
}

fn sha256(model: &ModelProto) -> String {
    Sha256::digest(model.encode_to_vec()).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn hex(number: u64) -> String {
    format!("{number:#018x}")
}

fn action_order() -> String {
    Action::ALL.map(Action::name).join(",")
}

/// The feature table as JSON, for readers and other engines.
fn normalisation() -> serde_json::Value {
    let finite = |limit: f32| limit.is_finite().then_some(limit);
    FEATURES
        .iter()
        .map(|feature| {
            serde_json::json!({
                "tensor": feature.tensor,
                "index": feature.index,
                "name": feature.name,
                "unit": feature.unit,
                "when_absent": feature.when_absent,
                "shift": feature.normalisation.shift,
                "scale": feature.normalisation.scale,
                "low": finite(feature.normalisation.low),
                "high": finite(feature.normalisation.high),
            })
        })
        .collect()
}

fn entry<'a>(model: &'a ModelProto, key: &'static str) -> Result<&'a str, ModelError> {
    model
        .metadata_props
        .iter()
        .find(|property| property.key == key)
        .map(|property| property.value.as_str())
        .ok_or(ModelError::MissingMetadata(key))
}

fn parse<T>(model: &ModelProto, key: &'static str) -> Result<T, ModelError>
where
    T: std::str::FromStr<Err = std::num::ParseIntError>,
{
    let text = entry(model, key)?;
    text.parse().map_err(|cause| ModelError::BadMetadata { key, cause: format!("`{text}`: {cause}") })
}

fn parse_hex(model: &ModelProto, key: &'static str) -> Result<u64, ModelError> {
    let text = entry(model, key)?;
    u64::from_str_radix(text.trim_start_matches("0x"), 16)
        .map_err(|cause| ModelError::BadMetadata { key, cause: format!("`{text}`: {cause}") })
}
