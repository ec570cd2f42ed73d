//! An open window: from the scene's file to its first frame, frame by frame, and to its end.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

use super::super::ViewError;
use super::super::frames::Frames;
use super::super::pace::{Moving, POLL};
use super::super::reference::{self, Reference};
use super::super::resolve::Pages;
use super::super::shown::Shown;
use super::super::state::{Files, Viewer};
use super::super::textures::Samplers;
use super::super::worker::{Request, Setup, Status, Worker};
use super::{FILE_WATCH, WindowOptions};
use crate::gpu::Gpu;
use crate::transport::SceneBvh;

/// While nothing moves, frames take this share of the time at most: the rest is the bake's.
const IDLE_SHARE: u32 = 8;
/// While nothing moves, frames follow each other no faster.
const IDLE_PAUSE: Duration = Duration::from_millis(33);
/// Nor slower, if there is something new.
const IDLE_LONGEST: Duration = Duration::from_secs(1);

/// When a frame is due.
pub(super) enum Next {
    /// Now.
    Now,
    /// None before then.
    At(Instant),
}

/// Everything that an open window has. Fields are dropped in this order.
pub(super) struct Open {
    worker: Worker,
    pub(super) frames: Frames,
    viewer: Viewer,
    shown: Arc<Shown>,
    bvh: Option<SceneBvh>,
    status: Status,
    gpu: Gpu,
    pub(super) window: Arc<Window>,
    /// When the last frame was begun, and what it took.
    pub(super) last: Instant,
    pub(super) cost: Duration,
    live: bool,
    begun: Instant,
    moving: Moving,
    /// From the start to the end of the first frame.
    first_picture: Option<Duration>,
    drawn: bool,
    /// Something is new that has not been drawn.
    pub(super) dirty: bool,
    /// Input asks for a frame.
    pub(super) asked: bool,
    watched: (Instant, Option<SystemTime>),
    pub(super) egui_wants: Option<Instant>,
    /// When what has moved is to be drawn finely.
    fine: Option<Instant>,
}

impl Open {
    pub(super) fn new(
        event_loop: &ActiveEventLoop,
        options: &WindowOptions,
        proxy: &EventLoopProxy<()>,
    ) -> Result<Self, ViewError> {
        let begun = Instant::now();
        let [width, height] = options.size;
        let attributes = Window::default_attributes()
            .with_title("rebake viewer")
            .with_min_inner_size(LogicalSize::new(320, 240))
            .with_inner_size(PhysicalSize::new(width, height));
        let window = event_loop
            .create_window(attributes)
            .map_err(|e| ViewError::Window(e.to_string()))?;
        let window = Arc::new(window);
        // The driver starts while the file is read.
        let (source, reference) = (options.scene.clone(), options.reference.clone());
        let mut job = options.job.clone();
        let load = std::thread::spawn(move || -> Result<_, ViewError> {
            let (scene, document) = source.load()?;
            let reference = match &reference {
                Some(folder) => {
                    reference::adopt(&mut job, folder, &source.path, &scene)?;
                    Some(Arc::new(Reference::load(folder)?))
                }
                None => None,
            };
            Ok((scene, document, job, reference))
        });
        let gpu = Gpu::for_window(&options.gpu, &window)?;
        let size = window.inner_size();
        let mut frames = Frames::new(&gpu, &window, [size.width, size.height])?;
        let (scene, document, job, reference) = load
            .join()
            .map_err(|_| ViewError::Ended("reading the scene's file panicked".into()))??;
        let samplers = Samplers::new(&gpu)?;
        let nothing = Pages::new(&gpu, None)?.view();
        let shown = Arc::new(Shown::new(
            &samplers,
            &Arc::new(scene.clone()),
            &document,
            None,
            &nothing,
            None,
        )?);
        frames.show(&shown)?;
        let files = Files::new(options.scene.path.clone(), options.folder.clone());
        let mut viewer = Viewer::new(&shown, files);
        viewer.has_reference = reference.is_some();
        let setup = Setup {
            gpu: gpu.clone(),
            samplers,
            scene,
            document,
            job,
            reference,
            source: options.scene.clone(),
            folder: options
                .scene
                .path
                .parent()
                .map_or_else(PathBuf::new, PathBuf::from),
            slice: options.slice,
        };
        let proxy = proxy.clone();
        let worker = Worker::start(setup, Arc::clone(&shown), move || {
            // An event loop that is over needs no waking.
            let _gone = proxy.send_event(());
        });
        window.request_redraw();
        Ok(Self {
            worker,
            frames,
            viewer,
            shown,
            bvh: None,
            status: Status::default(),
            gpu,
            window,
            begun,
            moving: Moving::default(),
            first_picture: None,
            drawn: false,
            last: Instant::now(),
            cost: Duration::ZERO,
            live: false,
            dirty: true,
            asked: true,
            watched: (Instant::now(), modified(&options.scene.path)),
            egui_wants: None,
            fine: None,
        })
    }

    /// When the next frame is due. None begins before the last one has been seen: it answers to all input until then.
    pub(super) fn next_frame(&mut self, options: &WindowOptions) -> Result<Next, ViewError> {
        let now = Instant::now();
        let seen = self.frames.is_seen()?;
        if seen && self.drawn && self.first_picture.is_none() {
            let time = self.begun.elapsed();
            tracing::info!(seconds = time.as_secs_f64(), "first picture");
            self.first_picture = Some(time);
        }
        let mut wake = now + FILE_WATCH;
        if let Some(wanted) = self.egui_wants {
            wake = wake.min(wanted);
            self.dirty |= wanted <= now;
        }
        if let Some(fine) = self.fine {
            wake = wake.min(fine);
            self.asked |= fine <= now;
        }
        let due = self.last + (self.cost * IDLE_SHARE).clamp(IDLE_PAUSE, IDLE_LONGEST);
        if self.live || self.asked || (self.dirty && due <= now) {
            if seen {
                return Ok(Next::Now);
            }
            wake = now + POLL;
        } else if self.dirty {
            wake = wake.min(due);
        }
        if self.frames.answers() {
            wake = wake.min(now + POLL);
        }
        self.watch(options);
        Ok(Next::At(wake))
    }

