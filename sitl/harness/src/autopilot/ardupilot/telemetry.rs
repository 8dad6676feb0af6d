//! Messages that the autopilot sends.

use super::super::battery::Level;
use super::super::guidance::Guidance;
use super::super::stack::Telemetry;
use super::super::telemetry;
use super::super::{AutopilotKind, LinkId, VehicleMode};
use super::ArduCopter;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

/// Messages that ArduCopter sends at a rate or on request.
pub(super) const STREAMABLE: &[u32] = &[
    SYS_STATUS_DATA::ID,
    SYSTEM_TIME_DATA::ID,
    GPS_RAW_INT_DATA::ID,
    ATTITUDE_DATA::ID,
    LOCAL_POSITION_NED_DATA::ID,
    GLOBAL_POSITION_INT_DATA::ID,
    GPS_GLOBAL_ORIGIN_DATA::ID,
    NAV_CONTROLLER_OUTPUT_DATA::ID,
    RC_CHANNELS_DATA::ID,
    VFR_HUD_DATA::ID,
    POSITION_TARGET_LOCAL_NED_DATA::ID,
    BATTERY_STATUS_DATA::ID,
    EKF_STATUS_REPORT_DATA::ID,
    HOME_POSITION_DATA::ID,
    EXTENDED_SYS_STATE_DATA::ID,
];

/// Estimator flags with a trusted position (0x33F), and before (attitude and heights only).
const ESTIMATOR_TRUSTED: u16 = 0x33F;
const ESTIMATOR_STARTING: u16 = 0x0A7;
/// `MAV_SYS_STATUS_SENSOR`: 3D gyro, accelerometer, compass, pressure, GPS, RC receiver, AHRS, battery, pre-arm check.
const SENSORS: u32 = 0x2F | 0x1_0000 | 0x20_0000 | SENSOR_BATTERY | SENSOR_PREARM;
const SENSOR_BATTERY: u32 = 0x200_0000;
const SENSOR_PREARM: u32 = 0x1000_0000;
/// `MAV_MODE_FLAG`: custom mode and stabilised; with guided; with armed.
const BASE_MODE: u8 = 0x51;
const BASE_MODE_GUIDED: u8 = 0x59;
const BASE_MODE_ARMED: u8 = 0x80;

impl ArduCopter {
    fn system_status(&self) -> MavState {
        if self.vehicle.airframe.battery.level > Level::Fine || self.vehicle.lost_position() {
            MavState::MAV_STATE_CRITICAL
        } else if self.vehicle.airframe.home.is_none() {
            MavState::MAV_STATE_BOOT
        } else if self.vehicle.airframe.on_ground {
            MavState::MAV_STATE_STANDBY
        } else {
            MavState::MAV_STATE_ACTIVE
        }
    }

    pub(super) fn announce_origin_and_home(&mut self) {
        for link in LinkId::ALL {
            telemetry::send_by_id(self, link, GPS_GLOBAL_ORIGIN_DATA::ID);
            telemetry::send_by_id(self, link, HOME_POSITION_DATA::ID);
        }
    }

    fn estimator(&self) -> EKF_STATUS_REPORT_DATA {
        let ready = self.vehicle.airframe.estimator_ready(self.vehicle.now);
        let flags = if ready { ESTIMATOR_TRUSTED } else { ESTIMATOR_STARTING };
        EKF_STATUS_REPORT_DATA {
            velocity_variance: 0.02,
            pos_horiz_variance: 0.02,
            pos_vert_variance: 0.01,
            flags: EkfStatusFlags::from_bits_retain(flags),
            ..EKF_STATUS_REPORT_DATA::DEFAULT
        }
    }

    fn navigation(&self) -> NAV_CONTROLLER_OUTPUT_DATA {
        let away_m = match self.vehicle.guidance {
            Guidance::Target(target) => {
                let [north, east, _] = self.vehicle.airframe.body.position;
                let [to_north, to_east] = [target.position[0] - north, target.position[1] - east];
                (to_north * to_north + to_east * to_east).sqrt()
            }
            _ => 0.0,
        };
        NAV_CONTROLLER_OUTPUT_DATA { wp_dist: away_m as u16, ..NAV_CONTROLLER_OUTPUT_DATA::DEFAULT }
    }
}

