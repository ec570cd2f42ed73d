//! Frames of a window: the picture, the panels on it, and what is measured on the way.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::ViewportId;
use tracing::debug_span;
use winit::event::WindowEvent;
use winit::window::Window;

use super::display::Display;
use super::input::after_click;
use super::look::Look;
use super::pace::{Pace, Photon};
use super::painter::Painter;
use super::picture_file::write_picture;
use super::shot::Shot;
use super::shown::Shown;
use super::state::Viewer;
use super::worker::{Status, Worker};
use super::{Note, ViewError};
use crate::gpu::{Format, Gpu, Image, Stage, Swapchain, Ticket};
use crate::transport::SceneBvh;

/// Draws frames into a window.
pub(super) struct Frames {
    gpu: Gpu,
    egui: egui::Context,
    events: egui_winit::State,
    display: Display,
    painter: Painter,
    swapchain: Swapchain,
    /// Changes of panel textures that no frame has taken in yet.
    textures: egui::TexturesDelta,
    /// Input for the next frame.
    later: Vec<egui::Event>,
    /// The window's, pixels.
    size: [u32; 2],
    start: Instant,
    last: Instant,
    passes_at: Instant,
    passes_before: Vec<crate::gpu::Timing>,
    screenshots: u32,
    /// Of pictures, lately: of those at rest, and of those while something moves.
    device_time: [Duration; 2],
    /// The last picture, and whether something moved.
    picture: Option<(Ticket, bool)>,
    pace: Pace,
    /// How coarse the last frame was.
    coarse: u32,
    /// What has been drawn coarsely: drivers compile what is drawn for the first time.
    warm: BTreeSet<Look>,
    /// When something moved last.
    moved: Option<Instant>,
}

/// What a frame came to.
pub(super) struct Drawn {
    pub live: bool,
    pub quit: bool,
    /// There was something to draw into.
    pub shown: bool,
    /// The panels want another frame by then.
    pub again: Option<Duration>,
    /// What has moved is drawn finely then, unless it moves again.
    pub fine: Option<Duration>,
}

/// What has moved may be about to move again: it stays coarse for so long.
const REST: Duration = Duration::from_millis(150);

impl Frames {
    pub(super) fn new(gpu: &Gpu, window: &Arc<Window>, size: [u32; 2]) -> Result<Self, ViewError> {
        let swapchain = gpu.swapchain(Arc::clone(window), size)?;
        let egui = egui::Context::default();
        let events = egui_winit::State::new(
            egui.clone(),
            ViewportId::ROOT,
            window,
            Some(window.scale_factor() as f32),
            None,
            None,
        );
        let now = Instant::now();
        Ok(Self {
            display: Display::new(gpu)?,
            painter: Painter::new(gpu, swapchain.format())?,
            gpu: gpu.clone(),
            swapchain,
            egui,
            events,
            textures: egui::TexturesDelta::default(),
            later: Vec::new(),
            size,
            start: now,
            last: now,
            passes_at: now,
            passes_before: Vec::new(),
            screenshots: 0,
            device_time: [Duration::ZERO; 2],
            picture: None,
            pace: Pace::default(),
            coarse: 1,
            warm: BTreeSet::new(),
            moved: None,
        })
    }

    pub(super) fn resize(&mut self, size: [u32; 2]) {
        self.size = size;
        self.swapchain.resize(size);
    }

    /// Whether the last frame has been seen: only then the next one begins, so that it answers to all that came before.
    pub(super) fn is_seen(&mut self) -> Result<bool, ViewError> {
        let seen = self.swapchain.finished()?;
        self.pace.seen(seen);
        Ok(seen == self.swapchain.sent())
    }

    /// Whether input is on its way into the picture.
    pub(super) fn answers(&self) -> bool {
        self.pace.waits()
    }

    /// How soon frames answer to input.
    pub(super) fn photon(&self) -> Photon {
        self.pace.photon()
    }

    /// Whether the event asks for a frame.
    pub(super) fn take_event(&mut self, window: &Window, event: &WindowEvent) -> bool {
        let kind = input(event);
        let input = kind.is_some();
        let _span = kind.map(|kind| debug_span!("input", name = kind).entered());
        if let (true, Ok(seen)) = (input, self.swapchain.finished()) {
            self.pace.event(seen);
        }
        self.events.on_window_event(window, event).repaint
            || matches!(event, WindowEvent::Resized(_))
    }

