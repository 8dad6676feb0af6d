//! The engine, chosen when a program of a host starts.

use crate::native::{AlignedBytes, MAGIC, Model, NativeError, NativePolicy, WeightFormat};
use crate::onnx::{ConvertError, InferError, ModelCard, ModelError, TractPolicy, convert, unseal};
use crate::{Golden, Inference, Policy, Tokens, self_test};
use std::fmt;
use std::str::FromStr;

/// The engines of a host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EngineKind {
    /// Runs the graph of the ONNX file, whatever its operators. The default: it reads what was trained as it is.
    #[default]
    Tract,
    /// The one that flies on a microcontroller, with the same bits. Takes its own file, or the ONNX file, which it
    /// then converts.
    Native,
}

impl EngineKind {
    /// Both.
    pub const ALL: [EngineKind; 2] = [EngineKind::Tract, EngineKind::Native];

    /// As it is written in flags, files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            EngineKind::Tract => "tract",
            EngineKind::Native => "native",
        }
    }
}

/// No engine has this name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an engine is tract or native")]
pub struct EngineNameError;

impl FromStr for EngineKind {
    type Err = EngineNameError;

    fn from_str(name: &str) -> Result<EngineKind, EngineNameError> {
        EngineKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or(EngineNameError)
    }
}

/// A model in the engine of choice, after it proved itself there.
pub struct Engine {
    name: String,
    version: String,
    sha256: String,
    card: Option<ModelCard>,
    goldens: Vec<Golden>,
    run: Run,
}

enum Run {
    Tract(Box<TractPolicy>),
    Native(Box<NativePolicy<'static>>),
}

impl Engine {
    /// Reads a model, checks it and lets it prove itself on its golden pairs.
    ///
    /// The native engine's model stays in memory until the program ends: load one, not one a mission.
    ///
    /// # Errors
    /// Anything that makes the model unfit to fly in this engine, see [`ModelError`].
    pub fn load_checked(bytes: &[u8], kind: EngineKind) -> Result<Engine, ModelError> {
        match kind {
            EngineKind::Tract if bytes.starts_with(&MAGIC) => Err(ModelError::NativeOnly),
            EngineKind::Tract => Ok(Engine::tract(TractPolicy::load_checked(bytes)?)),
            EngineKind::Native if bytes.starts_with(&MAGIC) => Engine::native(bytes, None),
            EngineKind::Native => {
                let blob = convert(bytes, WeightFormat::F32).map_err(|cause| match cause {
                    ConvertError::Model(cause) => cause,
                    cause => ModelError::Convert(Box::new(cause)),
                })?;
                Engine::native(&blob, Some(unseal(bytes)?.1.card))
            }
        }
    }

    fn tract(policy: TractPolicy) -> Engine {
        let info = policy.info().clone();
        Engine {
            name: info.card.name.clone(),
            version: info.card.version.clone(),
            sha256: info.sha256,
            card: Some(info.card),
            goldens: policy.goldens().to_vec(),
            run: Run::Tract(Box::new(policy)),
        }
    }

    fn native(blob: &[u8], card: Option<ModelCard>) -> Result<Engine, ModelError> {
        let model = Model::read(Box::leak(Box::new(AlignedBytes::new(blob))).as_slice())?;
        let mut policy = NativePolicy::new(model, Box::leak(Box::default()));
        self_test(&mut policy, model.goldens())?;
        Ok(Engine {
            name: model.name().into(),
            version: model.version().into(),
            sha256: model.source().iter().map(|byte| format!("{byte:02x}")).collect(),
            card,
            goldens: model.goldens().collect(),
            run: Run::Native(Box::new(policy)),
        })
    }

    /// What runs.
    #[must_use]
    pub fn kind(&self) -> EngineKind {
        match self.run {
            Run::Tract(_) => EngineKind::Tract,
            Run::Native(_) => EngineKind::Native,
        }
    }

    /// What people call the model.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Version of the program that trained it.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// SHA-256 of the ONNX file's content: the identity of the model, whatever the engine.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Who made it; the native engine's own file does not say.
    #[must_use]
    pub fn card(&self) -> Option<&ModelCard> {
        self.card.as_ref()
    }

    /// What it has answered.
    #[must_use]
    pub fn goldens(&self) -> &[Golden] {
        &self.goldens
    }
}

impl fmt::Display for Engine {
    /// The engine, and how it keeps the weights if it has a choice.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.run {
            Run::Tract(_) => write!(f, "tract"),
            Run::Native(policy) => write!(f, "native, weights {}", policy.model().format().name()),
        }
    }
}

impl Policy for Engine {
    type Error = InferError;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, InferError> {
        match &mut self.run {
            Run::Tract(policy) => policy.infer(tokens),
            Run::Native(policy) => policy.infer(tokens).map_err(|error| match error {
                NativeError::LocalMap { cells } => InferError::LocalMap { cells },
                NativeError::NotFinite => InferError::NotFinite,
            }),
        }
    }
}
