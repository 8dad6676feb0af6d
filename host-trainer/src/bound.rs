//! A sound upper bound on what any policy can gain in a mission, even one that knows map, channel and devices, and
//! sees every slot's shadowing before it decides.
//!
//! Let d(t, k) be the data that device k sends in slot t, D_k what it holds at the start, and S any set of cells. On
//! every path
//!
//! ```text
//! sum over t             of d(t, k)  <=  D_k                                 price lambda(k)
//! sum over t at poses in S of d(t, k)  <=  D_k x (times that S is entered)     price mu(k, S)
//! ```
//!
//! The second says that a device is not emptied from where one has never been: without it, a mixture of missions that
//! each hover over one device for ever would pass for a good one. With prices in the place of these constraints
//! (Lagrangian relaxation, Geoffrion 1974) what is left is a longest-path problem over battery and cell, solved exactly
//! by dynamic programming: a slot at a pose brings at most E [max over k of (1 - lambda(k) - sum of mu(k, S) over S
//! that hold the pose) R_k], with R_k the data that the slot carries at the SNR drawn, and entering S brings
//! mu(k, S) D_k. The pose is chosen before the draw, and draws are independent, so the expectation bounds every
//! closed-loop policy. All prices give a bound. A low one is looked for by gradient descent on a softened
//! maximum (a path is then drawn by chance, the better the likelier), whose temperature falls; the bound itself is
//! taken with the hard maximum.

use crate::net::Adam;
use gleaner_units::{Action, Cell, Db, Grid};
use gleaner_world::{Placement, Realization, World};

/// Points and range of the quadrature over the shadowing, standard deviations.
const POINTS: usize = 61;
const RANGE: f32 = 4.0;
/// Links whose mean lies so far below the threshold carry nothing (more than 5 deviations).
const SILENT_DB: f32 = 12.0;
/// The sets S of a device: the cells within so many moves of it, and all.
const RADII: [u32; 4] = [2, 4, 7, 11];
const SETS: usize = RADII.len() + 1;
/// Where the prices begin.
const LAMBDA: f32 = 0.8;
const MU: f32 = 0.05;
/// Step size of the prices, and temperature of the softened maximum (percent), at the beginning and at the end.
const STEP: [f32; 2] = [0.03, 0.001];
const TEMPERATURE: [f32; 2] = [0.3, 0.01];
/// A value that no mission has: there is no way home.
const NEVER: f32 = f32::NEG_INFINITY;

/// One audible link: which device, its mean rate, and its rate at every point of the quadrature.
struct Link {
    device: usize,
    mean: f32,
    rates: [f32; POINTS],
}

/// What the constraints of one device are priced at, per data unit as a share of its worth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Prices {
    lambda: f32,
    /// The innermost set first.
    mu: [f32; SETS],
}

/// A mission, prepared for bounding.
pub struct Bounder {
    grid: Grid,
    start: Cell,
    terminal: Cell,
    hovers: usize,
    data: Vec<f32>,
    /// By cell.
    links: Vec<Vec<Link>>,
    /// By cell and device: in how many of the sets, which are nested, the innermost first.
    depths: Vec<Vec<usize>>,
    weights: [f32; POINTS],
    values: Vec<f32>,
    /// How often a path drawn by chance is in each state, and what it does there: hover, then the moves.
    habits: Vec<[f32; Action::COUNT]>,
    presence: Vec<f32>,
}

