//! The page of one pilot: what the pilot knows becomes events, orders become commands to it.

use crate::flight::{Decision, Device, DeviceState, Event, Grid, Live, Scene, Text, WhatIf};
use crate::ground::GroundClient;
use crate::order::Order;
use crate::server::Server;
use crate::words::{mode, owner, reason};
use gleaner_link::{Address, Frame, FrameDecoder, Message};
use gleaner_pilot::{Deliberator, Mission, Onboard, Source, Vehicle};
use gleaner_policy::FIRST_DEVICE_TOKEN;
use gleaner_policy::schema::REACHABLE_SNR_DB;
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, GridFrame, Instant};
use mavlink::dialects::ardupilotmega::NAMED_VALUE_FLOAT_DATA;
use mavlink::{MavlinkVersion, MessageData as _};
use std::time;

/// Five updates a second: smooth enough for a map, and a small share of a core.
const LIVE_INTERVAL: time::Duration = time::Duration::from_millis(200);

/// A server with a ground station behind it, for a program that owns an [`Onboard`].
pub struct Dashboard {
    server: Server,
    client: GroundClient,
    /// What the pilot sends, for acknowledgements, texts and telemetry.
    tap: FrameDecoder,
    telemetry: Telemetry,
    next_live: time::Instant,
    now_s: f64,
    waiting: Option<Order>,
}

/// The newest telemetry that the pilot does not offer otherwise.
#[derive(Clone, Copy, Debug, Default)]
struct Telemetry {
    spare_units: Option<f32>,
    land_pct: Option<f32>,
}

impl Dashboard {
    /// The page of the pilot at `pilot`, whose commands come from the ground station `own`.
    #[must_use]
    pub fn new(server: Server, own: Address, pilot: Address, now: time::Instant) -> Dashboard {
        Dashboard {
            server,
            client: GroundClient::new(own, pilot, now),
            tap: FrameDecoder::new(),
            telemetry: Telemetry::default(),
            next_live: now,
            now_s: 0.0,
            waiting: None,
        }
    }

    /// The server, for its address and its counters.
    #[must_use]
    pub const fn server(&self) -> &Server {
        &self.server
    }

    /// Publishes what is due, and takes orders. Returns frames of the page's ground station for the pilot: hand them to
    /// [`Onboard::receive_link`].
    pub fn poll<P: Deliberator>(
        &mut self,
        wall: time::Instant,
        now: Instant,
        onboard: &Onboard<P>,
    ) -> Vec<Vec<u8>> {
        self.now_s = now.as_micros() as f64 * 1e-6;
        if wall >= self.next_live {
            self.next_live = wall + LIVE_INTERVAL;
            let live = live(self.now_s, now, onboard, self.telemetry);
            self.server.publish(Event::Live(live));
        }
        if !self.client.is_busy()
            && self.waiting.is_none()
            && let Some(order) = self.server.order()
        {
            self.waiting = self.client.take(wall, order);
        }
        self.client.poll(wall)
    }

    /// An order that is no command to the pilot: an incident, for a simulation.
    pub fn incident(&mut self) -> Option<Order> {
        self.waiting.take()
    }

    /// The bytes that the pilot sends.
    pub fn sent(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let taken = self.tap.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while let Some(frame) = self.tap.next_frame() {
                self.read(&frame);
            }
        }
    }

    /// A decision was made.
    pub fn decided(&mut self, decision: &gleaner_pilot::Decision) {
        self.server.publish(Event::Decision(shown(decision)));
    }

    /// New predictions.
    pub fn predicted(&mut self, what_if: WhatIf) {
        self.server.publish(Event::WhatIf(what_if));
    }

    fn read(&mut self, frame: &Frame) {
        self.client.receive(frame);
        if let Ok(Some(Message::StatusText { severity, text, .. })) = Message::decode(frame) {
            let text = String::from_utf8_lossy(&text).into_owned();
            self.server.publish(Event::Text(Text { t_s: self.now_s, severity, text }));
        } else if frame.message_id == NAMED_VALUE_FLOAT_DATA::ID
            && let Ok(value) = NAMED_VALUE_FLOAT_DATA::deser(MavlinkVersion::V2, frame.payload())
        {
            match value.name.to_str() {
                Ok("spare_bat") => self.telemetry.spare_units = Some(value.value),
                Ok("land_pct") => self.telemetry.land_pct = Some(value.value),
                _ => {}
            }
        }
    }
}

