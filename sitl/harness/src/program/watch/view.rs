//! One picture of the flight: the same essentials as the web page.

use gleaner_dashboard::{Decision, Flight, Live};
use gleaner_units::Action;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize as _};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Circle, Line as Stroke, Points};
use ratatui::widgets::{Block, Paragraph, Row, Table};

/// Buildings of this height and more are drawn brighter, m.
const TALL_M: u8 = 25;
/// Width of the panels beside the map, characters.
const PANELS: u16 = 56;
/// Length of a bar, characters.
const BAR: f32 = 20.0;

pub(super) fn draw(frame: &mut Frame<'_>, flight: &Flight, keys: &str) {
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(10), Constraint::Length(5)])
            .areas(frame.area());
    let [left, right] = Layout::horizontal([Constraint::Min(20), Constraint::Length(PANELS)]).areas(body);
    let [status, decision, devices, forecast] = Layout::vertical([
        Constraint::Length(9),
        Constraint::Length(8),
        Constraint::Min(4),
        Constraint::Length(8),
    ])
    .areas(right);
    frame.render_widget(Line::from(flight.scene.title.as_str()).bold(), head);
    let (live, last) = (flight.live.last(), flight.decisions.last());
    map(frame, left, flight, live, last);
    frame.render_widget(Paragraph::new(status_lines(live)).block(titled("Who has the aircraft")), status);
    frame.render_widget(Paragraph::new(decision_lines(last)).block(titled("Decision")), decision);
    frame.render_widget(device_table(flight, live), devices);
    frame.render_widget(Paragraph::new(forecast_lines(flight)).block(titled("What if")), forecast);
    let texts = flight.texts.iter().rev().take(3);
    let texts: Vec<Line<'_>> =
        texts.map(|text| Line::from(format!("{:>5.0} s  {}", text.t_s, text.text))).collect();
    frame.render_widget(Paragraph::new(texts).block(titled("Messages").title_bottom(keys.to_owned())), foot);
}

fn titled(title: &str) -> Block<'_> {
    Block::bordered().title(Span::from(format!(" {title} ")).bold())
}

/// Terminal colours by name: they follow the colours that the person has chosen.
fn map(frame: &mut Frame<'_>, area: Rect, flight: &Flight, live: Option<&Live>, last: Option<&Decision>) {
    let scene = &flight.scene;
    let (width, height) = (f64::from(scene.grid.width), f64::from(scene.grid.height));
    let cells = |tall: bool| -> Vec<(f64, f64)> {
        let built = scene.heights_m.iter().enumerate().filter(|&(_, &height_m)| height_m > 0);
        let wanted = built.filter(|&(_, &height_m)| (height_m >= TALL_M) == tall);
        let corners = wanted.map(|(index, _)| {
            let wide = usize::from(scene.grid.width).max(1);
            ((index % wide) as f64, (index / wide) as f64)
        });
        corners.flat_map(|(x, y)| [(x + 0.25, y + 0.25), (x + 0.75, y + 0.75)]).collect()
    };
    let (low, tall) = (cells(false), cells(true));
    let track: Vec<(f64, f64)> =
        flight.live.iter().filter_map(|live| Some((live.x?.into(), live.y?.into()))).collect();
    let canvas = Canvas::default()
        .block(titled("City"))
        .marker(Marker::Braille)
        .x_bounds([0.0, width])
        .y_bounds([0.0, height])
        .paint(|context| {
            context.draw(&Points { coords: &low, color: Color::DarkGray });
            context.draw(&Points { coords: &tall, color: Color::Gray });
            context.layer();
            context.draw(&Points { coords: &track, color: Color::LightBlue });
            if let (Some((x, y)), Some(last)) = (track.last(), last) {
                for (site, weight) in attended(flight, last) {
                    if weight > 0.1 {
                        context.draw(&Stroke {
                            x1: *x,
                            y1: *y,
                            x2: site.0,
                            y2: site.1,
                            color: Color::Yellow,
                        });
                    }
                }
            }
            context.layer();
            for (device, state) in scene.devices.iter().zip(live.map_or(&[][..], |live| &live.devices)) {
                let colour = if state.reachable { Color::Green } else { Color::Red };
                let words =
                    Span::styled(format!("{}:{:.0}", device.id, state.remaining), Style::new().fg(colour));
                context.print(f64::from(device.x) + 0.5, f64::from(device.y) + 0.5, Line::from(words));
            }
            let [x, y] = scene.terminal.map(|at| f64::from(at) + 0.5);
            context.print(x, y, Line::from("T".magenta().bold()));
            if let Some(&(x, y)) = track.last() {
                context.draw(&Circle { x, y, radius: 0.7, color: Color::LightRed });
            }
        });
    frame.render_widget(canvas, area);
}

/// Where each device stands and how much the aircraft's token attends to it.
fn attended<'f>(flight: &'f Flight, last: &'f Decision) -> impl Iterator<Item = ((f64, f64), f32)> + 'f {
    let row = last.attention.as_ref().and_then(|rows| rows.first());
    // Aircraft, preference and map come before the devices.
    let weights = row.into_iter().flat_map(|row| row.iter().skip(3));
    last.slots.iter().zip(weights).filter_map(|(&slot, &weight)| {
        let device = flight.scene.devices.get(usize::from(slot))?;
        Some(((f64::from(device.x) + 0.5, f64::from(device.y) + 0.5), weight))
    })
}

