//! What a program sets before the first poll, and why that may fail.

use crate::{MissionError, Rules};
use core::fmt;
use gleaner_link::{Operators, SettingsError};

/// Our identity on the link, and our limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// MAVLink system id of the vehicle to serve; `None` adopts that of the only autopilot heard.
    pub system_id: Option<u8>,
    /// MAVLink component id, 191 unless something else on the vehicle has it.
    pub component_id: u8,
    /// Ground stations that may command.
    pub operators: Operators,
    /// Limits of the mission machine.
    pub rules: Rules,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            system_id: None,
            component_id: 191,
            operators: Operators::default(),
            rules: Rules::DEFAULT,
        }
    }
}

impl Settings {
    /// The link's part of them.
    ///
    /// # Errors
    /// The ids are impossible.
    pub fn checked(self) -> Result<gleaner_link::Settings, SettingsError> {
        gleaner_link::Settings::new(self.system_id, self.component_id)
            .map(|settings| settings.with_operators(self.operators))
    }
}

/// Why there can be no pilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnboardError {
    /// The mission cannot be flown.
    Mission(MissionError),
    /// The ids are impossible.
    Settings(SettingsError),
    /// A mission was to be loaded over another, or after the first poll.
    Begun,
}

impl fmt::Display for OnboardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OnboardError::Mission(error) => write!(f, "mission: {error}"),
            OnboardError::Settings(error) => write!(f, "settings: {error}"),
            OnboardError::Begun => f.write_str("a mission is loaded once, before the first poll"),
        }
    }
}

impl core::error::Error for OnboardError {}

impl From<MissionError> for OnboardError {
    fn from(error: MissionError) -> OnboardError {
        OnboardError::Mission(error)
    }
}

impl From<SettingsError> for OnboardError {
    fn from(error: SettingsError) -> OnboardError {
        OnboardError::Settings(error)
    }
}
