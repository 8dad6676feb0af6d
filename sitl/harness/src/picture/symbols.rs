//! The signs and colours of the picture.

use svg::node::element::{
    Circle, Definitions, Group, LinearGradient, Polygon, Rectangle, Stop, Text as Label,
};

pub(super) const INK: &str = "#1f2430";
pub(super) const QUIET: &str = "#6b7080";
/// Colours of time, from the first decision to the landing.
const TIME: [[f32; 3]; 4] =
    [[31.0, 78.0, 216.0], [139.0, 47.0, 201.0], [224.0, 49.0, 91.0], [245.0, 158.0, 11.0]];

pub(super) fn label(x: f32, y: f32, size: f32, colour: &str, text: &str) -> Label {
    Label::new(text).set("x", x).set("y", y).set("font-size", size).set("fill", colour)
}

/// With a white edge, readable over roofs and path. Two texts: not every viewer knows `paint-order`.
pub(super) fn haloed(text: &Label) -> Group {
    let edge = text.clone().set("fill", "#ffffff").set("stroke", "#ffffff").set("stroke-width", 3.5);
    Group::new().add(edge.set("stroke-linejoin", "round")).add(text.clone())
}

pub(super) fn device_symbol(cx: f32, cy: f32, id: &str, collected: f32) -> Group {
    let radius = 10.5_f32;
    let round = std::f32::consts::TAU * radius;
    let circle = || Circle::new().set("cx", cx).set("cy", cy).set("r", radius);
    let ring = circle()
        .set("fill", "none")
        .set("stroke", "#0b8f6a")
        .set("stroke-width", 3.6)
        .set("stroke-dasharray", format!("{:.2} {round:.2}", collected.clamp(0.0, 1.0) * round))
        // The ring begins at the top.
        .set("transform", format!("rotate(-90 {cx} {cy})"));
    Group::new()
        .add(Circle::new().set("cx", cx).set("cy", cy).set("r", radius + 2.8).set("fill", "#ffffff"))
        .add(circle().set("fill", "#ffffff").set("stroke", "#cfd3da").set("stroke-width", 3.6))
        .add(ring)
        .add(label(cx, cy + 4.3, 12.0, INK, id).set("text-anchor", "middle").set("font-weight", 700))
}

pub(super) fn disc_symbol(cx: f32, cy: f32) -> Circle {
    Circle::new()
        .set("cx", cx)
        .set("cy", cy)
        .set("r", 8.0)
        .set("fill", time_colour(0.35))
        .set("fill-opacity", 0.55)
}

pub(super) fn zone(cx: f32, cy: f32, colour: &str, letter: &str) -> Group {
    Group::new()
        .add(
            Rectangle::new()
                .set("x", cx - 11.0)
                .set("y", cy - 11.0)
                .set("width", 22)
                .set("height", 22)
                .set("rx", 4)
                .set("fill", colour)
                .set("stroke", "#ffffff")
                .set("stroke-width", 2),
        )
        .add(
            label(cx, cy + 5.0, 14.0, "#ffffff", letter).set("text-anchor", "middle").set("font-weight", 700),
        )
}

pub(super) fn diamond(cx: f32, cy: f32, number: &str) -> Group {
    let r = 11.0;
    let corners = [(cx, cy - r), (cx + r, cy), (cx, cy + r), (cx - r, cy)];
    let points: Vec<String> = corners.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let shape = Polygon::new()
        .set("points", points.join(" "))
        .set("fill", "#ffd54a")
        .set("stroke", INK)
        .set("stroke-width", 1.6);
    let text = label(cx, cy + 3.9, 11.0, INK, number).set("text-anchor", "middle").set("font-weight", 700);
    Group::new().add(shape).add(text)
}

pub(super) fn building_colour(height_m: u8) -> String {
    let share = f32::from(height_m.min(50)) / 50.0;
    mixed(&[[226.0, 222.0, 212.0], [122.0, 119.0, 118.0]], share)
}

pub(super) fn time_colour(share: f32) -> String {
    mixed(&TIME, share)
}

fn mixed(stops: &[[f32; 3]], share: f32) -> String {
    let place = share.clamp(0.0, 1.0) * (stops.len() - 1) as f32;
    let low = (place as usize).min(stops.len() - 2);
    let part = place - low as f32;
    let [r, g, b] = [0, 1, 2].map(|i| (stops[low][i] + part * (stops[low + 1][i] - stops[low][i])) as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

pub(super) fn time_gradient() -> Definitions {
    let stops = (0..TIME.len()).map(|index| {
        let share = index as f32 / (TIME.len() - 1) as f32;
        Stop::new().set("offset", share).set("stop-color", time_colour(share))
    });
    Definitions::new()
        .add(stops.fold(LinearGradient::new().set("id", "time"), |gradient, stop| gradient.add(stop)))
}

pub(super) fn clock(seconds: f32) -> String {
    let whole = seconds as u32;
    format!("{}:{:02} min", whole / 60, whole % 60)
}
