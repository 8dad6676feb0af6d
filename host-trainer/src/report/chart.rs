//! Charts as SVG: axes, lines, marks, bars and heat maps. Colours come from the page's style sheet by class, so that
//! one drawing serves light, dark and print.

use maud::{Markup, html};

const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 310.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 46.0;
/// Half the size of a mark.
const MARK: f64 = 4.6;

/// Appearance of a series: the class of its colour, and the shape of its marks, which identifies it without colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Look {
    pub class: &'static str,
    pub shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Square,
    Disc,
    Triangle,
    Diamond,
    Down,
    Cross,
    Plus,
    Ring,
    Bar,
    Star,
}

/// The oracle, the proven bound and the paper's numbers look the same in all charts.
pub(super) const ORACLE: Look = Look { class: "oracle", shape: Shape::Ring };
pub(super) const BOUND: Look = Look { class: "bound", shape: Shape::Bar };
pub(super) const PAPER: Look = Look { class: "paper", shape: Shape::Star };

/// The style of the system at this index of the report; GREEDY is the first.
pub(super) fn look(place: usize) -> Look {
    const LOOKS: [Look; 7] = [
        Look { class: "c0", shape: Shape::Square },
        Look { class: "c1", shape: Shape::Disc },
        Look { class: "c2", shape: Shape::Triangle },
        Look { class: "c3", shape: Shape::Diamond },
        Look { class: "c4", shape: Shape::Down },
        Look { class: "c5", shape: Shape::Cross },
        Look { class: "c6", shape: Shape::Plus },
    ];
    if place == 0 { LOOKS[0] } else { LOOKS[1 + (place - 1) % (LOOKS.len() - 1)] }
}

/// One axis: title, range and labels.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    label: String,
    from: f64,
    to: f64,
    ticks: Vec<(f64, String)>,
}

impl Axis {
    /// An axis around these values with round ticks. Ends given in `fixed` are kept.
    pub fn around(label: &str, values: impl Iterator<Item = f64>, fixed: [Option<f64>; 2]) -> Axis {
        let (mut low, mut high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let margin = 0.05 * (high - low).max(1e-6 + high.abs() * 0.02);
        low = fixed[0].unwrap_or(low - margin);
        high = fixed[1].unwrap_or(high + margin).max(low + 1e-6);
        let step = round_step((high - low) / 6.0);
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        let ticks = (first..=last).map(|index| (index as f64 * step, number(index as f64 * step, step)));
        Axis { label: label.into(), from: low, to: high, ticks: ticks.collect() }
    }

    /// A category axis: the names at 0, 1, 2...
    pub fn of_names(label: &str, names: &[String]) -> Axis {
        let ticks = names.iter().enumerate().map(|(index, name)| (index as f64, name.clone()));
        Axis { label: label.into(), from: -0.55, to: names.len() as f64 - 0.45, ticks: ticks.collect() }
    }

    /// Reversed: small values far from the origin.
    pub fn reversed(mut self) -> Axis {
        (self.from, self.to) = (self.to, self.from);
        self
    }

    fn share(&self, value: f64) -> f64 {
        (value - self.from) / (self.to - self.from)
    }
}

/// 1, 2 or 5 times a power of ten, at least `least`.
fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].map(|digit| digit * power).into_iter().find(|&step| step >= least).unwrap_or(10.0 * power)
}

/// A tick label with the decimals that the step needs and thin spaces between thousands.
fn number(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    grouped(&format!("{:.decimals$}", if value == 0.0 { 0.0 } else { value }))
}

/// `12926` as `12 926`, with thin spaces; shorter numbers as they are.
pub(super) fn grouped(number: &str) -> String {
    let whole = number.find('.').unwrap_or(number.len());
    let digits = number[..whole].trim_start_matches('-').len();
    if digits < 5 {
        return number.replace('-', "\u{2212}");
    }
    let mut text = String::new();
    for (index, digit) in number.chars().enumerate() {
        let left = whole.saturating_sub(index);
        if index > 0 && index < whole && left % 3 == 0 && !text.ends_with('\u{2212}') {
            text.push('\u{2009}');
        }
        text.push(if digit == '-' { '\u{2212}' } else { digit });
    }
    text
}

/// A point, its error bar, and its tooltip.
#[derive(Clone, Debug)]
pub(super) struct Spot {
    pub x: f64,
    pub y: f64,
    pub spread: f64,
    pub said: String,
}

/// How the points of a series are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Joined {
    Not,
    Line,
    LineWithoutMarks,
    /// A line, and a band of the spread around it.
    Band,
    /// Bars from zero.
    Bars,
}

/// The points of one system.
#[derive(Clone, Debug)]
pub(super) struct Series {
    pub look: Look,
    pub spots: Vec<Spot>,
    pub joined: Joined,
}

