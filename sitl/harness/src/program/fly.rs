//! `fly`: one mission in virtual time.

use super::ProgramError;
use super::arguments::FlyOrder;
use super::model;
use super::results;
use crate::{Ending, Figures, FlightError, Flown, Staged, Wishes};
use gleaner_world::World;
use std::sync::Arc;
use std::time::Instant;

pub(super) fn fly(order: &FlyOrder) -> Result<bool, ProgramError> {
    let begun = Instant::now();
    let policy = model::load(order.model.as_deref())?;
    let model = model::name(&policy);
    let world = Arc::new(World::default_world());
    let staged = Staged::new(world, order.plan).map_err(FlightError::from)?;
    let wishes = Wishes { switches: order.switches.clone(), ..Wishes::plain(order.preference) };
    let flown = crate::fly(staged, wishes, policy, Ok(()))?;
    let figures = flown.figures();
    let picture = results::write_files(&order.out, &flown.simulation, &figures, &model)?;
    let wall_s = begun.elapsed().as_secs_f64();
    if order.json {
        println!("{}", results::json(&figures, &model, wall_s));
    } else {
        let mut lines = results::summary(&flown.simulation, &figures, &model);
        lines.push(("preference", switches(&flown)));
        lines.push(("ended", ended(&flown, &figures)));
        results::print(&lines, &figures, wall_s, &picture);
    }
    Ok(figures.is_good())
}

fn switches(flown: &Flown) -> String {
    if flown.wishes.switches.is_empty() {
        return "not switched".into();
    }
    let each = flown.wishes.switches.iter().take(flown.switches);
    let each: Vec<String> =
        each.map(|switch| format!("{} at {:.0} s", switch.w_data, switch.after.as_secs_f32())).collect();
    let missed = flown.wishes.switches.len() - flown.switches;
    let missed = if missed > 0 { format!(" ({missed} after the end)") } else { String::new() };
    format!("switched to {}{missed}", each.join(", "))
}

fn ended(flown: &Flown, figures: &Figures) -> String {
    match flown.ending {
        _ if figures.landed => "landed on the terminal".into(),
        Ending::OnTheGround => format!("on the ground away from the terminal, pilot {}", flown.state.name()),
        Ending::TakenOver => format!("taken over, pilot {}", flown.state.name()),
        Ending::NeverEngaged => format!("never engaged, waiting for {}", flown.waiting_for),
        Ending::TimeUp => format!("time is up, pilot {}", flown.state.name()),
    }
}
