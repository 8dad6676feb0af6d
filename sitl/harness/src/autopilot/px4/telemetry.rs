//! Messages that the autopilot sends.

use super::super::battery::Level;
use super::super::stack::Telemetry;
use super::super::{AutopilotKind, LinkId, VehicleMode};
use super::Px4;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

/// `ESTIMATOR_STATUS`, which the ArduPilot dialect includes from `common.xml`.
const ESTIMATOR_STATUS: u32 = 230;

/// Messages that PX4 sends at a rate or on request.
pub(super) const STREAMABLE: &[u32] = &[
    SYS_STATUS_DATA::ID,
    SYSTEM_TIME_DATA::ID,
    GPS_RAW_INT_DATA::ID,
    ATTITUDE_DATA::ID,
    LOCAL_POSITION_NED_DATA::ID,
    GLOBAL_POSITION_INT_DATA::ID,
    GPS_GLOBAL_ORIGIN_DATA::ID,
    RC_CHANNELS_DATA::ID,
    VFR_HUD_DATA::ID,
    POSITION_TARGET_LOCAL_NED_DATA::ID,
    BATTERY_STATUS_DATA::ID,
    ESTIMATOR_STATUS,
    HOME_POSITION_DATA::ID,
    EXTENDED_SYS_STATE_DATA::ID,
];

/// Default rates on the companion link, Hz.
const UNASKED: [(u32, f32); 10] = [
    (LOCAL_POSITION_NED_DATA::ID, 30.0),
    // The measured 100 Hz is above the simulation's tick.
    (ATTITUDE_DATA::ID, 50.0),
    (SYS_STATUS_DATA::ID, 5.0),
    (EXTENDED_SYS_STATE_DATA::ID, 5.0),
    (BATTERY_STATUS_DATA::ID, 0.5),
    (HOME_POSITION_DATA::ID, 0.5),
    (GPS_RAW_INT_DATA::ID, 8.0),
    (GLOBAL_POSITION_INT_DATA::ID, 10.0),
    (ESTIMATOR_STATUS, 1.0),
    (POSITION_TARGET_LOCAL_NED_DATA::ID, 10.0),
];

/// Rates on the ground links, Hz.
const UNASKED_GROUND: [(u32, f32); 4] = [
    (GLOBAL_POSITION_INT_DATA::ID, 5.0),
    (SYS_STATUS_DATA::ID, 1.0),
    (EXTENDED_SYS_STATE_DATA::ID, 1.0),
    (ESTIMATOR_STATUS, 1.0),
];

/// Estimator flags: attitude, velocities, absolute horizontal position, absolute and relative height.
const ESTIMATOR_TRUSTED: u16 = 0x0037;
const ESTIMATOR_STARTING: u16 = 0x0021;
/// `MAV_SYS_STATUS_SENSOR`: gyro, accelerometer, compass, pressure, GPS, AHRS, battery.
const SENSORS: u32 = 0x2F | 0x20_0000 | 0x200_0000;
/// `MAV_MODE_FLAG`: custom mode, stabilised, guided, auto; armed on top.
const BASE_MODE: u8 = 0x1D;
const BASE_MODE_ARMED: u8 = 0x80;

impl Px4 {
    pub(super) fn start_streams(&mut self) {
        for (message_id, rate_hz) in UNASKED {
            self.vehicle.ports.streams(LinkId::COMPANION).set(self.vehicle.now, message_id, 1e6 / rate_hz);
        }
        for link in [LinkId::GROUND, LinkId::CREW] {
            for (message_id, rate_hz) in UNASKED_GROUND {
                self.vehicle.ports.streams(link).set(self.vehicle.now, message_id, 1e6 / rate_hz);
            }
        }
    }

    /// `SET_MESSAGE_INTERVAL`: 0 is the default rate, -1 is off.
    pub(super) fn set_interval_or_default(
        &mut self,
        link: LinkId,
        message_id: u32,
        interval_us: f32,
    ) -> bool {
        let unasked = if link == LinkId::COMPANION { &UNASKED[..] } else { &UNASKED_GROUND[..] };
        let default = unasked.iter().find(|(id, _)| *id == message_id).map(|(_, rate_hz)| 1e6 / rate_hz);
        let interval_us = if interval_us == 0.0 { default.unwrap_or(-1.0) } else { interval_us };
        self.vehicle.ports.streams(link).set(self.vehicle.now, message_id, interval_us)
    }

