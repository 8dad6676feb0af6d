//! What the autopilot says of itself.

use super::battery::Level;
use super::guidance::Guidance;
use super::{Copter, CopterMode, LinkId};
use gleaner_units::{Duration, GeoPoint, Metres, Ned};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

/// Height of the estimator's origin above sea level: ArduPilot's simulated field.
const ORIGIN_AMSL_MM: i32 = 584_000;
/// Estimator flags with a trusted position (0x33F), and before (attitude and heights only).
const ESTIMATOR_TRUSTED: u16 = 0x33F;
const ESTIMATOR_STARTING: u16 = 0x0A7;
/// `MAV_SYS_STATUS_SENSOR`: 3D gyro, accelerometer, compass, pressure, GPS, RC receiver, AHRS, battery, pre-arm check.
const SENSORS: u32 = 0x2F | 0x1_0000 | 0x20_0000 | SENSOR_BATTERY | SENSOR_PREARM;
const SENSOR_BATTERY: u32 = 0x200_0000;
const SENSOR_PREARM: u32 = 0x1000_0000;
/// `MAV_MODE_FLAG`: custom mode and stabilised; guided on top; armed on top.
const BASE_MODE: u8 = 0x51;
const BASE_MODE_GUIDED: u8 = 0x59;
const BASE_MODE_ARMED: u8 = 0x80;
const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);

impl Copter {
    /// Everything that is due.
    pub(super) fn report(&mut self) {
        if self.now >= self.next_heartbeat {
            self.next_heartbeat = self.next_heartbeat + HEARTBEAT_INTERVAL;
            self.send_heartbeats();
        }
        let now = self.now;
        for link in LinkId::ALL {
            while let Some(message_id) = self.link_mut(link).streams.due(now) {
                self.send_by_id(link, message_id);
            }
        }
    }

    pub(super) fn send<D: MessageData>(&mut self, link: LinkId, data: &D) {
        let link = self.link_mut(link);
        let frame = link.speaker.frame(data);
        link.out.push(frame);
    }

    /// On every link.
    pub(super) fn send_heartbeats(&mut self) {
        let guided = matches!(self.mode, CopterMode::Guided | CopterMode::Rtl | CopterMode::Land);
        let base = if guided { BASE_MODE_GUIDED } else { BASE_MODE };
        let armed = if self.armed { BASE_MODE_ARMED } else { 0 };
        let data = HEARTBEAT_DATA {
            custom_mode: self.mode.number(),
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::from_bits_retain(base | armed),
            system_status: self.system_status(),
            mavlink_version: 3,
        };
        for link in LinkId::ALL {
            self.send(link, &data);
        }
    }

    fn system_status(&self) -> MavState {
        if self.battery.level() > Level::Fine || self.estimator_failsafe() {
            MavState::MAV_STATE_CRITICAL
        } else if self.home.is_none() {
            MavState::MAV_STATE_BOOT
        } else if self.on_ground {
            MavState::MAV_STATE_STANDBY
        } else {
            MavState::MAV_STATE_ACTIVE
        }
    }

    pub(super) fn announce_origin_and_home(&mut self) {
        for link in LinkId::ALL {
            self.send_by_id(link, GPS_GLOBAL_ORIGIN_DATA::ID);
            self.send_by_id(link, HOME_POSITION_DATA::ID);
        }
    }

    /// Sends one message of this kind; whether there is one. Without an origin there is no position to speak of.
    pub(super) fn send_by_id(&mut self, link: LinkId, message_id: u32) -> bool {
        match message_id {
            AUTOPILOT_VERSION_DATA::ID => self.send(link, &self.version()),
            SYS_STATUS_DATA::ID => self.send(link, &self.sys_status()),
            SYSTEM_TIME_DATA::ID => {
                self.send(link, &SYSTEM_TIME_DATA { time_boot_ms: self.time_boot_ms(), time_unix_usec: 0 });
            }
            GPS_RAW_INT_DATA::ID => self.send(link, &self.gps()),
            ATTITUDE_DATA::ID => self.send(link, &self.attitude()),
            NAV_CONTROLLER_OUTPUT_DATA::ID => self.send(link, &self.navigation()),
            RC_CHANNELS_DATA::ID => self.send(link, &self.rc()),
            VFR_HUD_DATA::ID => self.send(link, &self.hud()),
            BATTERY_STATUS_DATA::ID => self.send(link, &self.battery_status()),
            EKF_STATUS_REPORT_DATA::ID => self.send(link, &self.estimator()),
            EXTENDED_SYS_STATE_DATA::ID => self.send(link, &self.landed()),
            _ => return self.send_position_by_id(link, message_id),
        }
        true
    }

