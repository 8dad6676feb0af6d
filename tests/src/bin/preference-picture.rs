//! Flies the same mission at w = 1, 0.5 and 0 and sets the three pictures side by side, for the README.
//!
//! usage: preference-picture FILE

use anyhow::{Context, Result, bail, ensure};
use gleaner_tests::programs;
use serde_json::Value;
use std::fs;
use std::process::Command;

const PREFERENCES: [&str; 3] = ["1", "0.5", "0"];
const PANEL_WIDTH: f32 = 420.0;
const GAP: f32 = 16.0;
const CAPTION_HEIGHT: f32 = 58.0;
/// Fill of the map's background in the simulator's picture.
const MAP_FILL: &str = "#f6f4ef";

/// One flight: its picture and what it achieved.
struct FlownMission {
    w_data: &'static str,
    picture: String,
    report: Value,
}

fn fly(w_data: &'static str) -> Result<FlownMission> {
    let folder = tempfile::tempdir()?;
    let output = Command::new(programs::path("gleaner-sitl"))
        .current_dir(programs::repository())
        .args(["fly", "--json", "--scenario", "rd", "--seed", "3", "--preference", w_data, "--out"])
        .arg(folder.path())
        .output()?;
    ensure!(output.status.success(), "gleaner-sitl fly: {}", String::from_utf8_lossy(&output.stderr));
    let picture = fs::read_to_string(folder.path().join("trajectory.svg"))?;
    Ok(FlownMission { w_data, picture, report: serde_json::from_slice(&output.stdout)? })
}

/// The number in an attribute of an element.
fn attribute(element: &str, name: &str) -> Result<f32> {
    let value = element.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
    value.with_context(|| format!("{name} of {element}"))?.parse().context("a number")
}

/// Left, top, width and height of the map inside the picture.
fn map(picture: &str) -> Result<[f32; 4]> {
    let rectangles = picture.split("<rect").skip(1).filter_map(|rest| rest.split('>').next());
    let found = rectangles.filter(|rectangle| rectangle.contains(MAP_FILL)).collect::<Vec<_>>();
    let [background] = found[..] else { bail!("{} maps in one picture", found.len()) };
    Ok([
        attribute(background, "x")?,
        attribute(background, "y")?,
        attribute(background, "width")?,
        attribute(background, "height")?,
    ])
}

fn panel(flight: &FlownMission, left: f32) -> Result<(String, f32)> {
    let FlownMission { w_data, picture, report } = flight;
    let [x, y, width, height] = map(picture)?;
    let content = picture.split_once("<svg").and_then(|(_, rest)| rest.split_once('>'));
    let (_, content) = content.context("an SVG picture")?;
    let panel_height = PANEL_WIDTH * height / width;
    let collected = 100.0 * report["collected"].as_f64().context("collected")?;
    let energy = report["energy"].as_f64().context("energy")?;
    let text = format!(
        "<text x=\"{left}\" y=\"24\" font-size=\"20\" font-weight=\"700\" fill=\"#1f2933\">w = {w_data}</text>\n\
         <text x=\"{left}\" y=\"46\" font-size=\"15\" fill=\"#52606d\">{collected:.0} % of the data for {energy} battery \
         units</text>\n\
         <svg x=\"{left}\" y=\"{CAPTION_HEIGHT}\" width=\"{PANEL_WIDTH}\" height=\"{panel_height}\" \
         viewBox=\"{x} {y} {width} {height}\">{content}\n"
    );
    Ok((text, panel_height))
}

fn main() -> Result<()> {
    let file = std::env::args().nth(1).context("usage: preference-picture FILE")?;
    let mut panels = String::new();
    let mut height = 0.0_f32;
    let mut left = GAP;
    for w_data in PREFERENCES {
        let (text, panel_height) = panel(&fly(w_data)?, left)?;
        panels += &text;
        height = height.max(panel_height);
        left += PANEL_WIDTH + GAP;
    }
    let height = CAPTION_HEIGHT + height + GAP;
    let page = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {left} {height}\" width=\"{left}\" height=\"{height}\" \
         font-family=\"Inter, 'Helvetica Neue', Arial, sans-serif\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{panels}</svg>\n"
    );
    fs::write(&file, page).with_context(|| format!("{file}: cannot be written"))
}
