//! A program that is asked to end in flight.

use super::{Waiter, rd, world};
use gleaner_harness::{
    AutopilotKind, Companion, FlightRun, FlightScript, MissionPlan, MissionSetup, Simulation, VehicleMode,
};
use gleaner_pilot::{OnStop, Onboard, Parameters, Settings, State};
use gleaner_units::{Duration, Instant};

/// A program that is asked to end 20 s after it was engaged, as by SIGTERM.
struct Stopped {
    onboard: Onboard<Waiter>,
    stops_at: Option<Instant>,
    is_over: bool,
}

impl Companion for Stopped {
    fn exchange(&mut self, simulation: &mut Simulation, now: Instant) {
        if self.is_over {
            return;
        }
        if self.stops_at.is_some_and(|at| now >= at) {
            self.onboard.hand_back();
            self.stops_at = None;
        }
        self.onboard.exchange(simulation, now);
        match self.onboard.state() {
            State::Engaged if self.stops_at.is_none() && !self.onboard.is_handing_back() => {
                self.stops_at = Some(now + Duration::from_secs(20));
            }
            State::Fault => self.is_over = !self.onboard.is_handing_back(),
            _ => {}
        }
    }
}

#[test]
fn a_program_that_ends_requests_to_return_or_to_hold_on_both_autopilots() {
    for (autopilot, on_stop, mode) in [
        (AutopilotKind::ArduPilot, OnStop::Return, VehicleMode::Return),
        (AutopilotKind::ArduPilot, OnStop::Hold, VehicleMode::Brake),
        (AutopilotKind::Px4, OnStop::Return, VehicleMode::Return),
        (AutopilotKind::Px4, OnStop::Hold, VehicleMode::Hold),
    ] {
        let setup = MissionSetup::new(world(), MissionPlan { autopilot, ..rd(4) }).unwrap();
        let mut settings = Settings::default();
        settings.rules.on_stop = on_stop;
        let onboard = Onboard::new(setup.mission.clone(), Parameters::default(), settings, Waiter, Ok(()));
        let mut program = Stopped { onboard: onboard.unwrap(), stops_at: None, is_over: false };
        let mut flight = FlightRun::new(setup, FlightScript::plain(1.0), settings.component_id).unwrap();
        while !program.is_over {
            assert_eq!(flight.step(&mut program), None, "{autopilot}: it ends before the program");
        }
        // Without Gleaner's setpoints nothing else may happen either.
        let until = flight.simulation().now() + Duration::from_secs(5);
        while flight.simulation().now() < until {
            flight.step(&mut program);
        }
        assert_eq!(flight.simulation().truth().mode, mode, "{autopilot}");
        assert_eq!(flight.simulation().referee().violations(), [], "{autopilot}");
    }
}