    fn send_position_by_id(&mut self, link: LinkId, message_id: u32) -> bool {
        let Some(home) = self.home else { return false };
        match message_id {
            LOCAL_POSITION_NED_DATA::ID => self.send(link, &self.local_position()),
            GLOBAL_POSITION_INT_DATA::ID => self.send(link, &self.global_position(home)),
            GPS_GLOBAL_ORIGIN_DATA::ID => self.send(link, &self.origin()),
            HOME_POSITION_DATA::ID => self.send(link, &self.home_position(home)),
            POSITION_TARGET_LOCAL_NED_DATA::ID => match self.position_target() {
                Some(target) => self.send(link, &target),
                None => return false,
            },
            _ => return false,
        }
        true
    }

    fn time_boot_ms(&self) -> u32 {
        self.now.as_boot_ms()
    }

    fn version(&self) -> AUTOPILOT_VERSION_DATA {
        AUTOPILOT_VERSION_DATA {
            capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT,
            // 4.6.3, official release.
            flight_sw_version: 0x0406_03FF,
            ..AUTOPILOT_VERSION_DATA::DEFAULT
        }
    }

    fn sys_status(&self) -> SYS_STATUS_DATA {
        let low = self.battery.level() > Level::Fine;
        let healthy = SENSORS & !if low { SENSOR_BATTERY } else { 0 };
        SYS_STATUS_DATA {
            onboard_control_sensors_present: MavSysStatusSensor::from_bits_retain(SENSORS),
            onboard_control_sensors_enabled: MavSysStatusSensor::from_bits_retain(SENSORS),
            onboard_control_sensors_health: MavSysStatusSensor::from_bits_retain(healthy),
            load: 300,
            voltage_battery: (self.battery.voltage_v * 1000.0) as u16,
            current_battery: self.battery.current_ca(),
            battery_remaining: self.battery.percent(),
            ..SYS_STATUS_DATA::DEFAULT
        }
    }

    fn battery_status(&self) -> BATTERY_STATUS_DATA {
        let mut voltages = [u16::MAX; 10];
        voltages[0] = (self.battery.voltage_v * 1000.0) as u16;
        BATTERY_STATUS_DATA {
            current_consumed: self.battery.consumed_mah(),
            energy_consumed: -1,
            temperature: i16::MAX,
            voltages,
            current_battery: self.battery.current_ca(),
            battery_remaining: self.battery.percent(),
            charge_state: match self.battery.level() {
                Level::Fine => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_OK,
                Level::Low => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_LOW,
                Level::Critical => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_CRITICAL,
            },
            ..BATTERY_STATUS_DATA::DEFAULT
        }
    }

    fn local_position(&self) -> LOCAL_POSITION_NED_DATA {
        let [x, y, z] = self.body.position.map(|metres| metres as f32);
        let [vx, vy, vz] = self.body.velocity.map(|speed| speed as f32);
        LOCAL_POSITION_NED_DATA { time_boot_ms: self.time_boot_ms(), x, y, z, vx, vy, vz }
    }

    fn geo(&self, position: Ned) -> (GeoPoint, i32) {
        let point = self.settings.origin.offset_by(Metres(position.north_m), Metres(position.east_m));
        (point, ORIGIN_AMSL_MM - (position.down_m * 1000.0) as i32)
    }

    fn heading_cdeg(&self) -> u16 {
        let [north, east] = self.heading;
        let degrees = libm::atan2(east, north).to_degrees();
        ((degrees + 360.0) % 360.0 * 100.0) as u16
    }

