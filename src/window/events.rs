//! The window and what its user does with it.

use std::sync::Arc;
use std::time::Duration;

use egui::{Context, FullOutput, RawInput, ViewportId};
use egui_winit::State;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::platform::pump_events::{EventLoopExtPumpEvents, PumpStatus};
use winit::window::{Window, WindowId};

use crate::error::{Error, Result};

pub(crate) struct Events {
    event_loop: EventLoop<()>,
    seen: Seen,
}

/// What the system has said so far.
struct Seen {
    title: String,
    size: [u32; 2],
    window: Option<(Arc<Window>, State)>,
    failed: Option<String>,
    is_closed: bool,
    interface: Context,
}

fn no_window(reason: impl std::fmt::Display) -> Error {
    Error::NoWindow { reason: reason.to_string() }
}

impl Events {
    /// Opens a window with room for a picture of this size.
    pub(super) fn open(title: &str, size: [u32; 2], interface: &Context) -> Result<Events> {
        // winit's words name no remedy and span lines.
        let event_loop = EventLoop::new().map_err(|_| no_window("there is no display; log in on a desktop, or set DISPLAY"))?;
        let seen = Seen { title: title.to_owned(), size, window: None, failed: None, is_closed: false, interface: interface.clone() };
        let mut events = Events { event_loop, seen };
        while events.seen.window.is_none() {
            events.wait(Duration::from_millis(100));
            if let Some(reason) = events.seen.failed.take() {
                return Err(no_window(reason));
            }
        }
        Ok(events)
    }

    /// Takes what has happened, and waits for something at most so long.
    pub(super) fn wait(&mut self, most: Duration) {
        if let PumpStatus::Exit(_) = self.event_loop.pump_app_events(Some(most), &mut self.seen) {
            self.seen.is_closed = true;
        }
    }

    pub(super) fn is_closed(&self) -> bool {
        self.seen.is_closed
    }

    pub(super) fn window(&self) -> &Arc<Window> {
        &self.seen.window.as_ref().expect("the window was opened").0
    }

    /// What happened since the last call, for the user interface.
    pub(super) fn take_input(&mut self) -> RawInput {
        let (window, state) = self.seen.window.as_mut().expect("the window was opened");
        state.take_egui_input(window)
    }

    /// The same without what its user did, which waits for the next call of `take_input`.
    pub(super) fn look_at_input(&mut self) -> RawInput {
        let mut input = self.take_input();
        let (_, state) = self.seen.window.as_mut().expect("the window was opened");
        state.egui_input_mut().events = std::mem::take(&mut input.events);
        input
    }

    /// Does what the user interface asks of the system: pointers, the clipboard.
    pub(super) fn obey(&mut self, output: &mut FullOutput) {
        let (window, state) = self.seen.window.as_mut().expect("the window was opened");
        state.handle_platform_output(window, std::mem::take(&mut output.platform_output));
    }
}

impl ApplicationHandler for Seen {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_some() {
            return;
        }
        let [width, height] = self.size;
        let attributes = Window::default_attributes()
            .with_title(&self.title)
            .with_inner_size(PhysicalSize::new(width, height))
            .with_min_inner_size(PhysicalSize::new(160, 120));
        match event_loop.create_window(attributes) {
            Ok(window) => {
                let state = State::new(self.interface.clone(), ViewportId::ROOT, &window, Some(window.scale_factor() as f32), None, None);
                self.window = Some((Arc::new(window), state));
            }
            Err(error) => self.failed = Some(error.to_string()),
        }
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if let Some((window, state)) = &mut self.window {
            let _ = state.on_window_event(window, &event);
        }
        if matches!(event, WindowEvent::CloseRequested | WindowEvent::Destroyed) {
            self.is_closed = true;
        }
    }
}
