//! The city from above with the path of a mission.

use crate::judge::explanation::Track;
use gleaner_units::HeightMap;
use maud::{Markup, html};
use std::collections::BTreeMap;

/// Side of a cell.
const CELL: f64 = 10.0;
/// Classes of roofs, by height.
const ROOFS: [(u8, u8); 4] = [(1, 12), (13, 25), (26, 38), (39, u8::MAX)];

/// The roofs, once per page; each mission refers to them.
pub(super) fn city(heights: &HeightMap) -> Markup {
    let grid = heights.grid();
    let roofs = |(low, high): (u8, u8)| -> String {
        let built = grid.cells().filter(|&cell| {
            heights.height_m(cell).is_some_and(|height_m| height_m >= low && height_m <= high)
        });
        built
            .map(|cell| {
                let (x, y) = (f64::from(cell.x) * CELL, top(heights, cell.y));
                format!("M{x} {y}h9.6v9.6h-9.6z")
            })
            .collect()
    };
    html! {
        svg.hidden width="0" height="0" aria-hidden="true" {
            symbol #city viewBox=(view(heights)) {
                rect.ground x="-6" y="-6" width="100%" height="100%" {}
                @for (index, class) in ROOFS.into_iter().enumerate() {
                    path class=(format!("roof{index}")) d=(roofs(class)) {}
                }
            }
        }
    }
}

/// One mission.
pub(super) fn mission(words: &str, heights: &HeightMap, track: &Track) -> Markup {
    let at = |&(x, y): &(i16, i16)| ((f64::from(x) + 0.5) * CELL, top(heights, y) + 0.5 * CELL);
    let way: Vec<String> = track.cells.iter().map(at).map(|(x, y)| format!("{x},{y}")).collect();
    let way = way.join(" ");
    let mut hovers: BTreeMap<(i16, i16), u32> = BTreeMap::new();
    for pair in track.cells.windows(2).filter(|pair| pair[0] == pair[1]) {
        *hovers.entry(pair[0]).or_default() += 1;
    }
    let ends = [track.cells.first(), track.cells.last()].map(|cell| cell.map(at).unwrap_or_default());
    html! {
        svg viewBox=(view(heights)) role="img" aria-label=(words) {
            use href="#city" x="-6" y="-6" width="100%" height="100%" {}
            polyline.halo points=(way) {}
            polyline.way points=(way) {}
            @for (cell, slots) in &hovers {
                @let (x, y) = at(cell);
                circle.hover cx=(x) cy=(y) r=(format!("{:.1}", (16.0 + 9.0 * f64::from(*slots)).sqrt())) {
                    title { "hovered for " (slots) " slots" }
                }
            }
            @for &(x, y, collected) in &track.devices {
                @let (cx, cy) = at(&(x, y));
                circle.device cx=(cx) cy=(cy) r="5.5" { title { "device: " (format!("{:.0}", 100.0 * collected)) " % collected" } }
                path.collected d=(slice(cx, cy, 5.5, f64::from(collected))) {}
            }
            @if ends[0] == ends[1] {
                (zone(ends[0], "B"))
            } @else {
                (zone(ends[0], "S")) (zone(ends[1], "T"))
            }
        }
    }
}

fn zone((x, y): (f64, f64), letter: &str) -> Markup {
    html! {
        rect.zone x=(x - 6.0) y=(y - 6.0) width="12" height="12" rx="2.5" {}
        text.letter x=(x) y=(y + 3.6) text-anchor="middle" { (letter) }
    }
}

/// A slice of a disc from the top, clockwise.
fn slice(x: f64, y: f64, r: f64, share: f64) -> String {
    if share >= 0.999 {
        return format!("M{} {y}a{r} {r} 0 1 1 {} 0a{r} {r} 0 1 1 {} 0z", x - r, 2.0 * r, -2.0 * r);
    }
    let angle = std::f64::consts::TAU * share.max(0.0);
    let (dx, dy) = (r * angle.sin(), r * angle.cos());
    format!("M{x} {y}V{}A{r} {r} 0 {} 1 {:.2} {:.2}z", y - r, u8::from(share > 0.5), x + dx, y - dy)
}

fn view(heights: &HeightMap) -> String {
    let grid = heights.grid();
    // A margin for the symbols of devices at the edge.
    format!("-6 -6 {} {}", f64::from(grid.width()) * CELL + 12.0, f64::from(grid.height()) * CELL + 12.0)
}

/// North is up.
fn top(heights: &HeightMap, y: i16) -> f64 {
    (f64::from(heights.grid().height()) - 1.0 - f64::from(y)) * CELL
}