/// Draws the series and their axes. `highlight` is a range of x with another background. `words` is the text for screen
/// readers.
pub(super) fn plot(
    words: &str,
    x: &Axis,
    y: &Axis,
    series: &[Series],
    highlight: Option<(f64, f64)>,
) -> Markup {
    let (width, height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    let at_x = |value: f64| LEFT + width * x.share(value);
    let at_y = |value: f64| TOP + height * (1.0 - y.share(value));
    html! {
        svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label=(words) {
            @if let Some((from, to)) = highlight {
                rect.highlight x=(px(at_x(from))) y=(px(TOP)) width=(px(at_x(to) - at_x(from))) height=(px(height)) {}
            }
            @for (value, text) in &y.ticks {
                line.grid x1=(px(LEFT)) x2=(px(LEFT + width)) y1=(px(at_y(*value))) y2=(px(at_y(*value))) {}
                text.tick x=(px(LEFT - 7.0)) y=(px(at_y(*value) + 4.0)) text-anchor="end" { (text) }
            }
            @for (value, text) in &x.ticks {
                line.notch x1=(px(at_x(*value))) x2=(px(at_x(*value))) y1=(px(TOP + height)) y2=(px(TOP + height + 4.0)) {}
                text.tick x=(px(at_x(*value))) y=(px(TOP + height + 17.0)) text-anchor="middle" { (text) }
            }
            line.axis x1=(px(LEFT)) x2=(px(LEFT + width)) y1=(px(TOP + height)) y2=(px(TOP + height)) {}
            text.label x=(px(LEFT + width / 2.0)) y=(px(HEIGHT - 8.0)) text-anchor="middle" { (x.label) }
            text.label transform=(format!("translate(13 {}) rotate(-90)", px(TOP + height / 2.0))) text-anchor="middle" { (y.label) }
            @for one in series {
                g class=(one.look.class) { (drawn(one, &at_x, &at_y)) }
            }
        }
    }
}

fn drawn(series: &Series, at_x: &dyn Fn(f64) -> f64, at_y: &dyn Fn(f64) -> f64) -> Markup {
    let joined = matches!(series.joined, Joined::Line | Joined::LineWithoutMarks | Joined::Band);
    let way: Vec<String> =
        series.spots.iter().map(|spot| format!("{},{}", px(at_x(spot.x)), px(at_y(spot.y)))).collect();
    html! {
        @if series.joined == Joined::Band && way.len() > 1 { polygon.band points=(band(series, at_x, at_y)) {} }
        @if joined && way.len() > 1 { polyline.line points=(way.join(" ")) {} }
        @for spot in &series.spots {
            @let (x, y) = (at_x(spot.x), at_y(spot.y));
            @if series.joined == Joined::Bars {
                @let half = 0.5 * (at_x(0.36) - at_x(0.0));
                rect.bar x=(px(x - half)) y=(px(y)) width=(px(2.0 * half)) height=(px((at_y(0.0) - y).max(0.0))) {
                    title { (spot.said) }
                }
            } @else if series.joined != Joined::LineWithoutMarks {
                @if spot.spread > 0.0 && series.joined != Joined::Band {
                    line.spread x1=(px(x)) x2=(px(x)) y1=(px(at_y(spot.y - spot.spread))) y2=(px(at_y(spot.y + spot.spread))) {}
                }
                path.mark d=(outline(series.look.shape, x, y)) { title { (spot.said) } }
            }
        }
    }
}

/// The outline of a band: the upper side from left to right, the lower side back.
fn band(series: &Series, at_x: &dyn Fn(f64) -> f64, at_y: &dyn Fn(f64) -> f64) -> String {
    let corner = |spot: &Spot, y: f64| format!("{},{}", px(at_x(spot.x)), px(at_y(y)));
    let upper = series.spots.iter().map(|spot| corner(spot, spot.y + spot.spread));
    let lower = series.spots.iter().rev().map(|spot| corner(spot, spot.y - spot.spread));
    upper.chain(lower).collect::<Vec<_>>().join(" ")
}

/// The SVG path of a mark.
fn outline(shape: Shape, x: f64, y: f64) -> String {
    let r = MARK;
    let polygon = |corners: &[(f64, f64)]| {
        let corners: Vec<String> =
            corners.iter().map(|(dx, dy)| format!("{},{}", px(x + dx * r), px(y + dy * r))).collect();
        format!("M{}Z", corners.join("L"))
    };
    let circle = |r: f64| {
        format!("M{},{}a{r},{r} 0 1 0 {},0a{r},{r} 0 1 0 {},0Z", px(x - r), px(y), 2.0 * r, -2.0 * r)
    };
    match shape {
        Shape::Disc => circle(r),
        Shape::Ring => format!("{}{}", circle(r * 1.1), circle(r * 0.55)),
        Shape::Square => polygon(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        Shape::Triangle => polygon(&[(0.0, -1.2), (1.15, 0.9), (-1.15, 0.9)]),
        Shape::Down => polygon(&[(0.0, 1.2), (1.15, -0.9), (-1.15, -0.9)]),
        Shape::Diamond => polygon(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
        Shape::Bar => polygon(&[(-2.0, -0.28), (2.0, -0.28), (2.0, 0.28), (-2.0, 0.28)]),
        Shape::Plus => polygon(&plus()),
        Shape::Cross => polygon(&plus().map(|(dx, dy)| (0.707 * (dx - dy), 0.707 * (dx + dy)))),
        Shape::Star => {
            let corner = |index: i32| {
                let angle = std::f64::consts::PI * f64::from(index) / 5.0;
                let radius = if index % 2 == 0 { 1.7 } else { 0.7 };
                (radius * angle.sin(), -radius * angle.cos())
            };
            polygon(&(0..10).map(corner).collect::<Vec<_>>())
        }
    }
}

fn plus() -> [(f64, f64); 12] {
    let (a, b) = (0.36, 1.25);
    [
        (-a, -b),
        (a, -b),
        (a, -a),
        (b, -a),
        (b, a),
        (a, a),
        (a, b),
        (-a, b),
        (-a, a),
        (-b, a),
        (-b, -a),
        (-a, -a),
    ]
}

/// The legend: marks and names.
pub(super) fn legend(entries: &[(String, Look)]) -> Markup {
    html! {
        ul.legend {
            @for (name, look) in entries {
                li {
                    svg viewBox="0 0 26 16" width="26" height="16" aria-hidden="true" {
                        g class=(look.class) {
                            polyline.line points="1,8 25,8" {}
                            path.mark d=(outline(look.shape, 13.0, 8.0)) {}
                        }
                    }
                    span { (name) }
                }
            }
        }
    }
}

/// A square matrix as a heat map with names on both sides. Rows and columns with an empty name are absent.
pub(super) fn heat_map(words: &str, names: &[String], matrix: &[Vec<f32>], strongest: f32) -> Markup {
    let cell = 19.0;
    let (left, top) = (80.0, 78.0);
    let side = cell * names.len() as f64;
    html! {
        svg viewBox=(format!("0 0 {} {}", left + side + 14.0, top + side + 24.0)) role="img" aria-label=(words) {
            rect.absent x=(px(left)) y=(px(top)) width=(px(side)) height=(px(side)) {}
            @for (index, name) in names.iter().enumerate() {
                @let middle = cell * (index as f64 + 0.5);
                text.tick x=(px(left - 6.0)) y=(px(top + middle + 4.0)) text-anchor="end" { (name) }
                text.tick transform=(format!("translate({} {}) rotate(-60)", px(left + middle + 3.0), px(top - 6.0))) { (name) }
            }
            @for (query, row) in matrix.iter().enumerate() {
                @for (key, &weight) in row.iter().enumerate() {
                    @if !names[query].is_empty() && !names[key].is_empty() {
                        @let (x, y) = (left + cell * key as f64, top + cell * query as f64);
                        rect.blank x=(px(x)) y=(px(y)) width=(px(cell - 1.0)) height=(px(cell - 1.0)) {}
                        rect.heat x=(px(x)) y=(px(y)) width=(px(cell - 1.0)) height=(px(cell - 1.0))
                            fill-opacity=(format!("{:.3}", (weight / strongest.max(1e-6)).clamp(0.0, 1.0))) {
                            title { (names[query]) " looks at " (names[key]) ": " (format!("{weight:.3}")) }
                        }
                    }
                }
            }
            text.label x=(px(left + side)) y=(px(top + side + 17.0)) text-anchor="end" { "rows: who looks (query); columns: at whom (key)" }
        }
    }
}

fn px(value: f64) -> String {
    let text = format!("{value:.1}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::around("x", [3.0, 87.0].into_iter(), [None, Some(100.0)]);
        let texts: Vec<&str> = axis.ticks.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(texts, ["0", "20", "40", "60", "80", "100"]);
        let axis = Axis::around("x", [0.12, 0.31].into_iter(), [Some(0.0), None]);
        let texts: Vec<&str> = axis.ticks.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(texts, ["0.0", "0.1", "0.2", "0.3"]);
        let nothing = Axis::around("x", std::iter::empty(), [None, None]);
        assert!(!nothing.ticks.is_empty());
    }

    #[test]
    fn long_numbers_are_grouped() {
        assert_eq!(grouped("12926"), "12\u{2009}926");
        assert_eq!(grouped("-1234567.25"), "\u{2212}1\u{2009}234\u{2009}567.25");
        assert_eq!(grouped("-81.9"), "\u{2212}81.9");
        assert_eq!(grouped("1234"), "1234");
    }
}