    fn system_status(&self) -> MavState {
        if self.failsafe {
            MavState::MAV_STATE_CRITICAL
        } else if self.vehicle.airframe.home.is_none() {
            MavState::MAV_STATE_BOOT
        } else if self.vehicle.armed {
            MavState::MAV_STATE_ACTIVE
        } else {
            MavState::MAV_STATE_STANDBY
        }
    }

    fn estimator(&self) -> ESTIMATOR_STATUS_DATA {
        let ready = self.vehicle.airframe.estimator_ready(self.vehicle.now);
        let flags = if ready { ESTIMATOR_TRUSTED } else { ESTIMATOR_STARTING };
        ESTIMATOR_STATUS_DATA {
            time_usec: self.vehicle.now.as_micros(),
            flags: EstimatorStatusFlags::from_bits_retain(flags),
            ..ESTIMATOR_STATUS_DATA::DEFAULT
        }
    }
}

impl Telemetry for Px4 {
    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let armed = if self.vehicle.armed { BASE_MODE_ARMED } else { 0 };
        HEARTBEAT_DATA {
            custom_mode: self.vehicle.mode.custom_mode(AutopilotKind::Px4).unwrap_or(0),
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode: MavModeFlag::from_bits_retain(BASE_MODE | armed),
            system_status: self.system_status(),
            mavlink_version: 3,
        }
    }

    fn sys_status(&self) -> SYS_STATUS_DATA {
        let battery = &self.vehicle.airframe.battery;
        SYS_STATUS_DATA {
            onboard_control_sensors_present: MavSysStatusSensor::from_bits_retain(SENSORS),
            onboard_control_sensors_enabled: MavSysStatusSensor::from_bits_retain(SENSORS),
            onboard_control_sensors_health: MavSysStatusSensor::from_bits_retain(SENSORS),
            load: 300,
            voltage_battery: 16_200,
            current_battery: -1,
            battery_remaining: battery.percent(self.vehicle.now),
            ..SYS_STATUS_DATA::DEFAULT
        }
    }

    fn battery_status(&self) -> BATTERY_STATUS_DATA {
        let battery = &self.vehicle.airframe.battery;
        let mut voltages = [u16::MAX; 10];
        voltages[..4].fill(4_050);
        BATTERY_STATUS_DATA {
            current_consumed: -1,
            energy_consumed: -1,
            temperature: i16::MAX,
            voltages,
            current_battery: -1,
            battery_remaining: battery.percent(self.vehicle.now),
            charge_state: match battery.level {
                Level::Fine => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_OK,
                Level::Low => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_LOW,
                Level::Critical => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_CRITICAL,
                Level::Emergency => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_EMERGENCY,
            },
            ..BATTERY_STATUS_DATA::DEFAULT
        }
    }

    fn landed(&self) -> EXTENDED_SYS_STATE_DATA {
        let landed_state = match self.vehicle.mode {
            _ if self.vehicle.airframe.on_ground => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            VehicleMode::TakeOff => MavLandedState::MAV_LANDED_STATE_TAKEOFF,
            VehicleMode::Land => MavLandedState::MAV_LANDED_STATE_LANDING,
            _ => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        };
        EXTENDED_SYS_STATE_DATA { landed_state, ..EXTENDED_SYS_STATE_DATA::DEFAULT }
    }

    /// No RC receiver is connected in the measured configuration.
    fn rc(&self) -> RC_CHANNELS_DATA {
        RC_CHANNELS_DATA { time_boot_ms: self.vehicle.now.as_boot_ms(), ..RC_CHANNELS_DATA::DEFAULT }
    }

    fn send_own(&mut self, link: LinkId, message_id: u32) -> bool {
        if message_id != ESTIMATOR_STATUS {
            return false;
        }
        let data = self.estimator();
        self.vehicle.ports.send(link, &data);
        true
    }
}
