//! The events of a window, and the program that they run.

use anyhow::Context;
use winit::event_loop::{ControlFlow, EventLoop};

use super::app::App;

/// Opens the source of events.
///
/// # Errors
///
/// If the system opens no windows.
pub(super) fn open_events() -> anyhow::Result<EventLoop<()>> {
    EventLoop::new().context("no window can be opened here; `enfilade render` draws without one")
}

/// Runs the program in the window until it is closed.
pub(super) fn run_app(events: EventLoop<()>, mut app: App<'_>) -> anyhow::Result<()> {
    events.set_control_flow(ControlFlow::Poll);
    events.run_app(&mut app)?;
    match app.failed {
        Some(why) => Err(why),
        None => Ok(()),
    }
}
