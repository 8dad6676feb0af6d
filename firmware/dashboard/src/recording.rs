//! A finished flight from its logs: telemetry frames and decisions, in order of time.

use crate::flight::{DeviceState, Event, Flight, Scene};
use crate::forecast::{Forecaster, Question};
use crate::shown::{explain, shown_logged};
use crate::station::{Heard, Station};
use gleaner_link::{Address, FrameDecoder};
use gleaner_pilot::{LoggedDecision, Mission};
use gleaner_policy::schema::{REACHABLE_SNR_DB, SNR_NOT_HEARD_DB};
use gleaner_policy::{DeviceState as HeardDevice, Policy};
use gleaner_units::{BatteryUnits, Db, Metres};

/// Time between two points of the track, s.
const LIVE_INTERVAL_S: f64 = 1.0;
/// Time between two forecasts, s.
const FORECAST_INTERVAL_S: f64 = 10.0;

/// Builds a [`Flight`].
pub struct Recording<P> {
    flight: Flight,
    mission: Mission,
    station: Station,
    decoder: FrameDecoder,
    policy: P,
    forecaster: Option<Forecaster>,
    reserve: BatteryUnits,
    next_live_s: f64,
    next_forecast_s: f64,
}

impl<P: Policy> Recording<P> {
    /// A recording of the pilot at `pilot`. `policy` explains the decisions where it is the model that made them.
    #[must_use]
    pub fn new(
        scene: Scene,
        mission: &Mission,
        pilot: Address,
        reserve: BatteryUnits,
        policy: P,
    ) -> Recording<P> {
        Recording {
            forecaster: Forecaster::new(mission, Metres(f32::from(scene.altitude_m))),
            flight: Flight::new(scene),
            mission: mission.clone(),
            station: Station::new(mission, pilot),
            decoder: FrameDecoder::new(),
            policy,
            reserve,
            next_live_s: f64::NEG_INFINITY,
            next_forecast_s: f64::NEG_INFINITY,
        }
    }

    /// A whole flight: frames with their times, and decisions, each in order of time.
    pub fn replay<'f>(
        &mut self,
        decisions: &[LoggedDecision],
        frames: impl IntoIterator<Item = (f64, &'f [u8])>,
    ) {
        let mut decisions = decisions.iter().peekable();
        for (t_s, frame) in frames {
            while let Some(decision) = decisions.next_if(|decision| decision.time_us as f64 * 1e-6 <= t_s) {
                self.decision(decision);
            }
            self.frame(t_s, frame);
        }
        decisions.for_each(|decision| self.decision(decision));
    }

    /// A frame on the vehicle's link.
    pub fn frame(&mut self, t_s: f64, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.read(&mut bytes) {
            if let Some(Heard::Text(text)) = self.station.receive(t_s, &frame) {
                self.flight.add(Event::Text(text));
            }
        }
        if t_s >= self.next_live_s {
            self.live(t_s);
        }
    }

    /// A decision of the log.
    pub fn decision(&mut self, logged: &LoggedDecision) {
        let t_s = logged.time_us as f64 * 1e-6;
        self.station.logged(logged);
        for (&device, &[_, _, remaining, snr_db, ..]) in logged.slots.iter().zip(&logged.tokens.devices) {
            if let Some(state) = self.station.devices_mut().get_mut(usize::from(device)) {
                let snr_db = Some(snr_db).filter(|&snr_db| snr_db > SNR_NOT_HEARD_DB);
                let reachable = snr_db.is_some_and(|snr_db| snr_db >= REACHABLE_SNR_DB);
                *state = DeviceState { remaining, snr_db, reachable };
            }
        }
        self.live(t_s);
        let inference = explain(&mut self.policy, logged);
        self.flight.add(Event::Decision(shown_logged(logged, inference.as_ref())));
        if t_s >= self.next_forecast_s {
            self.next_forecast_s = t_s + FORECAST_INTERVAL_S;
            self.forecast(logged);
        }
    }

    /// The flight so far.
    #[must_use]
    pub const fn flight(&self) -> &Flight {
        &self.flight
    }

    /// The whole flight.
    #[must_use]
    pub fn finish(self) -> Flight {
        self.flight
    }

    fn live(&mut self, t_s: f64) {
        self.next_live_s = t_s + LIVE_INTERVAL_S;
        self.flight.add(Event::Live(self.station.live(t_s)));
    }

    fn forecast(&mut self, logged: &LoggedDecision) {
        let Some(forecaster) = &mut self.forecaster else { return };
        let states = self.mission.devices.iter().zip(self.station.devices_mut());
        let devices = states.map(|(site, state)| HeardDevice {
            cell: site.cell,
            remaining: state.remaining,
            snr: state.snr_db.map(Db),
        });
        let question =
            Question { decision: logged.clone(), devices: devices.collect(), reserve: self.reserve };
        if let Some(what_if) = forecaster.forecast(&question) {
            self.flight.add(Event::WhatIf(what_if));
        }
    }
}
