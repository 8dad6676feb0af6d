//! The configuration file and its faults.

use super::{ConfigError, MOST_MODELS, RadioFormat, SigningConfig};
use crate::logs::Limits;
use gleaner_dashboard::{Token, http_address};
use gleaner_link::{Operators, Parameters};
use gleaner_pilot::{OnStop, Settings};
use gleaner_policy::EngineKind;
use gleaner_ports::Endpoint;
use gleaner_radio::Calibration;
use gleaner_units::Db;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// The file as it is written.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub model: Option<PathBuf>,
    models: Option<Spanned<Vec<PathBuf>>>,
    pub engine: Option<Spanned<String>>,
    pub mission: Option<PathBuf>,
    pub autopilot: Option<Spanned<String>>,
    #[serde(default)]
    pub ground: Vec<Spanned<String>>,
    pub radio: Option<Spanned<String>>,
    radio_format: Option<Spanned<String>>,
    radio_snr: Option<SnrTable>,
    operators: Option<Vec<Spanned<String>>>,
    pub log_dir: Option<PathBuf>,
    pub state_dir: Option<PathBuf>,
    component_id: Option<Spanned<i64>>,
    system_id: Option<Spanned<i64>>,
    on_stop: Option<Spanned<String>>,
    signing: Option<SigningTable>,
    #[serde(default)]
    pub log: LogTable,
    #[serde(default)]
    pub page: PageTable,
    #[serde(default)]
    pub parameters: BTreeMap<String, Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct LogTable {
    pub telemetry: bool,
    file_mb: Option<Spanned<i64>>,
    min_free_mb: Option<Spanned<i64>>,
}

impl Default for LogTable {
    fn default() -> LogTable {
        LogTable { telemetry: true, file_mb: None, min_free_mb: None }
    }
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct PageTable {
    http: Option<Spanned<String>>,
    view_token: Option<Spanned<String>>,
    control_token: Option<Spanned<String>>,
}

/// `offset_db + slope * measured`, in place of the format's own calibration.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SnrTable {
    offset_db: f32,
    slope: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SigningTable {
    key: PathBuf,
    ports: Option<Vec<Spanned<String>>>,
}

/// The file that values come from, for the place of a fault and for relative paths.
pub(super) struct Source<'s> {
    pub path: &'s Path,
    pub text: &'s str,
}

