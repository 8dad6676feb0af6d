//! `trajectory.svg`: the city from above, the collected data, and the aircraft's path coloured by time.

mod symbols;

use crate::flight::Figures;
use crate::simulation::Simulation;
use gleaner_units::{Action, Cell, Instant};
use std::collections::BTreeMap;
use svg::Document;
use svg::node::element::{Circle, Group, Line, Polyline, Rectangle, Title};
use symbols::{
    INK, QUIET, building_colour, clock, device_symbol, diamond, disc_symbol, haloed, label, time_colour,
    time_gradient, zone,
};

const CELL_PX: f32 = 22.0;
const LEFT_PX: f32 = 28.0;
const TOP_PX: f32 = 84.0;
const LEGEND_PX: f32 = 216.0;
const BOTTOM_PX: f32 = 34.0;
const FONT: &str = "Inter, 'Helvetica Neue', Arial, sans-serif";
/// Segments of the path, one colour each.
const SEGMENTS: usize = 96;

/// The drawing of one flight. `model` is the name under which the policy is shown.
#[must_use]
pub fn trajectory(simulation: &Simulation, figures: &Figures, model: &str) -> String {
    Drawing::new(simulation).document(figures, model).to_string()
}

struct Drawing<'s> {
    simulation: &'s Simulation,
    width_px: f32,
    height_px: f32,
    from: Instant,
    to: Instant,
}

