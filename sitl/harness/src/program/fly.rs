//! `fly`: one mission, in virtual time with the pilot in this process, on the wall clock with one behind ports.

use super::announce::{ports, write_mission};
use super::arguments::{BoardOrder, FlyOrder};
use super::results::PolicyInfo;
use super::{ProgramError, load, model, page, results, watch};
use crate::{
    Ending, Figures, FlightError, FlightResult, FlightRun, FlightScript, MissionSetup, Wired, fly_wired,
};
use gleaner_pilot::{Budget, Deliberator, LookingAhead, Settings};
use gleaner_ports::{Endpoint, Port};
use std::time::{Duration, Instant};

/// How long a board may take to connect.
const CONNECT_LIMIT: Duration = Duration::from_secs(120);

pub(super) fn fly(order: &FlyOrder) -> Result<bool, ProgramError> {
    let begun = Instant::now();
    let setup = load::setup(&order.mission)?;
    if let Some(path) = &order.mission_out {
        write_mission(&setup, path)?;
    }
    let script = FlightScript { switches: order.switches.clone(), ..FlightScript::plain(order.preference) };
    let (flown, policy_info) = match &order.board {
        None => {
            let policy = model::load(order.model.as_deref(), order.engine)?;
            let policy_info = model::info(&policy);
            let flown = match order.lookahead {
                true => {
                    let policy = LookingAhead::new(policy, Budget::LINUX);
                    fly_inside(order, setup, script, policy, &policy_info)
                }
                false => fly_inside(order, setup, script, policy, &policy_info),
            };
            (flown?, policy_info)
        }
        Some(board) => (fly_board(order, board, setup, script)?, PolicyInfo::outside("board")),
    };
    let figures = flown.figures();
    let picture = results::write_files(&order.out, &flown.simulation, &figures, &policy_info.model)?;
    if let Some(path) = &order.html {
        // A board flies its own copy of the model; decisions of another model stay unexplained.
        let policy = model::load(order.model.as_deref(), order.engine)?;
        page::write(path, &flown.simulation, page::title(flown.simulation.setup(), &policy_info), policy)?;
    }
    let wall_s = begun.elapsed().as_secs_f64();
    if order.json {
        println!("{}", results::json(&figures, &policy_info, wall_s));
    } else {
        let mut lines = results::summary(&flown.simulation, &figures, &policy_info);
        lines.push(("preference", switches(&flown)));
        lines.push(("ended", ended(&flown, &figures)));
        results::print(&lines, &figures, wall_s, &picture);
    }
    Ok(figures.is_good())
}

/// Flies with the pilot in this process.
fn fly_inside<P: Deliberator>(
    order: &FlyOrder,
    setup: MissionSetup,
    script: FlightScript,
    policy: P,
    policy_info: &PolicyInfo,
) -> Result<FlightResult, ProgramError> {
    if !order.watch {
        return Ok(crate::fly(setup, script, policy, Ok(()))?);
    }
    let explainer = model::load(order.model.as_deref(), order.engine)?;
    let title = page::title(&setup, policy_info);
    watch::fly(setup, script, policy, explainer, title)
}

/// Waits for the board, then flies with it.
fn fly_board(
    order: &FlyOrder,
    board: &BoardOrder,
    setup: MissionSetup,
    script: FlightScript,
) -> Result<FlightResult, ProgramError> {
    let open = |endpoint: &Endpoint| Port::open(endpoint).map_err(ProgramError::Port);
    let mut wired = Wired::new(open(&board.autopilot)?, board.radio.as_ref().map(open).transpose()?);
    let roles = [("autopilot", Some(wired.autopilot())), ("radio", wired.radio())];
    ports(&roles, None, order.mission_out.as_deref(), &[])?;
    let begun = Instant::now();
    while !wired.await_peer(Duration::from_millis(100)).map_err(ProgramError::Wait)? {
        if begun.elapsed() > CONNECT_LIMIT {
            return Err(ProgramError::NoBoard(CONNECT_LIMIT.as_secs()));
        }
        wired.maintain(Instant::now());
    }
    let flight =
        FlightRun::new(setup, script, Settings::default().component_id).map_err(FlightError::from)?;
    Ok(fly_wired(flight, &mut wired, |_, _| None))
}

fn switches(flown: &FlightResult) -> String {
    if flown.script.switches.is_empty() {
        return "not switched".into();
    }
    let each = flown.script.switches.iter().take(flown.switches);
    let each: Vec<String> =
        each.map(|switch| format!("{} at {:.0} s", switch.w_data, switch.after.as_secs_f32())).collect();
    let missed = flown.script.switches.len() - flown.switches;
    let missed = if missed > 0 { format!(" ({missed} after the end)") } else { String::new() };
    format!("switched to {}{missed}", each.join(", "))
}

fn ended(flown: &FlightResult, figures: &Figures) -> String {
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
