//! A view in the terminal, until a key says that it is enough.

use std::io::{self, IsTerminal};
use std::time::Duration;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};

use crate::Failure;
use rigident::application::monitor::GrowingView;
use rigident::present::monitor::View;
use rigident::present::monitor::draw::{Look, draw, height};

/// A picture that nobody asked the size of.
const PRINTED: u16 = 100;
/// Of a person's parameters there are 150.
const MOST_ROWS: u16 = 200;
/// The view is drawn this often, and keys are heard between.
const DRAW_EVERY: Duration = Duration::from_millis(200);

/// Refuses where nothing can be drawn, or no key be heard.
///
/// # Errors
/// Bad usage.
pub(crate) fn check() -> Result<(), Failure> {
    if io::stdin().is_terminal() && io::stdout().is_terminal() {
        return Ok(());
    }
    Err(Failure::input(
        "there is no terminal to draw in: --once prints a picture as text, --json one object after the other",
    ))
}

/// Draws until q, Ctrl-C or a signal. The terminal is left as it was, also after a panic. `each` gets every
/// view that is drawn.
///
/// # Errors
/// The terminal is gone.
pub(crate) fn show(watch: &GrowingView, each: &mut dyn FnMut(&View)) -> Result<(), Failure> {
    let gone = |error: io::Error| Failure::input(format!("the terminal cannot be drawn in: {error}"));
    // Its hook puts the terminal back before a panic says what it is.
    let mut terminal = ratatui::try_init().map_err(gone)?;
    let shown = (|| {
        let mut look = Look { colour: colour(), chosen: 0 };
        while !watch.is_left() {
            let view = watch.view();
            each(&view);
            terminal.draw(|frame| draw(frame, &view, look))?;
            let parameters = view.answer.map_or(0, |answer| answer.parameters.len());
            let event = if event::poll(DRAW_EVERY)? { Some(event::read()?) } else { None };
            // What is not a key has changed the window, and is drawn.
            let Some(Event::Key(key)) = event else { continue };
            let ctrl = key.modifiers.contains(KeyModifiers::CONTROL);
            match key.code {
                _ if key.kind == KeyEventKind::Release => {}
                KeyCode::Char('q') | KeyCode::Esc => break,
                KeyCode::Char('c') if ctrl => break,
                KeyCode::Down | KeyCode::Char('j') => {
                    look.chosen = (look.chosen + 1).min(parameters.saturating_sub(1));
                }
                KeyCode::Up | KeyCode::Char('k') => look.chosen = look.chosen.saturating_sub(1),
                _ => {}
            }
        }
        Ok(())
    })();
    ratatui::restore();
    shown.map_err(gone)
}

/// Returns whether colours may be used: see no-color.org.
fn colour() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|said| said.is_empty())
}

/// Returns a view as text, in the terminal's width or 100 columns.
///
/// # Errors
/// Never, as far as is known: what is drawn in is in memory.
pub(crate) fn text(view: &View) -> Result<String, Failure> {
    let width =
        ratatui::crossterm::terminal::size().ok().filter(|_| io::stdout().is_terminal()).map(|size| size.0);
    let width = width.unwrap_or(PRINTED);
    // Rows beyond these would be for a chart, or empty.
    let height = height(view, width).min(MOST_ROWS);
    let wrong =
        |error: &dyn std::fmt::Display| Failure::input(format!("the picture cannot be drawn: {error}"));
    let mut terminal = Terminal::new(TestBackend::new(width, height)).map_err(|e| wrong(&e))?;
    terminal.draw(|frame| draw(frame, view, Look::default())).map_err(|e| wrong(&e))?;
    let buffer = terminal.backend().buffer();
    let line = |y: u16| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>().trim_end().to_owned();
    // The last line is of keys.
    Ok((0..height - 1).map(line).collect::<Vec<_>>().join("\n"))
}