/// The scene of a mission.
#[must_use]
pub fn scene(mission: &Mission, title: String, incidents: Vec<String>) -> Scene {
    let grid = mission.grid();
    let cells = || {
        let width = grid.width() as i16;
        (0..grid.height() as i16).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
    };
    let fence: Vec<bool> = cells().map(|cell| mission.fence.contains(cell)).collect();
    Scene {
        title,
        grid: Grid { width: grid.width(), height: grid.height(), cell_m: grid.cell().0, rotation_deg: 0.0 },
        heights_m: cells().map(|cell| mission.heights.height_m(cell).unwrap_or(0)).collect(),
        fence: fence.contains(&false).then_some(fence),
        terminal: [mission.terminal.x, mission.terminal.y],
        devices: mission
            .devices
            .iter()
            .map(|site| Device { id: site.id, x: site.cell.x, y: site.cell.y, data: site.data })
            .collect(),
        battery_units: mission.budget.0,
        controls: true,
        incidents,
    }
}

fn live<P: Deliberator>(t_s: f64, now: Instant, onboard: &Onboard<P>, telemetry: Telemetry) -> Live {
    let machine = onboard.machine();
    let mission = machine.mission();
    let vehicle = Vehicle::observe(now, onboard.link().autopilot());
    let stats = onboard.stats();
    let state = onboard.state();
    let place = vehicle.position.zip(vehicle.origin).map(|(position, origin)| {
        let point = GridFrame::new(mission.grid(), mission.pose, origin).point(&position);
        (point.east_m / mission.grid().cell().0, point.north_m / mission.grid().cell().0)
    });
    let height_m = vehicle.position.zip(vehicle.home_down_m).map(|(at, home_down_m)| home_down_m - at.down_m);
    let BatteryUnits(spent) = stats.spent;
    Live {
        t_s,
        state: state.name().into(),
        owner: owner(state, vehicle.armed).into(),
        reason: reason(machine),
        mode: mode(&vehicle).into(),
        x: place.map(|(east, _)| east),
        y: place.map(|(_, north)| north),
        height_m,
        battery_units: Some((mission.budget.0 - spent).max(0.0)),
        spare_units: telemetry.spare_units,
        battery_pct: vehicle.battery_percent.map(f32::from),
        land_pct: telemetry.land_pct,
        w_data: onboard.parameters().data_weight(),
        collected: stats.collected,
        devices: onboard
            .device_states(now)
            .iter()
            .map(|device| DeviceState {
                remaining: device.remaining,
                snr_db: device.snr.map(|snr| snr.0),
                reachable: device.snr.is_some_and(|snr| snr.0 >= REACHABLE_SNR_DB),
            })
            .collect(),
    }
}

/// A decision as the page shows it.
#[must_use]
pub fn shown(decision: &gleaner_pilot::Decision) -> Decision {
    let inference = decision.inference.as_ref();
    let tokens = FIRST_DEVICE_TOKEN + decision.slots.len();
    Decision {
        t_s: decision.time.as_micros() as f64 * 1e-6,
        sequence: decision.sequence,
        cell: [decision.cell.x, decision.cell.y],
        action: decision.action.name().into(),
        allowed: Action::ALL.map(|action| decision.mask.allows(action)),
        probabilities: inference.map(|inference| probabilities(&inference.logits, decision.mask)),
        attention: inference.map(|inference| {
            let rows = inference.attention.0.iter().take(tokens);
            rows.map(|row| row.iter().take(tokens).copied().collect()).collect()
        }),
        slots: decision.slots.to_vec(),
        source: Some(source(decision).into()),
    }
}

/// What chose the action.
fn source(decision: &gleaner_pilot::Decision) -> &'static str {
    if decision.inference.is_none() {
        return "the guard";
    }
    match decision.lookahead.map_or(Source::Network, |record| record.source) {
        Source::Network => "the network",
        Source::KeptPlan => "the kept plan",
        Source::DeviceOrder => "a new order of devices",
        Source::SingleMove => "a single move, then the plan",
    }
}

/// The softmax over the allowed actions; zero for the others.
fn probabilities(logits: &[f32; Action::COUNT], mask: ActionMask) -> [f32; Action::COUNT] {
    let highest = mask.iter().map(|action| logits[action.index()]).fold(f32::NEG_INFINITY, f32::max);
    let weight = |action: Action| {
        if mask.allows(action) { (logits[action.index()] - highest).exp() } else { 0.0 }
    };
    let sum: f32 = Action::ALL.into_iter().map(weight).sum();
    Action::ALL.map(|action| if sum > 0.0 { weight(action) / sum } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masked_actions_have_no_probability() {
        let mask = ActionMask::EMPTY.with(Action::Hover).with(Action::East);
        assert_eq!(probabilities(&[0.0, 9.0, 9.0, 9.0, 0.0], mask), [0.5, 0.0, 0.0, 0.0, 0.5]);
        assert_eq!(probabilities(&[0.0; 5], ActionMask::EMPTY), [0.0; 5]);
    }
}
