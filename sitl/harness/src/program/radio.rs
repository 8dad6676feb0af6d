//! `radio`: the simulated radio alone, beside an autopilot simulator of the user's own.
//!
//! It follows the vehicle's position over MAVLink, draws the links of the mission's devices at the vehicle's cell as
//! the simulation does, and reports them. One device is served per slot of [`SLOT`], the strongest one in reach.

use super::arguments::{RadioFormat, RadioOrder};
use super::{ProgramError, load};
use crate::modem::Modem;
use crate::wire::{Speaker, parse};
use crate::wired::receive;
use crate::{FlightError, MissionPlan, MissionSetup};
use gleaner_link::{Address, FrameDecoder};
use gleaner_ports::{Port, wait};
use gleaner_radio::{Report, encode};
use gleaner_units::{Action, Cell, GeoPoint, GridFrame, Instant, Metres, Ned};
use gleaner_world::ScenarioKind;
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavModeFlag, MavState,
    MavType,
};
use std::sync::atomic::Ordering;
use std::time::{self, Duration};

/// A slot lasts as long as a cell at 10 m/s.
const SLOT: Duration = Duration::from_secs(2);
/// Heartbeat, and the request for positions.
const ASK_INTERVAL: Duration = Duration::from_secs(1);
const REST: Duration = Duration::from_millis(50);
const STATUS_INTERVAL: Duration = Duration::from_secs(5);
/// Height above the grid's origin is of no interest here.
const DOWN_M: f32 = 0.0;

/// Runs until it is interrupted.
pub(super) fn radio(order: &RadioOrder) -> Result<bool, ProgramError> {
    let mission = load::read_mission(&order.mission)?;
    let corner = mission.pose.corner;
    let grid = GridFrame::new(mission.grid(), mission.pose, corner);
    let plan = MissionPlan::new(ScenarioKind::ReachDestination, order.seed);
    let setup = MissionSetup::of_mission(mission, plan).map_err(FlightError::from)?;
    let modem = Modem::new(setup.world.clone(), &setup.realization, setup.seed());
    let mut modem = modem.map_err(|error| FlightError::Plan(error.into()))?.with_ids(setup.device_ids());
    let mut vehicle = Port::open(&order.vehicle).map_err(ProgramError::Port)?;
    let mut reports = Port::open(&order.reports).map_err(ProgramError::Port)?;
    println!("vehicle {}\nreports {}", order.vehicle, order.reports);
    let stop = gleaner_ports::end_requested().map_err(ProgramError::Signals)?;
    let mut follower = Follower::new(grid, corner);
    let begun = time::Instant::now();
    let (mut next_ask, mut next_slot, mut next_status) = (begun, begun, begun + STATUS_INTERVAL);
    let mut encoder = Encoder { format: order.format, token: 0 };
    let mut sent = 0_u64;
    while !stop.load(Ordering::Relaxed) {
        let now = time::Instant::now();
        // Closed ports reopen by themselves.
        let _ = vehicle.maintain(now);
        let _ = reports.maintain(now);
        receive(&mut vehicle, |bytes| follower.read(bytes));
        receive(&mut reports, |_| {});
        if now >= next_ask {
            next_ask = now + ASK_INTERVAL;
            for frame in follower.ask() {
                vehicle.send(&frame);
            }
        }
        if let Some(cell) = follower.cell {
            modem.carry_to(cell);
            if now >= next_slot {
                next_slot = now + SLOT;
                modem.slot(cell, Action::Hover);
            }
            let elapsed_ms = u64::try_from(begun.elapsed().as_millis()).unwrap_or(u64::MAX);
            let due = modem.reports(Instant::from_millis(elapsed_ms));
            sent += due.len() as u64;
            for bytes in encoder.encode(&due) {
                reports.send(&bytes);
            }
        }
        if now >= next_status {
            next_status = now + STATUS_INTERVAL;
            println!("{}", status(&follower, &modem, sent));
        }
        if wait(&[&vehicle], REST).is_err() {
            std::thread::sleep(REST);
        }
    }
    Ok(true)
}

fn status(follower: &Follower, modem: &Modem, sent: u64) -> String {
    let collected = 100.0 * modem.field().collected_fraction();
    match (follower.cell, follower.distance_m) {
        (Some(cell), _) => format!("vehicle over {cell}, {sent} reports sent, {collected:.1} % collected"),
        (None, Some(metres)) => format!("vehicle {:.1} km from the grid: no reports", metres / 1000.0),
        (None, None) => "no GLOBAL_POSITION_INT from the vehicle: check --vehicle".into(),
    }
}

/// Follows the vehicle's position.
struct Follower {
    grid: GridFrame,
    corner: GeoPoint,
    decoder: FrameDecoder,
    speaker: Speaker,
    system: u8,
    cell: Option<Cell>,
    distance_m: Option<f32>,
}

impl Follower {
    fn new(grid: GridFrame, corner: GeoPoint) -> Follower {
        Follower {
            grid,
            corner,
            decoder: FrameDecoder::new(),
            // `MAV_COMP_ID_TELEMETRY_RADIO`.
            speaker: Speaker::new(Address::new(1, 68)),
            system: 1,
            cell: None,
            distance_m: None,
        }
    }

    fn read(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.read(&mut bytes) {
            if let Some(position) = parse::<GLOBAL_POSITION_INT_DATA>(&frame) {
                self.system = frame.sender.system;
                self.follow(GeoPoint { lat_deg_e7: position.lat, lon_deg_e7: position.lon });
            }
        }
    }

