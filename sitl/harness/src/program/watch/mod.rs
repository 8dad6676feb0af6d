//! `fly --watch`: the flight in a terminal, some times as fast as the wall clock.

mod view;

use super::ProgramError;
use super::page;
use crate::{
    Computer, Ending, FlightError, FlightResult, FlightRun, FlightScript, MissionSetup, Pace, Simulation,
};
use gleaner_dashboard::Recording;
use gleaner_pilot::{Deliberator, Settings};
use gleaner_policy::Engine;
use ratatui::Terminal;
use ratatui::backend::TermionBackend;
use ratatui::termion::event::Key;
use ratatui::termion::input::{Keys, TermRead as _};
use ratatui::termion::raw::{IntoRawMode as _, RawTerminal};
use ratatui::termion::screen::{AlternateScreen, IntoAlternateScreen as _};
use ratatui::termion::{AsyncReader, async_stdin};
use std::io::{self, IsTerminal as _, Stdout};
use std::time::{Duration, Instant};

/// Time between two pictures.
const PICTURE_INTERVAL: Duration = Duration::from_millis(100);
/// Aircraft seconds per second of the wall clock: at first, and the limits.
const SPEED: f32 = 10.0;
const SPEEDS: std::ops::RangeInclusive<f32> = 1.0..=80.0;

/// Flies a mission and shows it. After `q` the rest of the flight is not shown. `explainer` is the same model once more,
/// for the attention.
pub(super) fn fly<P: Deliberator>(
    setup: MissionSetup,
    script: FlightScript,
    policy: P,
    explainer: Engine,
    title: String,
) -> Result<FlightResult, ProgramError> {
    if !io::stdout().is_terminal() {
        return Err(ProgramError::NoTerminal);
    }
    let settings = Settings::default();
    let computer = Computer::new(setup.mission.clone(), settings, policy, Ok(()));
    let mut computer = computer.map_err(FlightError::Onboard)?;
    let mut follower = Follower::new(page::recording(&setup, title, explainer));
    let mut flight = FlightRun::new(setup, script, settings.component_id).map_err(FlightError::from)?;
    let mut screen = Some(Screen::open().map_err(ProgramError::Stdout)?);
    let mut pace = Pace::new(SPEED);
    loop {
        let steps = if screen.is_some() { pace.due() } else { u32::MAX };
        if let Some(ending) = (0..steps).find_map(|_| flight.step(&mut computer)) {
            follower.follow(flight.simulation());
            if let Some(mut screen) = screen {
                screen.show_end(&follower, ending).map_err(ProgramError::Stdout)?;
            }
            return Ok(flight.end(ending, computer.state()));
        }
        let Some(shown) = &mut screen else { continue };
        follower.follow(flight.simulation());
        match shown.turn(&follower).map_err(ProgramError::Stdout)? {
            Wish::None => {}
            Wish::Speed(speed) => pace = Pace::new(speed),
            Wish::Quit => screen = None,
        }
        std::thread::sleep(pace.rest());
    }
}

/// Reads what is new in the journal.
struct Follower {
    recording: Recording<Engine>,
    frames: usize,
    slots: usize,
}

impl Follower {
    const fn new(recording: Recording<Engine>) -> Follower {
        Follower { recording, frames: 0, slots: 0 }
    }

    fn follow(&mut self, simulation: &Simulation) {
        let (journal, setup) = (simulation.journal(), simulation.setup());
        let slots = journal.slots().get(self.slots..).unwrap_or_default();
        let decisions: Vec<_> = slots.iter().filter_map(|slot| slot.logged(setup)).collect();
        self.slots += slots.len();
        let mut frames = 0;
        let new = journal.frames().skip(self.frames).inspect(|_| frames += 1);
        self.recording.replay(&decisions, new.map(|(at, frame)| (page::seconds(at), frame)));
        self.frames += frames;
    }
}

/// What a key requests.
enum Wish {
    None,
    Speed(f32),
    Quit,
}

/// The terminal in raw mode; it becomes what it was when this is dropped.
struct Screen {
    terminal: Terminal<TermionBackend<AlternateScreen<RawTerminal<Stdout>>>>,
    keys: Keys<AsyncReader>,
    next_picture: Instant,
    speed: f32,
}

impl Screen {
    fn open() -> io::Result<Screen> {
        let out = io::stdout().into_raw_mode()?.into_alternate_screen()?;
        let terminal = Terminal::new(TermionBackend::new(out))?;
        Ok(Screen { terminal, keys: async_stdin().keys(), next_picture: Instant::now(), speed: SPEED })
    }

    /// Draws when a picture is due, and reads the keys.
    fn turn(&mut self, follower: &Follower) -> io::Result<Wish> {
        let now = Instant::now();
        if now >= self.next_picture {
            self.next_picture = now + PICTURE_INTERVAL;
            let keys = format!(" {} x real time; + faster, - slower, q results ", self.speed);
            self.draw(follower, &keys)?;
        }
        Ok(match self.key() {
            Some(Key::Char('q') | Key::Esc | Key::Ctrl('c')) => Wish::Quit,
            Some(Key::Char('+')) => self.change_speed(2.0),
            Some(Key::Char('-')) => self.change_speed(0.5),
            _ => Wish::None,
        })
    }

    /// Shows the last picture until a key is pressed.
    fn show_end(&mut self, follower: &Follower, ending: Ending) -> io::Result<()> {
        while self.key().is_some() {}
        let words = match ending {
            Ending::OnTheGround => " on the ground; any key: results ",
            _ => " the flight is over; any key: results ",
        };
        loop {
            self.draw(follower, words)?;
            if self.key().is_some() {
                return Ok(());
            }
            std::thread::sleep(PICTURE_INTERVAL);
        }
    }

    fn draw(&mut self, follower: &Follower, keys: &str) -> io::Result<()> {
        self.terminal.draw(|frame| view::draw(frame, follower.recording.flight(), keys)).map(|_| ())
    }

    fn key(&mut self) -> Option<Key> {
        self.keys.next()?.ok()
    }

    fn change_speed(&mut self, factor: f32) -> Wish {
        self.speed = (self.speed * factor).clamp(*SPEEDS.start(), *SPEEDS.end());
        Wish::Speed(self.speed)
    }
}