    /// Seconds since the window was opened, as notes count them.
    pub(super) fn now(&self) -> f64 {
        self.egui.input(|i| i.time)
    }

    /// Device time of a frame at rest, lately.
    pub(super) fn device_time(&self) -> Duration {
        self.device_time[0]
    }

    pub(super) fn show(&mut self, shown: &Arc<Shown>) -> Result<(), ViewError> {
        Ok(self.display.show(shown)?)
    }

    pub(super) fn draw(
        &mut self,
        window: &Window,
        viewer: &mut Viewer,
        shown: &Arc<Shown>,
        bvh: Option<&SceneBvh>,
        status: &Status,
        worker: &Worker,
    ) -> Result<Drawn, ViewError> {
        let _span = debug_span!("frame", number = self.swapchain.sent() + 1).entered();
        let input = self.take_input(window);
        self.pace.taken_in(self.swapchain.sent() + 1);
        self.measured(viewer)?;
        let outcome =
            debug_span!("panels").in_scope(|| viewer.frame(&self.egui, input, shown, bvh, status));
        // The bake takes in what is asked for while the frame is drawn.
        for request in outcome.requests {
            worker.send(request);
        }
        worker.set_live(outcome.live);
        let output = outcome.output;
        self.events
            .handle_platform_output(window, output.platform_output);
        self.textures.append(output.textures_delta);
        let again = output
            .viewport_output
            .get(&ViewportId::ROOT)
            .map(|v| v.repaint_delay)
            .filter(|d| *d < Duration::from_secs(3600));
        let again = match self.later.is_empty() {
            true => again,
            false => Some(Duration::ZERO),
        };
        let mut drawn = Drawn {
            live: outcome.live,
            quit: outcome.quit,
            shown: false,
            again,
            fine: None,
        };
        let acquired = debug_span!("acquire").in_scope(|| self.swapchain.acquire())?;
        let Some(frame) = acquired else {
            return Ok(drawn);
        };
        let recording = debug_span!("record").entered();
        let primitives = self.egui.tessellate(output.shapes, output.pixels_per_point);
        let timings = self.gpu.timings();
        if outcome.live {
            self.moved = Some(Instant::now());
        }
        let rest = self.moved.map(|m| REST.saturating_sub(m.elapsed()));
        let rest = rest.filter(|rest| !rest.is_zero() && !outcome.screenshot);
        self.coarse = self.pace.coarse(rest.is_some(), self.coarse, &timings);
        drawn.fine = rest.filter(|_| self.coarse > 1 && !outcome.live);
        let shot = Shot {
            coarse: self.coarse,
            pose: viewer.pose,
            look: viewer.look_of(shown, status),
            scale: viewer.scale_of(viewer.look, shown),
            page: viewer.page,
        };
        let marks = viewer.sketch.as_ref().map(|s| Arc::clone(&s.marks));
        self.display.mark(marks);
        self.display.exposure = viewer.exposure;
        let mut cmd = self.gpu.commands()?;
        self.swapchain.begin(&mut cmd, &frame);
        let target = self.swapchain.image(&frame);
        if self.pace.is_slow() && self.warm.insert(shot.look) && !outcome.live {
            // Not when something begins to move.
            let coarse = Shot { coarse: 2, ..shot };
            self.display.record(&mut cmd, target, &coarse)?;
        }
        self.display.record(&mut cmd, target, &shot)?;
        let measures = match (shot.look, outcome.probe) {
            (look, _) if look.is_metered() => self.display.measure(&mut cmd),
            (look @ (Look::Lux | Look::Error), Some(at)) => self.display.probe(&mut cmd, look, at),
            _ => false,
        };
        let textures = std::mem::take(&mut self.textures);
        self.painter.record(
            &mut cmd,
            target,
            &textures,
            &primitives,
            output.pixels_per_point,
        )?;
        cmd.barrier(Stage::All, Stage::All);
        let buffer = outcome
            .screenshot
            .then(|| picture_buffer(&self.gpu, target));
        let buffer = buffer.transpose()?;
        let size = target.size();
        if let Some(buffer) = &buffer {
            cmd.copy_from_image(target, buffer, 0);
            cmd.barrier(Stage::Transfer, Stage::Host);
        }
        drop(recording);
        let (camera, took) = (viewer.pose.camera(), self.device_time[1]);
        let sent = || worker.frame_sent(camera, took);
        let ticket =
            debug_span!("present").in_scope(|| self.swapchain.present(cmd, frame, sent))?;
        if let Some(buffer) = buffer {
            ticket.wait()?;
            let note = self.screenshot(viewer, size, buffer.mapped(0..buffer.size() as usize));
            viewer.note(self.now(), note);
        }
        if measures {
            self.display.measured_by(ticket.clone());
        }
        self.picture = Some((ticket, rest.is_some()));
        drawn.shown = true;
        Ok(drawn)
    }