    /// Draws a frame; whether the window stays open.
    pub(super) fn frame(&mut self, options: &WindowOptions) -> Result<bool, ViewError> {
        let begun = Instant::now();
        (self.asked, self.dirty) = (false, false);
        let news = self.worker.news();
        self.status = news.status;
        if let Some(error) = self.status.failed.take() {
            return Err(ViewError::Ended(error));
        }
        let now = self.frames.now();
        for note in news.notes {
            self.viewer.note(now, note);
        }
        if let Some((shown, bvh)) = news.shown {
            self.frames.show(&shown)?;
            self.shown = shown;
            self.bvh = bvh;
            self.viewer.scene_changed(&self.shown);
        }
        self.viewer.sketched(news.sketch);
        let drawn = self.frames.draw(
            &self.window,
            &mut self.viewer,
            &self.shown,
            self.bvh.as_ref(),
            &self.status,
            &self.worker,
        );
        let drawn = match drawn {
            // The window was destroyed while it was drawn: nobody is left to see anything.
            Err(ViewError::Gpu(error)) if error.is_surface_lost() => return Ok(false),
            drawn => drawn?,
        };
        let went_on = self.live && drawn.live;
        self.live = drawn.live;
        self.fine = drawn.fine.map(|after| Instant::now() + after);
        self.egui_wants = drawn.again.map(|after| Instant::now() + after);
        self.drawn |= drawn.shown;
        self.dirty |= !drawn.shown;
        if drawn.shown {
            self.follow_times(begun, went_on);
        }
        self.title(options);
        self.gpu.check_validation()?;
        Ok(!drawn.quit)
    }

    fn follow_times(&mut self, begun: Instant, went_on: bool) {
        let since = begun - self.last;
        self.last = begun;
        self.cost = begun.elapsed().max(self.frames.device_time());
        let ms = since.as_secs_f32() * 1e3;
        if went_on {
            self.viewer.frame_ms.push(ms);
        }
        let status = &self.status;
        let updating = status.preparing.is_none() && !status.paused && !status.converged;
        let updates = (self.live && updating).then_some(status.updates);
        self.moving.frame(ms, updates);
        if self.viewer.frame_ms.len() > 4096 {
            self.viewer.frame_ms.drain(..2048);
        }
        self.viewer.device_bytes = self.gpu.peak_bytes();
    }

    fn title(&self, options: &WindowOptions) {
        let name = options.scene.path.file_name().unwrap_or_default();
        let state = match (
            &self.status.preparing,
            self.status.converged,
            self.status.paused,
        ) {
            (Some(what), ..) => format!("preparing {what}"),
            (_, true, _) => "converged".to_owned(),
            (_, _, true) => "paused".to_owned(),
            _ => {
                let left = self.status.progress.map_or(0, |p| p.left);
                format!("{left} updates left")
            }
        };
        let selected = self.viewer.selection.and_then(|n| self.shown.name_of(n));
        let selected = selected.map_or_else(String::new, |name| format!("{name} - "));
        let name = name.to_string_lossy();
        let title = format!("{name} - {selected}{state} - rebake viewer");
        self.window.set_title(&title);
    }

    /// Loads the scene's file again when it has changed.
    pub(super) fn watch(&mut self, options: &WindowOptions) {
        if self.watched.0.elapsed() < FILE_WATCH {
            return;
        }
        self.watched.0 = Instant::now();
        let found = modified(&options.scene.path);
        if found.is_some() && found != self.watched.1 {
            self.watched.1 = found;
            self.worker.send(Request::Reload);
        }
    }

    pub(super) fn close(self, options: &WindowOptions) -> Result<(), ViewError> {
        let Self {
            worker,
            frames,
            viewer,
            shown,
            gpu,
            window,
            status,
            begun,
            first_picture,
            moving,
            ..
        } = self;
        let (photon, begun) = (frames.photon(), begun.elapsed().as_secs_f64());
        drop(worker);
        drop(shown);
        drop(frames);
        if let Some(path) = &options.stats {
            let updating = status.curve.last().map_or(0.0, |last| last[0]);
            let (median, worst) = super::super::panels::frame_times(&viewer.frame_ms);
            let stats = serde_json::json!({
                "frames": viewer.frame_ms.len(),
                "median_ms": median,
                "p99_ms": worst,
                "moving": moving.sum(),
                "input_to_photon": photon,
                "first_picture_s": first_picture.map(|t| t.as_secs_f64()),
                "seconds": begun,
                "updates": status.updates,
                "updates_per_s": status.updates as f64 / updating.max(1e-3),
                "device_bytes": gpu.peak_bytes(),
                "device": gpu.info().name,
                "passes": gpu.timings(),
            });
            std::fs::write(path, format!("{stats:#}\n")).map_err(|cause| ViewError::Write {
                path: path.clone(),
                cause,
            })?;
        }
        let checked = gpu.check_validation();
        drop(gpu);
        drop(window);
        Ok(checked?)
    }
}

fn modified(path: &std::path::Path) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|m| m.modified()).ok()
}