    fn follow(&mut self, at: GeoPoint) {
        let (north, east) = self.corner.offset_to(&at);
        let Metres(north_m) = north;
        let Metres(east_m) = east;
        self.cell = self.grid.cell(&Ned { north_m, east_m, down_m: DOWN_M });
        self.distance_m = Some((north_m * north_m + east_m * east_m).sqrt());
    }

    /// Heartbeat, and a request for positions at 5 Hz.
    fn ask(&mut self) -> [Vec<u8>; 2] {
        let heartbeat = self.speaker.frame(&HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        });
        let interval = self.speaker.frame(&COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
            param1: 33.0,
            param2: 200_000.0,
            target_system: self.system,
            target_component: 1,
            ..COMMAND_LONG_DATA::DEFAULT
        });
        [heartbeat, interval]
    }
}

/// Writes reports in one of the formats.
struct Encoder {
    format: RadioFormat,
    token: u16,
}

impl Encoder {
    fn encode(&mut self, reports: &[Report]) -> Vec<Vec<u8>> {
        match self.format {
            RadioFormat::Cobs => reports.iter().map(|report| encode(report).to_vec()).collect(),
            RadioFormat::JsonLines => reports.iter().map(json_line).collect(),
            RadioFormat::SemtechUdp => reports.iter().map(|report| self.push_data(report)).collect(),
        }
    }

    /// `PUSH_DATA` with one `rxpk`: an unconfirmed LoRaWAN uplink whose `DevAddr` is the device id. The protocol
    /// carries no remaining data.
    fn push_data(&mut self, report: &Report) -> Vec<u8> {
        self.token = self.token.wrapping_add(1);
        let [token_low, token_high] = self.token.to_le_bytes();
        let gateway = [0x02, 0, 0, 0xFF, 0xFE, 0, 0, 1];
        let mut bytes = vec![2, token_low, token_high, 0];
        bytes.extend_from_slice(&gateway);
        let mut uplink = vec![0x40];
        uplink.extend_from_slice(&report.device.to_le_bytes());
        let [low, high] = self.token.to_le_bytes();
        uplink.extend_from_slice(&[0, low, high, 1, 0, 0, 0, 0, 0]);
        let packet = serde_json::json!({"rxpk": [{
            "tmst": u32::from(self.token) * 1000, "chan": 0, "rfch": 0, "freq": 868.1, "stat": 1,
            "modu": "LORA", "datr": "SF7BW125", "codr": "4/5", "rssi": -60,
            "lsnr": (report.snr.0 * 10.0).round() / 10.0,
            "size": uplink.len(), "data": base64(&uplink),
        }]});
        bytes.extend_from_slice(packet.to_string().as_bytes());
        bytes
    }
}

/// `{"id":1,"snr_db":2.5,"remaining":1000,"age_s":0.2}` and a newline.
fn json_line(report: &Report) -> Vec<u8> {
    let line = serde_json::json!({
        "id": report.device,
        "snr_db": report.snr.0,
        "remaining": report.remaining,
        "age_s": report.age_ms as f32 / 1000.0,
    });
    format!("{line}\n").into_bytes()
}

fn base64(bytes: &[u8]) -> String {
    use base64::Engine as _;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_units::{Db, Degrees, GridPose};

    fn report() -> Report {
        Report { device: 0x0102_0304, snr: Db(2.5), remaining: Some(1000.0), age_ms: 200 }
    }

    #[test]
    fn json_lines_have_the_documented_keys() {
        let line = String::from_utf8(json_line(&report())).unwrap();
        let value: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert!(line.ends_with('\n'));
        assert_eq!((value["id"].as_u64(), value["snr_db"].as_f64()), (Some(0x0102_0304), Some(2.5)));
        assert_eq!(value["remaining"].as_f64(), Some(1000.0));
    }

    #[test]
    fn push_data_names_the_device_by_its_address() {
        let mut encoder = Encoder { format: RadioFormat::SemtechUdp, token: 0 };
        let bytes = encoder.push_data(&report());
        assert_eq!((bytes[0], bytes[3]), (2, 0), "protocol version 2, PUSH_DATA");
        let packet: serde_json::Value = serde_json::from_slice(&bytes[12..]).unwrap();
        let rxpk = &packet["rxpk"][0];
        assert_eq!(rxpk["lsnr"].as_f64(), Some(2.5));
        // 40 04 03 02 01: unconfirmed uplink, DevAddr little-endian.
        assert!(rxpk["data"].as_str().unwrap().starts_with("QAQDAg"), "{rxpk}");
    }

    #[test]
    fn the_follower_finds_the_cell_under_the_vehicle() {
        let corner = GeoPoint { lat_deg_e7: -353_632_621, lon_deg_e7: 1_491_652_374 };
        let grid = gleaner_units::Grid::new(40, 30, Metres(20.0)).unwrap();
        let mut follower =
            Follower::new(GridFrame::new(grid, GridPose { corner, rotation: Degrees(0.0) }, corner), corner);
        follower.follow(corner.offset_by(Metres(50.0), Metres(90.0)));
        assert_eq!(follower.cell, Some(Cell::new(4, 2)));
        follower.follow(corner.offset_by(Metres(-5000.0), Metres(0.0)));
        assert_eq!(follower.cell, None);
    }
}
