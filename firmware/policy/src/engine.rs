//! The engine of a host program, selected at start.

use crate::native::{AlignedBytes, MAGIC, Model, NativeError, NativePolicy, SimdPolicy, WeightFormat};
#[cfg(feature = "tract")]
use crate::onnx::TractPolicy;
use crate::onnx::{ConvertError, InferError, ModelCard, ModelError, convert, unseal};
use crate::{Golden, Inference, Policy, Tokens, self_test};
use gleaner_units::Action;
use std::fmt;
use std::str::FromStr;

/// The engines of a host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EngineKind {
    /// Runs the graph of the ONNX file with any operators. Needs the feature `tract`.
    Tract,
    /// The default, because it is the fastest: the network of the microcontroller on the host's vector unit. Reads its own
    /// file, or converts the ONNX file.
    #[default]
    Native,
}

impl EngineKind {
    /// All engines.
    pub const ALL: [EngineKind; 2] = [EngineKind::Tract, EngineKind::Native];

    /// Whether this program contains the engine.
    #[must_use]
    pub const fn is_built(self) -> bool {
        match self {
            EngineKind::Tract => cfg!(feature = "tract"),
            EngineKind::Native => true,
        }
    }

    /// Name in flags, files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            EngineKind::Tract => "tract",
            EngineKind::Native => "native",
        }
    }
}

/// The name is not that of an engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown engine: choose tract or native")]
pub struct EngineNameError;

impl FromStr for EngineKind {
    type Err = EngineNameError;

    fn from_str(name: &str) -> Result<EngineKind, EngineNameError> {
        EngineKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or(EngineNameError)
    }
}

/// A model in the selected engine, after its self-test.
pub struct Engine {
    name: String,
    version: String,
    sha256: String,
    card: Option<ModelCard>,
    goldens: Vec<Golden>,
    run: Run,
}

enum Run {
    #[cfg(feature = "tract")]
    Tract(Box<TractPolicy>),
    /// For processors without a supported vector unit.
    Portable(Box<NativePolicy<'static>>),
    Simd(Box<SimdPolicy>, WeightFormat),
}

impl Engine {
    /// Reads and checks a model and runs the self-test.
    ///
    /// On a processor without a supported vector unit, a native model stays in memory until the program ends.
    ///
    /// # Errors
    /// [`ModelError`] for a model that must not fly in this engine.
    pub fn load_checked(bytes: &[u8], kind: EngineKind) -> Result<Engine, ModelError> {
        match kind {
            EngineKind::Tract if bytes.starts_with(&MAGIC) => Err(ModelError::NativeOnly),
            EngineKind::Tract => Engine::tract(bytes),
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

    #[cfg(not(feature = "tract"))]
    fn tract(_: &[u8]) -> Result<Engine, ModelError> {
        Err(ModelError::NoTract)
    }

    #[cfg(feature = "tract")]
    fn tract(bytes: &[u8]) -> Result<Engine, ModelError> {
        let policy = TractPolicy::load_checked(bytes)?;
        let info = policy.info().clone();
        Ok(Engine {
            name: info.card.name.clone(),
            version: info.card.version.clone(),
            sha256: info.sha256,
            card: Some(info.card),
            goldens: policy.goldens().to_vec(),
            run: Run::Tract(Box::new(policy)),
        })
    }

    fn native(blob: &[u8], card: Option<ModelCard>) -> Result<Engine, ModelError> {
        let bytes = AlignedBytes::new(blob);
        let model = Model::read(bytes.as_slice())?;
        let run = match SimdPolicy::new(&model) {
            Some(mut policy) => {
                self_test(&mut policy, model.goldens())?;
                Run::Simd(Box::new(policy), model.format())
            }
            None => {
                let model = Model::read(Box::leak(Box::new(bytes.clone())).as_slice())?;
                let mut policy = NativePolicy::new(model, Box::leak(Box::default()));
                self_test(&mut policy, model.goldens())?;
                Run::Portable(Box::new(policy))
            }
        };
        Ok(Engine {
            name: model.name().into(),
            version: model.version().into(),
            sha256: model.source().iter().map(|byte| format!("{byte:02x}")).collect(),
            card,
            goldens: model.goldens().collect(),
            run,
        })
    }

    /// Which engine it is.
    #[must_use]
    pub fn kind(&self) -> EngineKind {
        match self.run {
            #[cfg(feature = "tract")]
            Run::Tract(_) => EngineKind::Tract,
            Run::Portable(_) | Run::Simd(..) => EngineKind::Native,
        }
    }

    /// Name of the model.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Version of the program that trained it.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// SHA-256 of the ONNX file's content, which identifies the model in every engine.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Origin of the model; the native engine's own file does not contain it.
    #[must_use]
    pub fn card(&self) -> Option<&ModelCard> {
        self.card.as_ref()
    }

    /// The golden pairs that it reproduced.
    #[must_use]
    pub fn goldens(&self) -> &[Golden] {
        &self.goldens
    }
}

impl fmt::Display for Engine {
    /// The engine, its instruction set and the format of its weights.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.run {
            #[cfg(feature = "tract")]
            Run::Tract(_) => write!(f, "tract"),
            Run::Portable(policy) => {
                write!(f, "native, portable, weights {}", policy.model().format().name())
            }
            Run::Simd(policy, format) => {
                write!(f, "native, {}, weights {}", policy.instruction_set(), format.name())
            }
        }
    }
}

impl Policy for Engine {
    type Error = InferError;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, InferError> {
        match &mut self.run {
            #[cfg(feature = "tract")]
            Run::Tract(policy) => policy.infer(tokens),
            Run::Portable(policy) => Ok(policy.infer(tokens)?),
            Run::Simd(policy, _) => Ok(policy.infer(tokens)?),
        }
    }

    fn logits(&mut self, tokens: &Tokens) -> Result<[f32; Action::COUNT], InferError> {
        match &mut self.run {
            Run::Simd(policy, _) => Ok(policy.logits(tokens)?),
            _ => self.infer(tokens).map(|inference| inference.logits),
        }
    }
}

impl From<NativeError> for InferError {
    fn from(error: NativeError) -> InferError {
        match error {
            NativeError::LocalMap { cells } => InferError::LocalMap { cells },
            NativeError::NotFinite => InferError::NotFinite,
        }
    }
}
