//! The page itself: one HTML file with style and scripts inside, for the server and for a finished flight.

use crate::flight::{Flight, json};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

const PAGE: &str = include_str!("../assets/page.html");
const STYLE: &str = include_str!("../assets/page.css");
/// In order of use. Together they are one script.
const SCRIPT: &str = concat!(
    include_str!("../assets/flight.js"),
    include_str!("../assets/map.js"),
    include_str!("../assets/panels.js"),
    include_str!("../assets/charts.js"),
    include_str!("../assets/source.js"),
    include_str!("../assets/main.js"),
);

/// A finished flight as one self-contained HTML file: no server, no network, no other file.
#[must_use]
pub fn render(flight: &Flight) -> String {
    // Inside a script element only `<` could end the data.
    fill(&json(flight).replace('<', "\\u003c"))
}

/// The page that asks its server for the flight.
pub(crate) fn live() -> String {
    fill("")
}

fn fill(flight: &str) -> String {
    PAGE.replacen("/*STYLE*/", STYLE, 1).replacen("/*SCRIPT*/", SCRIPT, 1).replacen("/*FLIGHT*/", flight, 1)
}

/// `Content-Security-Policy` of the served page: its own script, its own server, nothing else.
pub(crate) fn security_policy() -> String {
    let script = STANDARD.encode(Sha256::digest(SCRIPT));
    format!(
        "default-src 'none'; connect-src 'self'; img-src data:; style-src 'unsafe-inline'; \
         script-src 'sha256-{script}'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Event, Grid, Scene, Text};

    fn flight() -> Flight {
        let grid = Grid { width: 2, height: 1, cell_m: 20.0, rotation_deg: 0.0 };
        Flight::new(Scene {
            title: "test".into(),
            grid,
            heights_m: vec![0, 12],
            fence: None,
            sight: Vec::new(),
            altitude_m: 60,
            terminal: [0, 0],
            devices: Vec::new(),
            battery_units: 80.0,
            controls: false,
            incidents: Vec::new(),
        })
    }

    #[test]
    fn the_file_holds_the_flight_and_needs_no_other() {
        let mut flight = flight();
        let text = "</script><script>alert(1)</script>".to_owned();
        flight.add(Event::Text(Text { t_s: 0.0, severity: 4, text }));
        let page = render(&flight);
        assert!(!page.contains("<script>alert"), "text of the flight must stay data");
        assert!(!page.contains("http://") || !page.contains("src=\"http"), "no file from elsewhere");
        let start = page.find(r#"id="flight">"#).unwrap() + r#"id="flight">"#.len();
        let end = start + page[start..].find("</script>").unwrap();
        let read: Flight = serde_json::from_str(&page[start..end]).unwrap();
        assert_eq!(read, flight);
    }

    #[test]
    fn the_page_stays_small() {
        assert!(live().len() < 100_000, "{} bytes", live().len());
        assert!(!live().contains("/*STYLE*/") && !live().contains("/*SCRIPT*/"));
    }
}