impl Drawing<'_> {
    fn new(simulation: &Simulation) -> Drawing<'_> {
        let grid = simulation.setup().mission.grid();
        let journal = simulation.journal();
        Drawing {
            simulation,
            width_px: f32::from(grid.width()) * CELL_PX,
            height_px: f32::from(grid.height()) * CELL_PX,
            from: journal.slots().first().map_or(Instant::ZERO, |slot| slot.at),
            to: journal.track().last().map_or(Instant::ZERO, |point| point.at),
        }
    }

    fn document(&self, figures: &Figures, model: &str) -> Document {
        let width = LEFT_PX + self.width_px + LEGEND_PX;
        let height = TOP_PX + self.height_px + BOTTOM_PX;
        Document::new()
            .set("viewBox", (0, 0, width, height))
            .set("width", width)
            .set("height", height)
            .set("font-family", FONT)
            .add(Title::new(headline(figures)))
            .add(time_gradient())
            .add(Rectangle::new().set("width", "100%").set("height", "100%").set("fill", "#ffffff"))
            .add(self.heading(figures, model))
            .add(self.city())
            .add(self.path())
            .add(self.hovers())
            .add(self.zones())
            .add(self.devices())
            .add(self.switches())
            .add(self.scale())
            .add(self.legend(figures))
    }

    fn heading(&self, figures: &Figures, model: &str) -> Group {
        Group::new()
            .add(label(LEFT_PX, 36.0, 22.0, INK, &headline(figures)).set("font-weight", 700))
            .add(label(LEFT_PX, 62.0, 14.0, QUIET, &summary(figures, model)))
    }

    /// South-west corner of a cell on the page is its lower left corner.
    fn x(&self, east_cells: f32) -> f32 {
        LEFT_PX + east_cells * CELL_PX
    }

    fn y(&self, north_cells: f32) -> f32 {
        TOP_PX + self.height_px - north_cells * CELL_PX
    }

    fn centre(&self, cell: Cell) -> (f32, f32) {
        (self.x(f32::from(cell.x) + 0.5), self.y(f32::from(cell.y) + 0.5))
    }

    fn city(&self) -> Group {
        let heights = &self.simulation.setup().mission.heights;
        let mut group = Group::new().add(
            Rectangle::new()
                .set("x", LEFT_PX)
                .set("y", TOP_PX)
                .set("width", self.width_px)
                .set("height", self.height_px)
                .set("fill", "#f6f4ef")
                .set("stroke", "#c9c5bb"),
        );
        for cell in heights.grid().cells() {
            let height_m = heights.height_m(cell).unwrap_or(0);
            if height_m == 0 {
                continue;
            }
            // A gap between roofs separates streets from lots.
            let building = Rectangle::new()
                .set("x", self.x(f32::from(cell.x)) + 0.4)
                .set("y", self.y(f32::from(cell.y) + 1.0) + 0.4)
                .set("width", CELL_PX - 0.8)
                .set("height", CELL_PX - 0.8)
                .set("fill", building_colour(height_m));
            group = group.add(building);
        }
        group
    }

    fn path(&self) -> Group {
        let points: Vec<(f32, f32, f32)> = self
            .simulation
            .journal()
            .track()
            .iter()
            .filter(|point| point.at >= self.from)
            .map(|point| {
                let (east_m, north_m) = self.simulation.on_grid(&point.position);
                let cell_m = self.simulation.setup().mission.grid().cell().0;
                (self.time_share(point.at), self.x(east_m / cell_m), self.y(north_m / cell_m))
            })
            .collect();
        let line = |points: &[(f32, f32, f32)], colour: &str, width: f32| {
            let pairs: Vec<String> = points.iter().map(|(_, x, y)| format!("{x:.1},{y:.1}")).collect();
            Polyline::new()
                .set("points", pairs.join(" "))
                .set("fill", "none")
                .set("stroke", colour)
                .set("stroke-width", width)
                .set("stroke-linecap", "round")
                .set("stroke-linejoin", "round")
        };
        let mut group = Group::new().add(line(&points, "#ffffff", 6.5));
        let step = points.len().div_ceil(SEGMENTS).max(1);
        for start in (0..points.len().saturating_sub(1)).step_by(step) {
            let piece = &points[start..(start + step + 1).min(points.len())];
            group = group.add(line(piece, &time_colour(piece[0].0), 3.4));
        }
        group
    }

    fn time_share(&self, at: Instant) -> f32 {
        let whole = (self.to - self.from).as_secs_f32().max(1e-3);
        ((at - self.from).as_secs_f32() / whole).clamp(0.0, 1.0)
    }

    /// A disc where the aircraft hovered, larger than the symbol of a device; the area beyond it is the number of slots.
    fn hovers(&self) -> Group {
        let mut slots: BTreeMap<(i16, i16), (u32, Instant)> = BTreeMap::new();
        for slot in self.simulation.journal().slots() {
            if slot.flown && slot.record.action == Action::Hover {
                let cell = slot.record.cell;
                slots.entry((cell.x, cell.y)).or_insert((0, slot.at)).0 += 1;
            }
        }
        let mut group = Group::new();
        for ((x, y), (count, at)) in slots {
            let (cx, cy) = self.centre(Cell::new(x, y));
            let disc = Circle::new()
                .set("cx", cx)
                .set("cy", cy)
                .set("r", (170.0 + 30.0 * count as f32).sqrt())
                .set("fill", time_colour(self.time_share(at)))
                .set("fill-opacity", 0.55)
                .set("stroke", "#ffffff")
                .set("stroke-width", 1.2)
                .add(Title::new(format!("hovered for {count} slots over ({x}, {y})")));
            group = group.add(disc);
        }
        group
    }

    fn devices(&self) -> Group {
        let mut group = Group::new();
        for (index, device) in self.simulation.field().devices().iter().enumerate() {
            let collected = 1.0 - device.remaining_units / device.initial_units;
            let (cx, cy) = self.centre(device.cell);
            group = group.add(device_symbol(cx, cy, &format!("{}", index + 1), collected)).add(haloed(
                &label(cx, cy + 25.0, 11.5, INK, &format!("{:.0} %", 100.0 * collected))
                    .set("text-anchor", "middle")
                    .set("font-weight", 600),
            ));
        }
        group
    }

    fn zones(&self) -> Group {
        let realization = &self.simulation.setup().realization;
        let (start, terminal) = (realization.start(), realization.terminal());
        let mut group = Group::new();
        if start != terminal {
            let (x, y) = self.centre(start);
            group = group.add(zone(x, y, "#0f9d58", "S"));
        }
        let (x, y) = self.centre(terminal);
        group.add(zone(x, y, "#c62828", if start == terminal { "B" } else { "T" }))
    }

    /// Where the first decision under a new preference was made, and its label.
    fn changes(&self) -> Vec<(Cell, String)> {
        let slots = self.simulation.journal().slots();
        let changed = slots.windows(2).filter(|pair| pair[0].record.w_data != pair[1].record.w_data);
        let labels = changed.map(|pair| {
            let (before, after) = (pair[0].record.w_data, pair[1].record.w_data);
            let seconds = (pair[1].at - self.from).as_secs_f32();
            (pair[1].record.cell, format!("w {before:.2} \u{2192} {after:.2} at {seconds:.0} s"))
        });
        labels.collect()
    }

    fn switches(&self) -> Group {
        let numbered = self.changes().into_iter().enumerate();
        numbered.fold(Group::new(), |group, (index, (cell, _))| {
            let (cx, cy) = self.centre(cell);
            group.add(diamond(cx, cy, &(index + 1).to_string()))
        })
    }

    fn scale(&self) -> Group {
        let cells = 100.0 / self.simulation.setup().mission.grid().cell().0;
        let (x, y) = (LEFT_PX, TOP_PX + self.height_px + 16.0);
        let bar = Line::new()
            .set("x1", x)
            .set("x2", x + cells * CELL_PX)
            .set("y1", y)
            .set("y2", y)
            .set("stroke", INK)
            .set("stroke-width", 2.5);
        Group::new().add(bar).add(label(x + cells * CELL_PX + 8.0, y + 4.0, 12.0, QUIET, "100 m")).add(label(
            x + cells * CELL_PX + 64.0,
            y + 4.0,
            12.0,
            QUIET,
            "north is up",
        ))
    }

    fn legend(&self, figures: &Figures) -> Group {
        let x = LEFT_PX + self.width_px + 24.0;
        let row = |index: u16| TOP_PX + 130.0 + 34.0 * f32::from(index);
        let text = |index: u16, words: &str| label(x + 32.0, row(index) + 4.5, 13.0, INK, words);
        let seconds = (self.to - self.from).as_secs_f32();
        let mut group = Group::new()
            .add(label(x, TOP_PX + 14.0, 13.0, INK, "Time since engaged").set("font-weight", 600))
            .add(
                Rectangle::new()
                    .set("x", x)
                    .set("y", TOP_PX + 26.0)
                    .set("width", 168)
                    .set("height", 12)
                    .set("rx", 6)
                    .set("fill", "url(#time)"),
            )
            .add(label(x, TOP_PX + 56.0, 12.0, QUIET, "0 s"))
            .add(label(x + 168.0, TOP_PX + 56.0, 12.0, QUIET, &clock(seconds)).set("text-anchor", "end"))
            .add(label(x, TOP_PX + 98.0, 13.0, INK, "Map").set("font-weight", 600));
        let same =
            self.simulation.setup().realization.start() == self.simulation.setup().realization.terminal();
        let zones: &[(&str, &str, &str)] = match same {
            true => &[("#c62828", "B", "base: start and end")],
            false => &[("#0f9d58", "S", "start"), ("#c62828", "T", "terminal: lands here")],
        };
        let mut index = 0;
        for (colour, letter, words) in zones {
            group = group.add(zone(x + 11.0, row(index), colour, letter)).add(text(index, words));
            index += 1;
        }
        group = group
            .add(device_symbol(x + 11.0, row(index), "3", 0.7))
            .add(text(index, "device, ring: collected"))
            .add(disc_symbol(x + 11.0, row(index + 1)))
            .add(text(index + 1, "hover, larger: longer"))
            .add(diamond(x + 11.0, row(index + 2), "1"))
            .add(text(index + 2, "preference switched"));
        for (step, height_m) in [5_u8, 20, 35, 50].into_iter().enumerate() {
            let left = x + 42.0 * step as f32;
            group = group
                .add(
                    Rectangle::new()
                        .set("x", left)
                        .set("y", row(index + 3) - 4.0)
                        .set("width", 42)
                        .set("height", 14)
                        .set("fill", building_colour(height_m)),
                )
                .add(
                    label(left + 21.0, row(index + 3) + 26.0, 12.0, QUIET, &format!("{height_m} m"))
                        .set("text-anchor", "middle"),
                );
        }
        self.legend_figures(group, x, row(index + 5), figures)
    }

    fn legend_figures(&self, mut group: Group, x: f32, y: f32, figures: &Figures) -> Group {
        let budget = self.simulation.setup().realization.battery();
        let rows = [
            ("Data collected", format!("{:.1} %", 100.0 * figures.collected)),
            ("Battery units", format!("{} of {}", figures.energy.0, budget.0)),
            ("Decisions", figures.decisions.to_string()),
            ("Violations", figures.violations.len().to_string()),
        ];
        let line = |index: usize| y + 24.0 * index as f32;
        for (index, (name, value)) in rows.iter().enumerate() {
            group = group.add(label(x, line(index), 13.0, QUIET, name)).add(
                label(x + 168.0, line(index), 13.0, INK, value)
                    .set("text-anchor", "end")
                    .set("font-weight", 700),
            );
        }
        // As many as fit; the log has all.
        for (index, (_, words)) in self.changes().into_iter().take(6).enumerate() {
            let y = line(rows.len() + index) + 14.0;
            let number = (index + 1).to_string();
            group = group.add(diamond(x + 11.0, y - 4.5, &number)).add(label(x + 32.0, y, 12.5, INK, &words));
        }
        group
    }
}

fn headline(figures: &Figures) -> String {
    let scenario = figures.scenario.name().to_uppercase();
    let devices = figures.devices;
    format!("Gleaner: {scenario}, seed {}, {devices} devices, w = {:.2}", figures.seed, figures.preference)
}

fn summary(figures: &Figures, model: &str) -> String {
    let landed = if figures.landed { "landed on the terminal" } else { "did not land on the terminal" };
    format!(
        "{:.1} % of the data for {} battery units in {} decisions; {landed}; policy {model}",
        100.0 * figures.collected,
        figures.energy.0,
        figures.decisions,
    )
}