impl Bounder {
    /// Prepares a mission on an open map.
    #[must_use]
    pub fn new(world: &World, realization: &Realization) -> Bounder {
        let grid = world.city().grid();
        let (weights, points) = quadrature();
        let link = |device: usize, placed: &Placement, uav: Cell| {
            let mean_snr = world.mean_snr(placed.cell, uav)?;
            let channel = world.channel();
            if mean_snr.0 < channel.threshold.0 - SILENT_DB {
                return None;
            }
            let sight = world.city().line_of_sight(placed.cell, uav);
            let deviation_db = libm::sqrtf(channel.path_loss(sight).shadowing_variance_db2);
            let rates = points.map(|z| channel.data_per_slot(mean_snr + Db(deviation_db * z)));
            let mean = rates.iter().zip(&weights).map(|(rate, weight)| rate * weight).sum();
            Some(Link { device, mean, rates })
        };
        let devices = realization.devices();
        let links: Vec<Vec<Link>> = grid
            .cells()
            .map(|uav| devices.iter().enumerate().filter_map(|(k, placed)| link(k, placed, uav)).collect())
            .collect();
        let depth = |links: &[Link], uav: Cell, device: usize| {
            let moves = uav.manhattan(devices[device].cell);
            let hears = links.iter().any(|link| link.device == device);
            RADII.iter().filter(|&&radius| moves <= radius).count()
                + usize::from(hears || moves <= RADII[SETS - 2])
        };
        let depths = grid
            .cells()
            .zip(&links)
            .map(|(uav, links)| (0..devices.len()).map(|device| depth(links, uav, device)).collect())
            .collect();
        let hovers = (2.0 * realization.battery().0).floor() as usize;
        Bounder {
            start: realization.start(),
            terminal: realization.terminal(),
            hovers,
            data: devices.iter().map(|device| device.data_units).collect(),
            links,
            depths,
            weights,
            values: vec![NEVER; (hovers + 1) * grid.len()],
            habits: vec![[0.0; Action::COUNT]; (hovers + 1) * grid.len()],
            presence: vec![0.0; (hovers + 1) * grid.len()],
            grid,
        }
    }

    /// The lowest bound on `w . (percent, -battery units)` that is found in so many steps. `w_data` lies in 0..=1.
    pub fn bound(&mut self, w_data: f32, steps: usize) -> f32 {
        let scale = 100.0 * w_data / self.data.iter().sum::<f32>().max(1.0);
        let w_energy = 1.0 - w_data;
        let mut prices = vec![Prices { lambda: LAMBDA, mu: [MU; SETS] }; self.data.len()];
        let mut flat = vec![0.0; prices.len() * (SETS + 1)];
        let mut adam = Adam::new(flat.len(), 0.0);
        for step in 0..steps {
            let progress = step as f32 / steps as f32;
            let between = |[from, to]: [f32; 2]| from * libm::powf(to / from, progress);
            // The mean of the best link guides the steps. Certified below.
            self.solve(scale, w_energy, &prices, Some(between(TEMPERATURE)), greatest_mean);
            let slopes = self.slopes(scale, &prices);
            flatten(&prices, &mut flat);
            let mut gradient = vec![0.0; flat.len()];
            flatten(&slopes, &mut gradient);
            adam.lr = between(STEP);
            adam.step(&mut flat, &gradient);
            for (prices, flat) in prices.iter_mut().zip(flat.chunks(SETS + 1)) {
                prices.lambda = flat[0].max(0.0);
                for (mu, flat) in prices.mu.iter_mut().zip(&flat[1..]) {
                    *mu = flat.max(0.0);
                }
            }
        }
        let weights = self.weights;
        self.solve(scale, w_energy, &prices, None, |links, shares| expected_greatest(links, shares, &weights))
    }

    /// What is left of a data unit's worth at a cell, by device.
    fn shares(&self, place: usize, prices: &[Prices], shares: &mut [f32]) {
        for ((share, prices), &depth) in shares.iter_mut().zip(prices).zip(&self.depths[place]) {
            *share = (1.0 - prices.lambda - prices.mu[SETS - depth..].iter().sum::<f32>()).max(0.0);
        }
    }

