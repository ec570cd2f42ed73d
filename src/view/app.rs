//! The window: events in, frames out.

mod open;

use std::path::PathBuf;
use std::time::Duration;

use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::WindowId;

use super::{Source, ViewError};
use crate::bake::Job;
use crate::gpu::GpuOptions;
use open::{Next, Open};

/// Between two looks at the scene's file.
const FILE_WATCH: Duration = Duration::from_secs(1);

/// What the window is to show.
pub struct WindowOptions {
    /// The scene.
    pub scene: Source,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Time for updates per frame; none: as pictures take.
    pub slice: Option<Duration>,
    /// How to bake.
    pub job: Job,
    /// The device.
    pub gpu: GpuOptions,
    /// Where saved files go.
    pub folder: PathBuf,
    /// What the light is held against.
    pub reference: Option<PathBuf>,
    /// Where the times of frames go at the end.
    pub stats: Option<PathBuf>,
}

/// Opens a window on a scene and returns when it is closed.
///
/// # Errors
/// No display, no device, a scene that cannot be loaded, a bake that fails.
pub fn run_window(options: WindowOptions) -> Result<(), ViewError> {
    let event_loop = EventLoop::<()>::with_user_event()
        .build()
        .map_err(|e| ViewError::Window(e.to_string()))?;
    let mut app = App {
        proxy: event_loop.create_proxy(),
        options,
        open: None,
        failed: None,
    };
    let ran = event_loop.run_app(&mut app);
    // Before the event loop, whose display it draws to.
    let open = app.open.take();
    let closed = open.map_or(Ok(()), |open| open.close(&app.options));
    ran.map_err(|e| ViewError::Window(e.to_string()))?;
    match app.failed {
        Some(error) => Err(error),
        None => closed,
    }
}

struct App {
    proxy: EventLoopProxy<()>,
    options: WindowOptions,
    open: Option<Open>,
    failed: Option<ViewError>,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.open.is_none() {
            match Open::new(event_loop, &self.options, &self.proxy) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.fail(event_loop, error),
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, (): ()) {
        if let Some(open) = &mut self.open {
            open.dirty = true;
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match &event {
            WindowEvent::CloseRequested => {
                open.window.set_visible(false);
                event_loop.exit();
                return;
            }
            WindowEvent::Destroyed => {
                event_loop.exit();
                return;
            }
            WindowEvent::Resized(size) => open.frames.resize([size.width, size.height]),
            WindowEvent::RedrawRequested => {
                match open.frame(&self.options) {
                    Ok(true) => {}
                    Ok(false) => {
                        open.window.set_visible(false);
                        event_loop.exit();
                    }
                    Err(error) => self.fail(event_loop, error),
                }
                return;
            }
            _ => {}
        }
        open.asked |= open.frames.take_event(&open.window, &event);
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        match open.next_frame(&self.options) {
            Ok(Next::Now) => {
                open.window.request_redraw();
                event_loop.set_control_flow(ControlFlow::Wait);
            }
            Ok(Next::At(when)) => event_loop.set_control_flow(ControlFlow::WaitUntil(when)),
            Err(error) => self.fail(event_loop, error),
        }
    }
}

impl App {
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewError) {
        self.failed = Some(error);
        event_loop.exit();
    }
}