impl Source<'_> {
    pub fn parse(&self) -> Result<File, ConfigError> {
        toml::from_str(self.text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            self.fault(offset, error.message().replace('\n', " "))
        })
    }

    fn fault(&self, offset: usize, what: String) -> ConfigError {
        let line = 1 + self.text.bytes().take(offset).filter(|&byte| byte == b'\n').count();
        ConfigError::Line { path: self.path.to_owned(), line, what }
    }

    pub fn endpoint(&self, key: &str, text: &Spanned<String>) -> Result<Endpoint, ConfigError> {
        text.get_ref().parse().map_err(|error| self.fault(text.span().start, format!("{key}: {error}")))
    }

    pub fn engine(&self, name: &Spanned<String>) -> Result<EngineKind, ConfigError> {
        name.get_ref()
            .parse()
            .map_err(|error| self.fault(name.span().start, format!("engine = {:?}: {error}", name.get_ref())))
    }

    /// MAVLink guide, "Routing": 0 addresses every system; 255 is the id of ground stations, and component 1 that of the
    /// autopilot.
    pub fn settings(&self, file: &File) -> Result<Settings, ConfigError> {
        let mut settings = Settings::default();
        if let Some(component_id) = &file.component_id {
            settings.component_id =
                self.number("component_id", component_id, 2..=254, "191 to 194 are usual")?;
        }
        if let Some(system_id) = &file.system_id {
            let id =
                self.number("system_id", system_id, 1..=254, "or leave it out to adopt the autopilot's")?;
            settings.system_id = Some(id);
        }
        if let Some(operators) = &file.operators {
            settings.operators = self.operators(operators)?;
        }
        if let Some(on_stop) = &file.on_stop {
            settings.rules.on_stop = self.on_stop(on_stop)?;
        }
        Ok(settings)
    }

    fn on_stop(&self, name: &Spanned<String>) -> Result<OnStop, ConfigError> {
        match name.get_ref().as_str() {
            "return" => Ok(OnStop::Return),
            "hold" => Ok(OnStop::Hold),
            other => {
                Err(self.fault(name.span().start, format!("on_stop = {other:?}: there are return and hold")))
            }
        }
    }

    pub fn models<'f>(&self, file: &'f File) -> Result<&'f [PathBuf], ConfigError> {
        let Some(models) = &file.models else { return Ok(&[]) };
        if models.get_ref().len() > MOST_MODELS {
            let what = format!("models: more than {MOST_MODELS} entries: leave some out");
            return Err(self.fault(models.span().start, what));
        }
        Ok(models.get_ref())
    }

    fn operators(&self, entries: &[Spanned<String>]) -> Result<Operators, ConfigError> {
        let mut operators = Operators::none();
        for entry in entries {
            let at = entry.span().start;
            let operator = entry
                .get_ref()
                .parse()
                .map_err(|error| self.fault(at, format!("operators: {:?}: {error}", entry.get_ref())))?;
            if !operators.add(operator) {
                return Err(self.fault(at, format!("operators: more than {} entries", Operators::MAX)));
            }
        }
        Ok(operators)
    }

    pub fn radio_format(&self, file: &File) -> Result<RadioFormat, ConfigError> {
        let calibration =
            file.radio_snr.as_ref().map(|snr| Calibration { offset: Db(snr.offset_db), slope: snr.slope });
        let Some(name) = &file.radio_format else { return Ok(RadioFormat::Cobs) };
        match name.get_ref().as_str() {
            "cobs" => Ok(RadioFormat::Cobs),
            "json_lines" => Ok(RadioFormat::JsonLines(calibration.unwrap_or_default())),
            "semtech_udp" => Ok(RadioFormat::SemtechUdp(calibration.unwrap_or(Calibration::LORA))),
            other => Err(self.fault(
                name.span().start,
                format!("radio_format = {other:?}: there are cobs, json_lines and semtech_udp"),
            )),
        }
    }

    pub fn signing(&self, file: &File, folder: &Path) -> Result<Option<SigningConfig>, ConfigError> {
        let Some(table) = &file.signing else { return Ok(None) };
        let mut ports = Vec::new();
        for port in table.ports.iter().flatten() {
            if !["autopilot", "ground"].contains(&port.get_ref().as_str()) {
                let what = format!("signing.ports: {:?}: a port is autopilot or ground", port.get_ref());
                return Err(self.fault(port.span().start, what));
            }
            ports.push(port.get_ref().clone());
        }
        if table.ports.is_none() {
            ports.push("ground".to_owned());
        }
        Ok(Some(SigningConfig { key: folder.join(&table.key), ports }))
    }

    pub fn http(&self, page: &PageTable) -> Result<Option<SocketAddr>, ConfigError> {
        let Some(text) = &page.http else { return Ok(None) };
        let address = http_address(text.get_ref());
        address.map(Some).map_err(|error| self.fault(text.span().start, format!("page.http: {error}")))
    }

    pub fn page_tokens(&self, page: &PageTable) -> Result<Option<[Token; 2]>, ConfigError> {
        let token = |key, text: &Spanned<String>| {
            Token::new(text.get_ref())
                .map_err(|error| self.fault(text.span().start, format!("page.{key}: {error}")))
        };
        match (&page.view_token, &page.control_token) {
            (None, None) => Ok(None),
            (Some(view), Some(control)) if view.get_ref() == control.get_ref() => Err(self.fault(
                control.span().start,
                "page.control_token: it equals view_token: viewers would have control".into(),
            )),
            (Some(view), Some(control)) => {
                Ok(Some([token("view_token", view)?, token("control_token", control)?]))
            }
            (Some(one), None) | (None, Some(one)) => {
                Err(self
                    .fault(one.span().start, "page: give view_token and control_token, or neither".into()))
            }
        }
    }

    pub fn limits(&self, table: &LogTable) -> Result<Limits, ConfigError> {
        let bytes = |key, value: &Option<Spanned<i64>>, default: u32, most: u32| {
            let megabytes = match value {
                Some(value) => self.number(key, value, 1..=most, "in megabytes")?,
                None => default,
            };
            Ok(u64::from(megabytes) << 20)
        };
        Ok(Limits {
            file_bytes: bytes("file_mb", &table.file_mb, 64, 4_096)?,
            min_free_bytes: bytes("min_free_mb", &table.min_free_mb, 256, 1 << 20)?,
        })
    }

    fn number<N: TryFrom<i64> + PartialOrd + std::fmt::Display>(
        &self,
        key: &str,
        value: &Spanned<i64>,
        allowed: std::ops::RangeInclusive<N>,
        advice: &str,
    ) -> Result<N, ConfigError> {
        N::try_from(*value.get_ref()).ok().filter(|number| allowed.contains(number)).ok_or_else(|| {
            let (low, high) = (allowed.start(), allowed.end());
            let what =
                format!("{key} = {}: it must be a number from {low} to {high}, {advice}", value.get_ref());
            self.fault(value.span().start, what)
        })
    }

    pub fn parameters(&self, values: &BTreeMap<String, Spanned<f64>>) -> Result<Parameters, ConfigError> {
        let mut parameters = super::default_parameters();
        for (name, value) in values {
            let at = |what| self.fault(value.span().start, format!("{name} = {}: {what}", value.get_ref()));
            if name == "GLN_ENABLE" {
                return Err(at("only a request in flight may engage: remove this line".into()));
            }
            if let Err(error) = parameters.set(name, *value.get_ref() as f32) {
                return Err(at(format!("{error}: correct or remove this line")));
            }
        }
        Ok(parameters)
    }
}