    /// The value of the best path under these prices and of what the constraints leave, by dynamic programming.
    fn solve(
        &mut self,
        scale: f32,
        w_energy: f32,
        prices: &[Prices],
        temperature: Option<f32>,
        gain: impl Fn(&[Link], &[f32]) -> f32,
    ) -> f32 {
        let cells = self.grid.len();
        let mut shares = vec![0.0; self.data.len()];
        let mut gains = vec![0.0; cells];
        let mut moves = vec![[NEVER; Action::MOVES.len()]; cells];
        for (place, cell) in self.grid.cells().enumerate() {
            if !self.links[place].is_empty() {
                self.shares(place, prices, &mut shares);
                gains[place] = scale * gain(&self.links[place], &shares);
            }
            for (worth, action) in moves[place].iter_mut().zip(Action::MOVES) {
                if let Some(to) = self.grid.index(cell.after(action)) {
                    *worth = scale * self.entering(place, to, prices) - w_energy;
                }
            }
        }
        self.sweep(&gains, &moves, w_energy, temperature);
        let Some(start) = self.grid.index(self.start) else { return NEVER };
        let left: f32 = self
            .data
            .iter()
            .zip(prices)
            .zip(&self.depths[start])
            .map(|((data, prices), &depth)| {
                data * (prices.lambda + prices.mu[SETS - depth..].iter().sum::<f32>())
            })
            .sum();
        scale * left + self.values[self.hovers * cells + start]
    }

    /// What a move brings by entering sets, data units.
    fn entering(&self, from: usize, to: usize, prices: &[Prices]) -> f32 {
        let mut worth = 0.0;
        for (device, prices) in prices.iter().enumerate() {
            let (outside, inside) = (self.depths[from][device], self.depths[to][device]);
            if inside > outside {
                worth += self.data[device] * prices.mu[SETS - inside..SETS - outside].iter().sum::<f32>();
            }
        }
        worth
    }

    /// Fills the values: with so many hovers left at a cell, the best that can still be gained; softened, if there is
    /// a temperature, with what a path drawn by chance does.
    fn sweep(&mut self, gains: &[f32], moves: &[[f32; 4]], w_energy: f32, temperature: Option<f32>) {
        let cells = self.grid.len();
        let terminal = self.grid.index(self.terminal).unwrap_or(usize::MAX);
        self.values[..cells].fill(NEVER);
        for hovers in 1..=self.hovers {
            let (before, here) = self.values.split_at_mut(hovers * cells);
            let hovered = &before[(hovers - 1) * cells..];
            let moved =
                if hovers >= 2 { &before[(hovers - 2) * cells..(hovers - 1) * cells] } else { &[][..] };
            let habits = &mut self.habits[hovers * cells..(hovers + 1) * cells];
            for place in 0..cells {
                let mut onward = [NEVER; Action::COUNT];
                onward[0] = hovered[place] - 0.5 * w_energy;
                if hovers >= 2 {
                    for (index, to) in neighbours(self.grid, place).into_iter().enumerate() {
                        let worth = moves[place][index];
                        if worth != NEVER {
                            // The mission is over there: nothing is gained by entering.
                            onward[index + 1] = if to == terminal { -w_energy } else { moved[to] + worth };
                        }
                    }
                }
                let best = onward.iter().copied().fold(NEVER, f32::max);
                here[place] = gains[place] + best;
                if let Some(temperature) = temperature.filter(|_| best != NEVER) {
                    let likely = onward.map(|onward| libm::expf((onward - best) / temperature));
                    let sum: f32 = likely.iter().sum();
                    here[place] += temperature * libm::logf(sum);
                    habits[place] = likely.map(|likely| likely / sum);
                }
            }
        }
    }

    /// How the softened bound changes with each price: what the constraints leave on a path drawn by chance.
    fn slopes(&mut self, scale: f32, prices: &[Prices]) -> Vec<Prices> {
        let (visits, flows) = self.traffic();
        let mut slopes: Vec<Prices> =
            self.data.iter().map(|&data| Prices { lambda: scale * data, mu: [0.0; SETS] }).collect();
        let enter = |slopes: &mut [Prices], from: Option<usize>, to: usize, share: f32| {
            for (device, slopes) in slopes.iter_mut().enumerate() {
                let outside = from.map_or(0, |from| self.depths[from][device]);
                let inside = self.depths[to][device];
                for mu in &mut slopes.mu[SETS - inside..SETS - outside.min(inside)] {
                    *mu += scale * share * self.data[device];
                }
            }
        };
        if let Some(start) = self.grid.index(self.start) {
            enter(&mut slopes, None, start, 1.0);
        }
        let mut shares = vec![0.0; self.data.len()];
        for (place, (&visits, flows)) in visits.iter().zip(&flows).enumerate() {
            for (to, &flow) in neighbours(self.grid, place).into_iter().zip(flows) {
                if flow > 0.0 {
                    enter(&mut slopes, Some(place), to, flow);
                }
            }
            if visits == 0.0 || self.links[place].is_empty() {
                continue;
            }
            self.shares(place, prices, &mut shares);
            let worth = |link: &&Link| shares[link.device] * link.mean;
            let served = self.links[place].iter().max_by(|a, b| worth(a).total_cmp(&worth(b)));
            if let Some(link) = served.filter(|link| worth(link) > 0.0) {
                let sent = scale * visits * link.mean;
                slopes[link.device].lambda -= sent;
                for mu in &mut slopes[link.device].mu[SETS - self.depths[place][link.device]..] {
                    *mu -= sent;
                }
            }
        }
        slopes
    }

