//! The page of one pilot: what the pilot knows becomes events, orders become commands to it.

use crate::flight::{Decision, DeviceState, Event, Live};
use crate::forecast::{Forecaster, Forecasts, Question};
use crate::ground::GroundClient;
use crate::order::Order;
use crate::server::Server;
use crate::station::{Heard, Station};
use crate::words::{mode, owner, reason};
use gleaner_link::{Address, FrameDecoder};
use gleaner_pilot::{Deliberator, Mission, Onboard, Vehicle};
use gleaner_policy::schema::REACHABLE_SNR_DB;
use gleaner_units::{BatteryUnits, GridFrame, Instant, Metres};
use std::time;

/// Five updates a second: smooth enough for a map, and a small share of a core.
const LIVE_INTERVAL: time::Duration = time::Duration::from_millis(200);

/// A server with a ground station behind it.
///
/// A program that owns an [`Onboard`] gives it the moments of [`live`]; a program whose pilot runs elsewhere gives it
/// those of [`Dashboard::station`].
pub struct Dashboard {
    server: Server,
    client: GroundClient,
    decoder: FrameDecoder,
    station: Station,
    forecasts: Option<Forecasts>,
    next_live: time::Instant,
    t_s: f64,
    waiting: Option<Order>,
}

impl Dashboard {
    /// The ground station that the page commands as: system 255, which pilots allow by default, and
    /// `MAV_COMP_ID_USER1`, which no other ground station is.
    pub const OPERATOR: Address = Address::new(255, 25);

    /// The page of the pilot at `pilot`. `altitude` is the flight altitude, for line of sight in the forecasts.
    #[must_use]
    pub fn new(server: Server, mission: &Mission, altitude: Metres, pilot: Address) -> Dashboard {
        let now = time::Instant::now();
        // Without a thread for them there are no forecasts; everything else is shown.
        let forecasts = Forecaster::new(mission, altitude)
            .and_then(|forecaster| Forecasts::start(forecaster, server.publisher()).ok());
        Dashboard {
            server,
            forecasts,
            client: GroundClient::new(Dashboard::OPERATOR, pilot, now),
            decoder: FrameDecoder::new(),
            station: Station::new(mission, pilot),
            next_live: now,
            t_s: 0.0,
            waiting: None,
        }
    }

    /// The server, for its address and its counters.
    #[must_use]
    pub const fn server(&self) -> &Server {
        &self.server
    }

    /// The vehicle's pilot, once its address is known.
    pub fn set_pilot(&mut self, pilot: Address) {
        self.client.set_pilot(pilot);
        self.station.set_pilot(pilot);
    }

    /// What the frames on the vehicle's link show.
    #[must_use]
    pub const fn station(&self) -> &Station {
        &self.station
    }

    /// Publishes what is due, and takes orders. `t_s` is the time of the flight; `live` is called five times a second.
    /// Returns frames of the page's ground station: send them where those of other ground stations arrive.
    pub fn poll(
        &mut self,
        wall: time::Instant,
        t_s: f64,
        live: impl FnOnce(&mut Station) -> Live,
    ) -> Vec<Vec<u8>> {
        self.t_s = t_s;
        if wall >= self.next_live {
            self.next_live = wall + LIVE_INTERVAL;
            let live = live(&mut self.station);
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

    /// Bytes on the vehicle's link: of the pilot, of the autopilot, in any pieces.
    pub fn heard(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.read(&mut bytes) {
            self.client.receive(&frame);
            if let Some(Heard::Text(text)) = self.station.receive(self.t_s, &frame) {
                self.server.publish(Event::Text(text));
            }
        }
    }

    /// A decision was made. With a question its forecasts follow.
    pub fn decided(&mut self, decision: Decision, question: Option<Question>) {
        self.server.publish(Event::Decision(decision));
        if let (Some(forecasts), Some(question)) = (&self.forecasts, question) {
            forecasts.ask(question);
        }
    }
}

/// The moment as the pilot knows it. `station` has heard what the pilot sent: two values are in its telemetry only.
#[must_use]
pub fn live<P: Deliberator>(now: Instant, onboard: &Onboard<P>, station: &Station) -> Live {
    let telemetry = station.telemetry();
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
        t_s: now.as_micros() as f64 * 1e-6,
        state: state.name().into(),
        owner: owner(state, vehicle.armed).into(),
        reason: reason(machine),
        mode: mode(vehicle.mode, vehicle.firmware).into(),
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
