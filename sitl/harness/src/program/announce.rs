//! Before a flight with a pilot outside this process: the ports and the mission file.

use super::ProgramError;
use crate::MissionSetup;
use gleaner_pilot::mission_file;
use gleaner_ports::{Endpoint, Port};
use std::io::{self, Write};
use std::path::Path;

/// Prints one line per endpoint, with the port number that the system chose for port 0, then the mission file and the
/// addresses of the page.
pub(super) fn ports(
    roles: &[(&str, Option<&Port>)],
    onboard: Option<&str>,
    mission: Option<&Path>,
    page: &[(&'static str, String)],
) -> Result<(), ProgramError> {
    let mut out = io::stdout().lock();
    let mut say = |line: String| writeln!(out, "{line}").map_err(ProgramError::Stdout);
    for (role, port) in roles {
        if let Some(port) = port {
            say(format!("{role} {}", endpoint(port)))?;
        }
    }
    if let Some(model) = onboard {
        say(format!("onboard {model}"))?;
    }
    if let Some(path) = mission {
        say(format!("mission {}", path.display()))?;
    }
    for (right, address) in page {
        say(format!("{right} {address}"))?;
    }
    out.flush().map_err(ProgramError::Stdout)
}

/// The endpoint with the bound port number.
fn endpoint(port: &Port) -> String {
    match (port.endpoint(), port.local_address()) {
        (Endpoint::UdpIn(_), Some(address)) => format!("udpin:{address}"),
        (Endpoint::TcpIn(_), Some(address)) => format!("tcpin:{address}"),
        (endpoint, _) => endpoint.to_string(),
    }
}

/// Writes the mission file that the pilot needs, and the city beside it.
pub(super) fn write_mission(setup: &MissionSetup, path: &Path) -> Result<(), ProgramError> {
    let city = path.with_extension("city.csv");
    let name = city.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let fail = |path: &Path| {
        let path = path.to_owned();
        move |source| ProgramError::Write { path, source }
    };
    std::fs::write(&city, setup.world.city().to_csv()).map_err(fail(&city))?;
    std::fs::write(path, mission_file::write(&setup.mission, &name)).map_err(fail(path))
}
