//! The live page of a run. The decision loop hands it events and takes its commands; neither waits.

use crate::clock;
use crate::config::Config;
use crate::error::StartError;
use gleaner_dashboard::{Access, Dashboard, Question, Scene, Server, ServerError, live, scene, shown};
use gleaner_link::{Address, Parameters};
use gleaner_pilot::{Decision, Deliberator, LoggedDecision, Mission, Onboard};
use gleaner_units::Instant;
use std::time;

/// The page, where one is served.
pub struct Page {
    dashboard: Option<Dashboard>,
}

impl Page {
    /// Serves the page if the configuration asks for it.
    ///
    /// # Errors
    /// The address cannot be listened at, or the page's operator may not command.
    pub fn open(
        config: &Config,
        mission: &Mission,
        parameters: &Parameters,
        model: &str,
    ) -> Result<Page, StartError> {
        let Some(address) = config.http else { return Ok(Page { dashboard: None }) };
        let Address { system, component } = Dashboard::OPERATOR;
        if !config.settings.operators.allow(Dashboard::OPERATOR) {
            return Err(StartError::PageOperator { operator: format!("{system}/{component}") });
        }
        let altitude = parameters.altitude();
        let name = config.mission.file_stem().unwrap_or_default().to_string_lossy();
        let when = if config.models.is_empty() { "" } else { " at the start" };
        let title = format!("{name}, model {model}{when}");
        let scene = Scene { controls: true, ..scene(mission, altitude.0 as u16, title) };
        let access = Access::of(address, config.page_tokens.clone()).map_err(ServerError::from)?;
        let server = Server::start(address, access, scene)?;
        // The vehicle's system id is learned from the autopilot; until then no frame is this pilot's.
        let pilot = Address::new(config.settings.system_id.unwrap_or(0), config.settings.component_id);
        Ok(Page { dashboard: Some(Dashboard::new(server, mission, altitude, pilot)) })
    }

    /// Lines for the console. Tokens from the configuration are not printed.
    pub fn introduction(&self, has_tokens: bool) -> Vec<String> {
        let Some(dashboard) = &self.dashboard else { return Vec::new() };
        let links = dashboard.server().links();
        if has_tokens {
            return vec![format!(
                "page at http://{}/#token=..., with a token of the configuration",
                dashboard.server().address()
            )];
        }
        links.into_iter().map(|(right, address)| format!("{right} {address}")).collect()
    }

    /// Publishes what is due. Returns frames of the page's ground station for the pilot.
    pub fn poll<P: Deliberator>(&mut self, now: time::Instant, onboard: &Onboard<P>) -> Vec<Vec<u8>> {
        let Some(dashboard) = &mut self.dashboard else { return Vec::new() };
        dashboard.set_pilot(onboard.link().address());
        let at = clock::at(now);
        let frames = dashboard.poll(now, seconds(at), |station| live(at, onboard, station));
        if let Some(order) = dashboard.incident() {
            order.answer("only a simulation has incidents");
        }
        frames
    }

    /// A decision was made.
    pub fn decided<P: Deliberator>(&mut self, now: Instant, decision: &Decision, onboard: &Onboard<P>) {
        let Some(dashboard) = &mut self.dashboard else { return };
        let question = Question {
            decision: LoggedDecision::new(0, decision, None),
            devices: onboard.device_states(now).to_vec(),
            reserve: onboard.parameters().reserve(),
        };
        dashboard.decided(shown(decision), Some(question));
    }

    /// Bytes that the pilot sends.
    pub fn sent(&mut self, bytes: &[u8]) {
        if let Some(dashboard) = &mut self.dashboard {
            dashboard.heard(bytes);
        }
    }
}

fn seconds(at: Instant) -> f64 {
    at.as_micros() as f64 * 1e-6
}