fn status_lines(live: Option<&Live>) -> Vec<Line<'static>> {
    let Some(live) = live else { return vec!["No aircraft yet".into()] };
    let known =
        |value: Option<f32>, unit: &str| value.map_or("unknown".into(), |value| format!("{value:.0}{unit}"));
    vec![
        Line::from(live.owner.clone()).bold(),
        Line::from(live.reason.clone()),
        format!("state {}, mode {}, height {}", live.state, live.mode, known(live.height_m, " m")).into(),
        format!("preference w {:.2}", live.w_data).into(),
        format!("collected {:5.1} %  {}", 100.0 * live.collected, bar(live.collected)).into(),
        format!(
            "battery {} units, spare {}",
            known(live.battery_units, ""),
            known(live.spare_units, " units")
        )
        .into(),
        format!("charge {}, at touchdown {}", known(live.battery_pct, " %"), known(live.land_pct, " %"))
            .into(),
    ]
}

fn decision_lines(last: Option<&Decision>) -> Vec<Line<'static>> {
    let Some(last) = last else { return vec!["No decision yet".into()] };
    let source = last.source.as_deref().unwrap_or("unknown");
    let [x, y] = last.cell;
    let mut lines = vec![Line::from(format!("{} in cell {x}, {y}, by {source}", last.action))];
    for (index, action) in Action::ALL.into_iter().enumerate() {
        let share = last.probabilities.map(|shares| shares[index]);
        let words = match (last.allowed[index], share) {
            (false, _) => format!("{:<6} masked by the guard", action.name()),
            (true, None) => action.name().into(),
            (true, Some(share)) => format!("{:<6} {:5.1} % {}", action.name(), 100.0 * share, bar(share)),
        };
        let chosen = action.name() == last.action;
        lines.push(if chosen { Line::from(words).bold() } else { Line::from(words) });
    }
    lines
}

fn bar(share: f32) -> String {
    "█".repeat((BAR * share.clamp(0.0, 1.0)).round() as usize)
}

fn device_table<'f>(flight: &'f Flight, live: Option<&'f Live>) -> Table<'f> {
    let states = live.map_or(&[][..], |live| &live.devices);
    let rows = flight.scene.devices.iter().zip(states).map(|(device, state)| {
        Row::new([
            device.id.to_string(),
            format!("{:.0} of {:.0}", state.remaining, device.data),
            state.snr_db.map_or("not heard".into(), |snr_db| format!("{snr_db:.1} dB")),
            if state.reachable { "reachable" } else { "" }.into(),
        ])
    });
    let widths = [Constraint::Length(6), Constraint::Length(16), Constraint::Length(10), Constraint::Min(9)];
    Table::new(rows, widths).block(titled("Devices: data left, SNR"))
}

fn forecast_lines(flight: &Flight) -> Vec<Line<'static>> {
    let Some(what_if) = flight.what_if.last() else { return vec!["No forecast yet".into()] };
    let options = what_if.options.iter();
    options
        .map(|option| {
            let (w, percent, energy) = (option.w, 100.0 * option.collected, option.energy);
            format!("w {w:.2}  brings home {percent:3.0} % for {energy:4.1} more units").into()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::page;
    use crate::{FlightScript, MissionPlan, MissionSetup, fly};
    use gleaner_policy::{Attention, Inference, Policy, Tokens};
    use gleaner_world::{ScenarioKind, World};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use std::convert::Infallible;
    use std::sync::Arc;

    /// Prefers east, then north.
    struct Eastward;

    impl Policy for Eastward {
        type Error = Infallible;

        fn infer(&mut self, _: &Tokens) -> Result<Inference, Infallible> {
            Ok(Inference { logits: [0.0, 1.0, 0.0, 0.0, 2.0], attention: Attention::NONE })
        }
    }

    #[test]
    fn the_terminal_shows_the_essentials_of_a_flight() {
        let plan = MissionPlan::new(ScenarioKind::ReachDestination, 1);
        let setup = MissionSetup::new(Arc::new(World::default_world()), plan).unwrap();
        let mut recording = page::recording(&setup, "a test".into(), Eastward);
        let flown = fly(setup, FlightScript::plain(0.5), Eastward, Ok(())).unwrap();
        page::replay(&mut recording, &flown.simulation);
        let mut terminal = Terminal::new(TestBackend::new(120, 45)).unwrap();
        terminal.draw(|frame| draw(frame, recording.flight(), " keys ")).unwrap();
        let shown: String = terminal.backend().buffer().content.iter().map(|cell| cell.symbol()).collect();
        for words in [
            "a test",
            "The mission is over",
            "mode land",
            "collected",
            "by the network",
            "masked",
            "brings home",
            "landed,",
            " keys ",
            "T",
        ] {
            assert!(shown.contains(words), "{words:?} is missing: {shown}");
        }
    }
}
