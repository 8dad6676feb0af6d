//! Who may command: the allow-list of ground stations.

use crate::address::Address;
use core::fmt;
use core::str::FromStr;

/// One entry of the allow-list; `None` stands for any id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operator {
    /// System id of the ground station.
    pub system: Option<u8>,
    /// Component id of the ground station.
    pub component: Option<u8>,
}

impl Operator {
    /// Whether `sender` matches.
    #[must_use]
    pub fn is(&self, sender: Address) -> bool {
        self.system.is_none_or(|system| system == sender.system)
            && self.component.is_none_or(|component| component == sender.component)
    }
}

/// Why a text is no entry of the allow-list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OperatorSyntax;

impl fmt::Display for OperatorSyntax {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an operator is SYSTEM, SYSTEM/COMPONENT or */COMPONENT, with ids from 1 to 255")
    }
}

impl core::error::Error for OperatorSyntax {}

impl FromStr for Operator {
    type Err = OperatorSyntax;

    /// `255`, `255/190` or `*/190`.
    fn from_str(text: &str) -> Result<Operator, OperatorSyntax> {
        let id = |part: &str| match part {
            "*" => Ok(None),
            _ => part.parse::<u8>().ok().filter(|&id| id != 0).map(Some).ok_or(OperatorSyntax),
        };
        let (system, component) = text.split_once('/').unwrap_or((text, "*"));
        let operator = Operator { system: id(system)?, component: id(component)? };
        if operator.system.is_none() && operator.component.is_none() {
            Err(OperatorSyntax)
        } else {
            Ok(operator)
        }
    }
}

impl fmt::Display for Operator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (separator, id) in [("", self.system), ("/", self.component)] {
            f.write_str(separator)?;
            match id {
                Some(id) => write!(f, "{id}")?,
                None => f.write_str("*")?,
            }
        }
        Ok(())
    }
}

/// The allow-list. Ids are no proof of identity: on a shared or public link, use signing as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operators {
    entries: [Option<Operator>; Operators::MAX],
}

impl Default for Operators {
    /// System 255, which ground stations use (ArduPilot's `SYSID_MYGCS`), and 245/190, which MAVSDK uses as a ground
    /// station. MAVLink names component 190 (`MAV_COMP_ID_MISSIONPLANNER`) "GCS or developer API": on the system of a
    /// vehicle it is a program on board, and commands only if it is listed.
    fn default() -> Operators {
        let mut operators = Operators::none();
        let defaults = [
            Operator { system: Some(255), component: None },
            Operator { system: Some(245), component: Some(190) },
        ];
        for operator in defaults {
            let _ = operators.add(operator);
        }
        operators
    }
}

impl Operators {
    /// The most entries.
    pub const MAX: usize = 8;

    /// An empty list: no one may command.
    #[must_use]
    pub const fn none() -> Operators {
        Operators { entries: [None; Operators::MAX] }
    }

    /// Adds an entry; false when the list is full.
    pub fn add(&mut self, operator: Operator) -> bool {
        match self.entries.iter_mut().find(|entry| entry.is_none()) {
            Some(entry) => {
                *entry = Some(operator);
                true
            }
            None => false,
        }
    }

    /// Whether `sender` may command.
    #[must_use]
    pub fn allow(&self, sender: Address) -> bool {
        self.entries.iter().flatten().any(|operator| operator.is(sender))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn operators_are_read_and_written() {
        for text in ["255/*", "255/190", "*/190"] {
            assert_eq!(text.parse::<Operator>().map(|operator| operator.to_string()), Ok(text.into()));
        }
        assert_eq!("245".parse::<Operator>(), Ok(Operator { system: Some(245), component: None }));
        for text in ["", "*", "*/*", "0", "256", "255/0", "255/190/1", "gcs"] {
            assert_eq!(text.parse::<Operator>(), Err(OperatorSyntax), "{text:?}");
        }
    }

    #[test]
    fn the_default_list_allows_ground_stations_only() {
        let operators = Operators::default();
        for sender in [(255, 190), (255, 230), (245, 190)] {
            assert!(operators.allow(Address::new(sender.0, sender.1)), "{sender:?}");
        }
        for sender in [(1, 1), (254, 191), (7, 192), (1, 190), (2, 190), (245, 191)] {
            assert!(!operators.allow(Address::new(sender.0, sender.1)), "{sender:?}");
        }
    }
}
