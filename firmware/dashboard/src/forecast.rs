//! What if: the flight from here under five preferences, on a thread of its own.

use crate::flight::{Event, WhatIf, WhatIfOption};
use crate::server::Publisher;
use gleaner_guard::Guard;
use gleaner_lookahead::{Budget, ChannelModel, FitSettings, LookAhead, View};
use gleaner_pilot::{LoggedDecision, MAX_DEVICES, Mission};
use gleaner_policy::{DeviceState, Preference};
use gleaner_units::{BatteryUnits, Cell, Metres, Rays};
use std::io;
use std::sync::mpsc::{SyncSender, sync_channel};

/// The effort of one forecast: about 20 ms on a desktop computer, after each decision.
const BUDGET: Budget = Budget { tours: 600 };
/// Fixes the random draws of the search, so that a report of a flight is the same each time.
const SEED: u64 = 1;

/// A decision with the state behind it.
#[derive(Clone, Debug)]
pub struct Question {
    /// The decision.
    pub decision: LoggedDecision,
    /// The devices at that moment, in the mission's order.
    pub devices: Vec<DeviceState>,
    /// `GLN_RESERVE`.
    pub reserve: BatteryUnits,
}

/// Plans on with the on-board model. It follows the flight: one call for each decision, in order.
#[derive(Debug)]
pub struct Forecaster {
    lookahead: Box<LookAhead<MAX_DEVICES>>,
    mission: Box<Mission>,
    guard: Box<Guard>,
    altitude: Metres,
    initial_units: f32,
}

impl Forecaster {
    /// A forecaster for this mission at this altitude; `None` for a mission that cannot be flown.
    #[must_use]
    pub fn new(mission: &Mission, altitude: Metres) -> Option<Forecaster> {
        let guard = Guard::new(&mission.fence, mission.terminal, BatteryUnits(0.0)).ok()?;
        let devices: Vec<DeviceState> = mission
            .devices
            .iter()
            .map(|site| DeviceState { cell: site.cell, remaining: site.data, snr: None })
            .collect();
        let mut lookahead = Box::new(LookAhead::new(ChannelModel::NOMINAL, FitSettings::DEFAULT));
        let sight = Rays { heights: &mission.heights, altitude_m: altitude.0 as u16 };
        lookahead.begin(Some(&sight), &devices, SEED);
        Some(Forecaster {
            lookahead,
            mission: Box::new(mission.clone()),
            guard: Box::new(guard),
            altitude,
            initial_units: devices.iter().map(|device| device.remaining).sum(),
        })
    }

    /// The flight from the cell of this decision under five preferences; `None` without a plan, as after the end.
    ///
    /// # Cost
    /// Six times 600 mean flights.
    pub fn forecast(&mut self, question: &Question) -> Option<WhatIf> {
        let Question { decision, devices, reserve } = question;
        self.guard.set_reserve(*reserve).ok()?;
        let [x, y] = decision.cell;
        let view = View {
            cell: Cell::new(x, y),
            battery: BatteryUnits(decision.battery),
            preference: Preference::new(decision.w_data)?,
            guard: &self.guard,
            devices,
        };
        // Its own choice does not count here; it keeps the plan and the fitted channel up to date.
        let logits = decision.logits.unwrap_or_default();
        self.lookahead.propose(&view, &logits, decision.mask, BUDGET)?;
        let outlooks = self.lookahead.what_if(&view, BUDGET)?;
        let total = self.initial_units.max(1.0);
        let options = outlooks.map(|outlook| WhatIfOption {
            w: outlook.w_data,
            path: outlook.path.iter().map(|point| [point.cell.x, point.cell.y]).collect(),
            collected: (decision.collected + outlook.expected.data_units / total).min(1.0),
            energy: outlook.expected.energy,
        });
        Some(WhatIf { t_s: decision.time_us as f64 * 1e-6, options: options.into() })
    }

    /// The altitude above the ground that line of sight is computed for.
    #[must_use]
    pub const fn altitude(&self) -> Metres {
        self.altitude
    }

    /// The mission.
    #[must_use]
    pub const fn mission(&self) -> &Mission {
        &self.mission
    }
}

/// Hands questions to the thread that answers them.
#[derive(Debug)]
pub(crate) struct Forecasts {
    questions: SyncSender<Question>,
}

impl Forecasts {
    /// Starts the thread; it ends when this handle is dropped.
    ///
    /// # Errors
    /// The system starts no thread.
    pub fn start(mut forecaster: Forecaster, publisher: Publisher) -> io::Result<Forecasts> {
        let (questions, asked) = sync_channel::<Question>(1);
        std::thread::Builder::new().name("forecast".into()).spawn(move || {
            for question in asked {
                if let Some(what_if) = forecaster.forecast(&question) {
                    publisher.publish(Event::WhatIf(what_if));
                }
            }
        })?;
        Ok(Forecasts { questions })
    }

    /// Never waits: while the thread is busy with two questions, another is dropped.
    pub fn ask(&self, question: Question) {
        let _ = self.questions.try_send(question);
    }
}
