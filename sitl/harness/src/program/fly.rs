//! `fly`: one mission, in virtual time with the pilot in this process, in the wall's time with one behind ports.

use super::arguments::{BoardOrder, FlyOrder};
use super::introduction::{ports, write_mission};
use super::results::Brain;
use super::{ProgramError, model, results};
use crate::{Ending, Figures, Flight, FlightError, Flown, Staged, Wired, Wishes, fly_wired};
use gleaner_pilot::Settings;
use gleaner_ports::{Endpoint, Port};
use gleaner_world::World;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a board may take to connect.
const CONNECT_LIMIT: Duration = Duration::from_secs(120);

pub(super) fn fly(order: &FlyOrder) -> Result<bool, ProgramError> {
    let begun = Instant::now();
    let world = Arc::new(World::default_world());
    let staged = Staged::new(world, order.plan).map_err(FlightError::from)?;
    if let Some(path) = &order.mission_out {
        write_mission(&staged, path)?;
    }
    let wishes = Wishes { switches: order.switches.clone(), ..Wishes::plain(order.preference) };
    let (flown, brain) = match &order.board {
        None => {
            let policy = model::load(order.model.as_deref(), order.engine)?;
            let brain = model::brain(&policy);
            (crate::fly(staged, wishes, policy, Ok(()))?, brain)
        }
        Some(board) => (fly_board(order, board, staged, wishes)?, Brain::of("board")),
    };
    let figures = flown.figures();
    let picture = results::write_files(&order.out, &flown.simulation, &figures, &brain)?;
    let wall_s = begun.elapsed().as_secs_f64();
    if order.json {
        println!("{}", results::json(&figures, &brain, wall_s));
    } else {
        let mut lines = results::summary(&flown.simulation, &figures, &brain);
        lines.push(("preference", switches(&flown)));
        lines.push(("ended", ended(&flown, &figures)));
        results::print(&lines, &figures, wall_s, &picture);
    }
    Ok(figures.is_good())
}

/// Waits for the board, then flies with it.
fn fly_board(
    order: &FlyOrder,
    board: &BoardOrder,
    staged: Staged,
    wishes: Wishes,
) -> Result<Flown, ProgramError> {
    let open = |endpoint: &Endpoint| Port::open(endpoint).map_err(ProgramError::Port);
    let mut wired = Wired::new(open(&board.autopilot)?, board.radio.as_ref().map(open).transpose()?);
    let roles = [("autopilot", Some(wired.autopilot())), ("radio", wired.radio())];
    ports(&roles, None, order.mission_out.as_deref())?;
    let begun = Instant::now();
    while !wired.await_peer(Duration::from_millis(100)).map_err(ProgramError::Wait)? {
        if begun.elapsed() > CONNECT_LIMIT {
            return Err(ProgramError::NobodyConnects(CONNECT_LIMIT.as_secs()));
        }
        wired.maintain(Instant::now());
    }
    let flight = Flight::new(staged, wishes, Settings::default().component_id).map_err(FlightError::from)?;
    Ok(fly_wired(flight, &mut wired, |_, _| None))
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
    let pilot = flown.state.map_or(String::new(), |state| format!(", pilot {}", state.name()));
    match flown.ending {
        _ if figures.landed => "landed on the terminal".into(),
        Ending::OnTheGround => format!("on the ground away from the terminal{pilot}"),
        Ending::TakenOver => format!("taken over{pilot}"),
        Ending::NeverEngaged => format!("never engaged, waiting for {}", flown.waiting_for),
        Ending::TimeUp => format!("time is up{pilot}"),
        Ending::PilotGone => "the board closed its port".into(),
    }
}
