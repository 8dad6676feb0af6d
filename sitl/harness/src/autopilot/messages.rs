//! Telemetry that both autopilots lay out alike.

use super::LinkId;
use super::airframe::Airframe;
use super::guidance::Guidance;
use super::ports::Ports;
use gleaner_units::{GeoPoint, Instant, Metres, Ned};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

/// Height of the estimator's origin above sea level, mm: ArduPilot's simulated field.
pub(super) const ORIGIN_AMSL_MM: i32 = 584_000;

impl Airframe {
    /// Sends one message about position, origin, home or target; whether there is one. Without a home there is no
    /// position, and a target only in GUIDED or OFFBOARD with one.
    pub fn send_position(
        &self,
        ports: &mut Ports,
        link: LinkId,
        now: Instant,
        guidance: Guidance,
        message_id: u32,
    ) -> bool {
        let Some(home) = self.home else { return false };
        match message_id {
            LOCAL_POSITION_NED_DATA::ID => ports.send(link, &self.local_position_message(now)),
            GLOBAL_POSITION_INT_DATA::ID => ports.send(link, &self.global_position_message(now, home)),
            GPS_GLOBAL_ORIGIN_DATA::ID => ports.send(link, &self.origin_message(now)),
            HOME_POSITION_DATA::ID => ports.send(link, &self.home_message(now, home)),
            POSITION_TARGET_LOCAL_NED_DATA::ID => {
                let Guidance::Target(target) = guidance else { return false };
                ports.send(link, &self.target_message(now, target.position, target.velocity));
            }
            _ => return false,
        }
        true
    }

    /// A point of the local frame on the globe, and its height above sea level in mm.
    pub fn geographic(&self, position: Ned) -> (GeoPoint, i32) {
        let point = self.origin().offset_by(Metres(position.north_m), Metres(position.east_m));
        (point, ORIGIN_AMSL_MM - (position.down_m * 1000.0) as i32)
    }

    fn heading_cdeg(&self) -> u16 {
        let [north, east] = self.heading;
        let degrees = libm::atan2(east, north).to_degrees();
        ((degrees + 360.0) % 360.0 * 100.0) as u16
    }

    fn local_position_message(&self, now: Instant) -> LOCAL_POSITION_NED_DATA {
        let Ned { north_m: x, east_m: y, down_m: z } = self.estimated();
        let [vx, vy, vz] = self.body.velocity.map(|speed| speed as f32);
        LOCAL_POSITION_NED_DATA { time_boot_ms: now.as_boot_ms(), x, y, z, vx, vy, vz }
    }

    fn global_position_message(&self, now: Instant, home: Ned) -> GLOBAL_POSITION_INT_DATA {
        let (point, alt) = self.geographic(self.estimated());
        let [vx, vy, vz] = self.body.velocity.map(|speed| (speed * 100.0) as i16);
        GLOBAL_POSITION_INT_DATA {
            time_boot_ms: now.as_boot_ms(),
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

    pub fn gps_message(&self, now: Instant) -> GPS_RAW_INT_DATA {
        let (point, alt) = self.geographic(self.estimated());
        let fixed = self.estimator_ready(now);
        GPS_RAW_INT_DATA {
            time_usec: now.as_micros(),
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

    fn origin_message(&self, now: Instant) -> GPS_GLOBAL_ORIGIN_DATA {
        let GeoPoint { lat_deg_e7, lon_deg_e7 } = self.origin();
        GPS_GLOBAL_ORIGIN_DATA {
            latitude: lat_deg_e7,
            longitude: lon_deg_e7,
            altitude: ORIGIN_AMSL_MM,
            time_usec: now.as_micros(),
        }
    }

    fn home_message(&self, now: Instant, home: Ned) -> HOME_POSITION_DATA {
        let (point, altitude) = self.geographic(home);
        HOME_POSITION_DATA {
            latitude: point.lat_deg_e7,
            longitude: point.lon_deg_e7,
            altitude,
            x: home.north_m,
            y: home.east_m,
            z: home.down_m,
            q: [1.0, 0.0, 0.0, 0.0],
            time_usec: now.as_micros(),
            ..HOME_POSITION_DATA::DEFAULT
        }
    }

    pub fn attitude_message(&self, now: Instant) -> ATTITUDE_DATA {
        let [north, east] = self.heading;
        ATTITUDE_DATA {
            time_boot_ms: now.as_boot_ms(),
            yaw: libm::atan2(east, north) as f32,
            ..ATTITUDE_DATA::DEFAULT
        }
    }

    pub fn hud_message(&self) -> VFR_HUD_DATA {
        let speed = self.body.ground_speed_mps() as f32;
        VFR_HUD_DATA {
            airspeed: speed,
            groundspeed: speed,
            alt: self.geographic(self.estimated()).1 as f32 * 1e-3,
            climb: -self.body.velocity[2] as f32,
            heading: (self.heading_cdeg() / 100) as i16,
            throttle: if self.on_ground { 0 } else { 35 },
        }
    }

    /// `POSITION_TARGET_LOCAL_NED` for a target of the boot frame.
    fn target_message(
        &self,
        now: Instant,
        position: [f64; 3],
        velocity: [f64; 3],
    ) -> POSITION_TARGET_LOCAL_NED_DATA {
        let [x, y, z] = self.to_local(position).map(|metres| metres as f32);
        let [vx, vy, vz] = velocity.map(|speed| speed as f32);
        POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: now.as_boot_ms(),
            x,
            y,
            z,
            vx,
            vy,
            vz,
            type_mask: PositionTargetTypemask::from_bits_retain(0x0DF8),
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            ..POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
        }
    }
}
