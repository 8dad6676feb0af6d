//! Scenario names on the command line, in any case.

use gleaner_world::ScenarioKind;

/// `rd`, `RD`, `rb` or `RB`.
pub fn parse(name: &str) -> Result<ScenarioKind, String> {
    name.to_ascii_lowercase().parse().map_err(|_| "unknown scenario: use rd or rb".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenario_names_are_accepted_in_any_case() {
        assert_eq!(parse("RD"), Ok(ScenarioKind::ReachDestination));
        assert_eq!(parse("rB"), Ok(ScenarioKind::ReturnBase));
        assert!(parse("rx").is_err());
    }
}