    fn global_position(&self, home: Ned) -> GLOBAL_POSITION_INT_DATA {
        let (point, alt) = self.geo(self.estimated());
        let [vx, vy, vz] = self.body.velocity.map(|speed| (speed * 100.0) as i16);
        GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.time_boot_ms(),
            lat: point.lat_deg_e7,
            lon: point.lon_deg_e7,
            alt,
            relative_alt: ((home.down_m - self.estimated().down_m) * 1000.0) as i32,
            vx,
            vy,
            vz,
            hdg: self.heading_cdeg(),
        }
    }

    fn gps(&self) -> GPS_RAW_INT_DATA {
        let (point, alt) = self.geo(self.estimated());
        let fixed = self.estimator_ready();
        GPS_RAW_INT_DATA {
            time_usec: self.now.as_micros(),
            lat: if fixed { point.lat_deg_e7 } else { 0 },
            lon: if fixed { point.lon_deg_e7 } else { 0 },
            alt: if fixed { alt } else { 0 },
            eph: 121,
            epv: 200,
            vel: (self.body.ground_speed_mps() * 100.0) as u16,
            cog: self.heading_cdeg(),
            fix_type: if fixed {
                GpsFixType::GPS_FIX_TYPE_RTK_FIXED
            } else {
                GpsFixType::GPS_FIX_TYPE_NO_FIX
            },
            satellites_visible: 10,
            ..GPS_RAW_INT_DATA::DEFAULT
        }
    }

    fn origin(&self) -> GPS_GLOBAL_ORIGIN_DATA {
        let GeoPoint { lat_deg_e7, lon_deg_e7 } = self.settings.origin;
        GPS_GLOBAL_ORIGIN_DATA {
            latitude: lat_deg_e7,
            longitude: lon_deg_e7,
            altitude: ORIGIN_AMSL_MM,
            time_usec: self.now.as_micros(),
        }
    }

    fn home_position(&self, home: Ned) -> HOME_POSITION_DATA {
        let (point, altitude) = self.geo(home);
        HOME_POSITION_DATA {
            latitude: point.lat_deg_e7,
            longitude: point.lon_deg_e7,
            altitude,
            x: home.north_m,
            y: home.east_m,
            z: home.down_m,
            q: [1.0, 0.0, 0.0, 0.0],
            time_usec: self.now.as_micros(),
            ..HOME_POSITION_DATA::DEFAULT
        }
    }

    /// Only under a GUIDED target.
    fn position_target(&self) -> Option<POSITION_TARGET_LOCAL_NED_DATA> {
        let Guidance::Target(target) = self.guidance else { return None };
        let [x, y, z] = target.position.map(|metres| metres as f32);
        let [vx, vy, vz] = target.velocity.map(|speed| speed as f32);
        Some(POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: self.time_boot_ms(),
            x,
            y,
            z,
            vx,
            vy,
            vz,
            type_mask: PositionTargetTypemask::from_bits_retain(0x0DF8),
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            ..POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        })
    }

    fn estimator(&self) -> EKF_STATUS_REPORT_DATA {
        let flags = if self.estimator_ready() { ESTIMATOR_TRUSTED } else { ESTIMATOR_STARTING };
        EKF_STATUS_REPORT_DATA {
            velocity_variance: 0.02,
            pos_horiz_variance: 0.02,
            pos_vert_variance: 0.01,
            flags: EkfStatusFlags::from_bits_retain(flags),
            ..EKF_STATUS_REPORT_DATA::DEFAULT
        }
    }

    fn landed(&self) -> EXTENDED_SYS_STATE_DATA {
        let landed_state = match self.guidance {
            _ if self.on_ground => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            Guidance::Descend(_) => MavLandedState::MAV_LANDED_STATE_LANDING,
            _ => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        };
        EXTENDED_SYS_STATE_DATA { landed_state, ..EXTENDED_SYS_STATE_DATA::DEFAULT }
    }

    fn attitude(&self) -> ATTITUDE_DATA {
        let [north, east] = self.heading;
        ATTITUDE_DATA {
            time_boot_ms: self.time_boot_ms(),
            yaw: libm::atan2(east, north) as f32,
            ..ATTITUDE_DATA::DEFAULT
        }
    }

    fn hud(&self) -> VFR_HUD_DATA {
        let speed = self.body.ground_speed_mps() as f32;
        VFR_HUD_DATA {
            airspeed: speed,
            groundspeed: speed,
            alt: self.geo(self.estimated()).1 as f32 * 1e-3,
            climb: -self.body.velocity[2] as f32,
            heading: (self.heading_cdeg() / 100) as i16,
            throttle: if self.on_ground { 0 } else { 35 },
        }
    }

    fn navigation(&self) -> NAV_CONTROLLER_OUTPUT_DATA {
        let away_m = match self.guidance {
            Guidance::Target(target) => {
                let [north, east, _] = self.body.position;
                let [to_north, to_east] = [target.position[0] - north, target.position[1] - east];
                (to_north * to_north + to_east * to_east).sqrt()
            }
            _ => 0.0,
        };
        NAV_CONTROLLER_OUTPUT_DATA { wp_dist: away_m as u16, ..NAV_CONTROLLER_OUTPUT_DATA::DEFAULT }
    }

    /// Sticks centred, mode switch low.
    fn rc(&self) -> RC_CHANNELS_DATA {
        RC_CHANNELS_DATA {
            time_boot_ms: self.time_boot_ms(),
            chan1_raw: 1500,
            chan2_raw: 1500,
            chan3_raw: 1500,
            chan4_raw: 1500,
            chan5_raw: 1000,
            chan6_raw: self.rc_dial_us,
            chan7_raw: 1000,
            chan8_raw: 1800,
            chancount: 16,
            rssi: 254,
            ..RC_CHANNELS_DATA::DEFAULT
        }
    }
}