impl Telemetry for ArduCopter {
    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let guided =
            matches!(self.vehicle.mode, VehicleMode::Guided | VehicleMode::Return | VehicleMode::Land);
        let base = if guided { BASE_MODE_GUIDED } else { BASE_MODE };
        let armed = if self.vehicle.armed { BASE_MODE_ARMED } else { 0 };
        HEARTBEAT_DATA {
            custom_mode: self.vehicle.mode.custom_mode(AutopilotKind::ArduPilot).unwrap_or(0),
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::from_bits_retain(base | armed),
            system_status: self.system_status(),
            mavlink_version: 3,
        }
    }

    fn sys_status(&self) -> SYS_STATUS_DATA {
        let battery = &self.vehicle.airframe.battery;
        let low = battery.level > Level::Fine;
        let healthy = SENSORS & !if low { SENSOR_BATTERY } else { 0 };
        SYS_STATUS_DATA {
            onboard_control_sensors_present: MavSysStatusSensor::from_bits_retain(SENSORS),
            onboard_control_sensors_enabled: MavSysStatusSensor::from_bits_retain(SENSORS),
            onboard_control_sensors_health: MavSysStatusSensor::from_bits_retain(healthy),
            load: 300,
            voltage_battery: (battery.voltage_v * 1000.0) as u16,
            current_battery: battery.current_ca(),
            battery_remaining: battery.percent(self.vehicle.now),
            ..SYS_STATUS_DATA::DEFAULT
        }
    }

    fn battery_status(&self) -> BATTERY_STATUS_DATA {
        let battery = &self.vehicle.airframe.battery;
        let mut voltages = [u16::MAX; 10];
        voltages[0] = (battery.voltage_v * 1000.0) as u16;
        BATTERY_STATUS_DATA {
            current_consumed: battery.consumed_mah(),
            energy_consumed: -1,
            temperature: i16::MAX,
            voltages,
            current_battery: battery.current_ca(),
            battery_remaining: battery.percent(self.vehicle.now),
            charge_state: match battery.level {
                Level::Fine => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_OK,
                Level::Low => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_LOW,
                _ => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_CRITICAL,
            },
            ..BATTERY_STATUS_DATA::DEFAULT
        }
    }

    fn landed(&self) -> EXTENDED_SYS_STATE_DATA {
        let landed_state = match self.vehicle.guidance {
            _ if self.vehicle.airframe.on_ground => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            Guidance::Descend(_) => MavLandedState::MAV_LANDED_STATE_LANDING,
            _ => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        };
        EXTENDED_SYS_STATE_DATA { landed_state, ..EXTENDED_SYS_STATE_DATA::DEFAULT }
    }

    /// Sticks centred, mode switch low.
    fn rc(&self) -> RC_CHANNELS_DATA {
        RC_CHANNELS_DATA {
            time_boot_ms: self.vehicle.now.as_boot_ms(),
            chan1_raw: 1500,
            chan2_raw: 1500,
            chan3_raw: 1500,
            chan4_raw: 1500,
            chan5_raw: 1000,
            chan6_raw: 1500,
            chan7_raw: 1000,
            chan8_raw: 1800,
            chancount: 16,
            rssi: 254,
            ..RC_CHANNELS_DATA::DEFAULT
        }
    }

    fn send_own(&mut self, link: LinkId, message_id: u32) -> bool {
        match message_id {
            NAV_CONTROLLER_OUTPUT_DATA::ID => {
                let data = self.navigation();
                self.vehicle.ports.send(link, &data);
            }
            EKF_STATUS_REPORT_DATA::ID => {
                let data = self.estimator();
                self.vehicle.ports.send(link, &data);
            }
            _ => return false,
        }
        true
    }
}