    /// Takes in what earlier frames were measured to be.
    fn measured(&mut self, viewer: &mut Viewer) -> Result<(), ViewError> {
        let seconds = self.last.elapsed().as_secs_f32();
        if let Some(mean) = self.display.take_measurement(false)? {
            self.last = Instant::now();
            viewer.exposure.follow(mean, seconds);
        }
        viewer.probe = self.display.probed();
        if let Some((ticket, moving)) = self.picture.take()
            && let Some(took) = ticket.device_time()
        {
            let lately = &mut self.device_time[usize::from(moving)];
            if lately.is_zero() {
                *lately = took;
            }
            // What is drawn for the first time is compiled first.
            *lately = (*lately * 3 + took.min(*lately * 2)) / 4;
        }
        let since = self.passes_at.elapsed().as_secs_f64();
        if since > 1.0 {
            self.passes_at = Instant::now();
            let timings = self.gpu.timings();
            let before = |name: &str| self.passes_before.iter().find(|t| t.name == name);
            viewer.passes = timings
                .iter()
                .map(|t| {
                    (
                        t.name,
                        (t.ms - before(t.name).map_or(0.0, |b| b.ms)) / since,
                    )
                })
                .filter(|(_, ms)| *ms > 0.005)
                .collect();
            self.passes_before = timings;
        }
        Ok(())
    }

    /// What `State::take_egui_input` does, with the size that events told: asking a window that was destroyed since would panic.
    fn take_input(&mut self, window: &Window) -> egui::RawInput {
        let scale = window.scale_factor() as f32;
        let size = egui::Vec2::from(self.size.map(|n| n as f32));
        let points = size / (scale * self.egui.zoom_factor());
        let input = self.events.egui_input_mut();
        input.time = Some(self.start.elapsed().as_secs_f64());
        input.screen_rect =
            (points.min_elem() > 0.0).then(|| egui::Rect::from_min_size(egui::Pos2::ZERO, points));
        let mut events = std::mem::take(&mut self.later);
        events.append(&mut input.events);
        self.later = after_click(&mut events);
        input.events = events;
        input.viewport_id = ViewportId::ROOT;
        let viewport = input.viewports.entry(ViewportId::ROOT).or_default();
        viewport.native_pixels_per_point = Some(scale);
        input.take()
    }

    fn screenshot(&mut self, viewer: &Viewer, size: [u32; 2], mut pixels: Vec<u8>) -> Note {
        if self.swapchain.format() == Format::Bgra8 {
            pixels.chunks_exact_mut(4).for_each(|p| p.swap(0, 2));
        }
        let base = &viewer.files.screenshot;
        let stem = base
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let path: PathBuf = loop {
            self.screenshots += 1;
            let path = base.with_file_name(format!("{stem}-{:03}.png", self.screenshots));
            if !path.exists() {
                break path;
            }
        };
        match write_picture(&path, size, &pixels) {
            Ok(()) => Note::said(format!("saved {}", path.display())),
            Err(error) => Note::failed(error.to_string()),
        }
    }
}

impl Drop for Frames {
    fn drop(&mut self) {
        tracing::debug!("{:.1} s of frames", self.start.elapsed().as_secs_f64());
    }
}

/// What kind of input an event is, if it is any.
fn input(event: &WindowEvent) -> Option<&'static str> {
    match event {
        WindowEvent::KeyboardInput { .. } => Some("key"),
        WindowEvent::MouseInput { .. } => Some("button"),
        WindowEvent::MouseWheel { .. } => Some("wheel"),
        WindowEvent::CursorMoved { .. } => Some("cursor"),
        _ => None,
    }
}

fn picture_buffer(gpu: &Gpu, image: &Image) -> crate::gpu::Result<crate::gpu::Buffer> {
    let [width, height] = image.size();
    let bytes = u64::from(width) * u64::from(height) * image.format().bytes();
    gpu.buffer("screenshot", bytes, crate::gpu::Memory::Readback)
}
