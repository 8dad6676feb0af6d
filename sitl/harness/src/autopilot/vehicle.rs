//! What both simulated autopilots consist of: clock, ports, parameters, airframe, and the mode in force.

use super::airframe::Airframe;
use super::guidance::Guidance;
use super::motion::Response;
use super::parameters::{Defaults, ParameterTable};
use super::ports::Ports;
use super::{AircraftSettings, Commander, Truth, VehicleMode};
use gleaner_units::{Duration, Instant};

/// From power on to the first heartbeat after a reboot.
const BOOT_TIME: Duration = Duration::from_secs(3);
/// How long the estimator may report its position as untrusted before a mode that needs a position ends.
const ESTIMATOR_FAILSAFE: Duration = Duration::from_secs(1);

/// Constants of the vehicles with one flight stack.
pub(super) struct VehicleModel {
    /// Parameters with their default values.
    pub defaults: Defaults,
    /// Parameter of the MAVLink system id.
    pub system_id: &'static str,
    /// How the aircraft follows a target.
    pub response: Response,
    /// Messages that are sent at a rate or on request.
    pub streamable: &'static [u32],
    /// Mode after a boot, and who is said to have selected it.
    pub first_mode: (VehicleMode, Commander),
}

/// The state that does not depend on the flight stack.
#[derive(Debug)]
pub(super) struct Vehicle {
    /// The last boot, on the clock that [`Autopilot::step`](super::Autopilot::step) is given.
    pub booted_at: Instant,
    /// The autopilot's own clock, zero at its boot.
    pub now: Instant,
    /// When the first message leaves.
    pub up_from: Instant,
    pub ports: Ports,
    pub parameters: ParameterTable,
    pub airframe: Airframe,
    pub mode: VehicleMode,
    pub mode_by: Commander,
    pub guidance: Guidance,
    pub armed: bool,
    pub armed_at: Instant,
    pub next_heartbeat: Instant,
    pub ignored_targets: u32,
}

impl Vehicle {
    fn at_boot(model: &VehicleModel, airframe: Airframe, parameters: ParameterTable) -> Vehicle {
        let (mode, mode_by) = model.first_mode;
        Vehicle {
            booted_at: Instant::ZERO,
            now: Instant::ZERO,
            up_from: Instant::ZERO,
            ports: Ports::new(airframe.settings.system_id, model.streamable),
            parameters,
            airframe,
            mode,
            mode_by,
            guidance: Guidance::Halt,
            armed: false,
            armed_at: Instant::ZERO,
            next_heartbeat: Instant::ZERO,
            ignored_targets: 0,
        }
    }

    /// A vehicle with default parameters at its first boot, on the ground.
    pub fn new(model: &VehicleModel, settings: AircraftSettings) -> Vehicle {
        let mut parameters = ParameterTable::new(model.defaults);
        parameters.set(model.system_id, f32::from(settings.system_id));
        Vehicle::at_boot(model, Airframe::new(settings, model.response), parameters)
    }

    /// The same aircraft, with its parameters, at the next boot of its autopilot.
    pub fn rebooted(self, model: &VehicleModel) -> Vehicle {
        let up_from = Instant::ZERO + BOOT_TIME;
        Vehicle {
            booted_at: self.booted_at + (self.now - Instant::ZERO),
            up_from,
            next_heartbeat: up_from,
            ignored_targets: self.ignored_targets,
            ..Vehicle::at_boot(model, self.airframe.rebooted(), self.parameters)
        }
    }

    /// Whether the motors lift the aircraft, or spin up to do so.
    pub fn flies(&self) -> bool {
        !self.airframe.on_ground || matches!(self.guidance, Guidance::TakeOff { .. })
    }

    /// Whether the estimator has been untrusted for so long that the autopilot does not rely on it.
    pub fn lost_position(&self) -> bool {
        self.airframe.untrusted_since(self.now).is_some_and(|from| self.now - from > ESTIMATOR_FAILSAFE)
    }

    /// Whether the present mode needs a position that the estimator has lost in flight.
    pub fn needs_lost_position(&self) -> bool {
        let relies = self.mode == VehicleMode::Guided || self.mode.needs_position();
        self.armed && !self.airframe.on_ground && relies && self.lost_position()
    }

    /// Ground truth; `killed_by_nan` is for the stack to add.
    pub fn truth(&self) -> Truth {
        let position = self.airframe.true_position();
        Truth {
            position,
            ground_speed_mps: self.airframe.body.ground_speed_mps() as f32,
            height_m: self.airframe.settings.stand.down_m - position.down_m,
            armed: self.armed,
            on_ground: self.airframe.on_ground,
            mode: self.mode,
            mode_by: self.mode_by,
            target_by: self.guidance.target_by(),
            battery: self.airframe.battery.left(),
            killed_by_nan: false,
            is_up: self.now >= self.up_from,
            ignored_targets: self.ignored_targets,
        }
    }
}