    /// How many slots a path drawn by chance spends at each cell, and how often it makes each move that does not end
    /// the mission.
    fn traffic(&mut self) -> (Vec<f32>, Vec<[f32; 4]>) {
        let cells = self.grid.len();
        let terminal = self.grid.index(self.terminal).unwrap_or(usize::MAX);
        let (mut visits, mut flows) = (vec![0.0; cells], vec![[0.0; 4]; cells]);
        self.presence.fill(0.0);
        if let Some(start) = self.grid.index(self.start) {
            self.presence[self.hovers * cells + start] = 1.0;
        }
        for hovers in (1..=self.hovers).rev() {
            for place in 0..cells {
                let here = self.presence[hovers * cells + place];
                if here < 1e-6 {
                    continue;
                }
                visits[place] += here;
                let habits = self.habits[hovers * cells + place];
                self.presence[(hovers - 1) * cells + place] += here * habits[0];
                for (index, to) in neighbours(self.grid, place).into_iter().enumerate() {
                    let flow = here * habits[index + 1];
                    if flow > 0.0 && to != terminal {
                        self.presence[(hovers - 2) * cells + to] += flow;
                        flows[place][index] += flow;
                    }
                }
            }
        }
        (visits, flows)
    }
}

/// The cells north, west, south and east, as far as there are.
fn neighbours(grid: Grid, place: usize) -> [usize; 4] {
    let width = usize::from(grid.width());
    [place + width, place.wrapping_sub(1), place.wrapping_sub(width), place + 1]
}

/// Weights and points of the normal distribution, standard deviations.
fn quadrature() -> ([f32; POINTS], [f32; POINTS]) {
    let points: [f32; POINTS] = std::array::from_fn(|i| RANGE * (2.0 * i as f32 / (POINTS - 1) as f32 - 1.0));
    let density = points.map(|z| libm::expf(-0.5 * z * z));
    let sum: f32 = density.iter().sum();
    (density.map(|density| density / sum), points)
}

/// An upper bound on E [max over k of share_k R_k]: with X_1 the link of the greatest mean, max <= X_1 + sum over the
/// others of max(0, X_k - X_1), and draws of different links are independent.
fn expected_greatest(links: &[Link], shares: &[f32], weights: &[f32; POINTS]) -> f32 {
    let worth = |link: &Link| shares[link.device] * link.mean;
    let Some(first) = links.iter().max_by(|a, b| worth(a).total_cmp(&worth(b))) else { return 0.0 };
    let mut greatest = worth(first);
    for link in links.iter().filter(|link| link.device != first.device && shares[link.device] > 0.0) {
        for (rate, weight) in link.rates.iter().zip(weights) {
            let excess = first.rates.iter().zip(weights).map(|(other, weight)| {
                weight * (shares[link.device] * rate - shares[first.device] * other).max(0.0)
            });
            greatest += weight * excess.sum::<f32>();
        }
    }
    greatest
}

fn greatest_mean(links: &[Link], shares: &[f32]) -> f32 {
    links.iter().map(|link| shares[link.device] * link.mean).fold(0.0, f32::max)
}

fn flatten(prices: &[Prices], flat: &mut [f32]) {
    for (prices, flat) in prices.iter().zip(flat.chunks_mut(SETS + 1)) {
        flat[0] = prices.lambda;
        flat[1..].copy_from_slice(&prices.mu);
    }
}
