//! The bake's side of its thread: answers requests, does slices of updates, and keeps what is shown up to date.

mod answers;
mod rest;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use tracing::debug_span;

use super::overlays::{Overlays, Sketch};
use super::resolve::Pages;
use super::shown::Shown;
use super::worker::{Request, Setup, Shared, Status};
use super::{Note, ViewError};
use crate::bake::{Baker, Limit, Progress};
use crate::gpu::GpuError;
use crate::lightmap::Lightmap;
use crate::scene::edit::Command;

/// Share of the time that bringing the shown map up to date may take.
const SHOWING: u32 = 10;
/// Time for updates while nothing moves: what begins to move waits for no more than two of these.
const IDLE_SLICE: Duration = Duration::from_millis(33);
/// The map is shown no more often.
const SHOWN: Duration = Duration::from_millis(100);
/// Points of the convergence curve that are kept.
const CURVE: usize = 4096;

/// Bakes file after file, until the window closes.
pub(super) fn run(
    mut setup: Setup,
    shown: Arc<Shown>,
    inbox: &Receiver<Request>,
    shared: &Shared,
) -> Result<(), ViewError> {
    let mut before = shown;
    loop {
        shared.state().status = Status {
            preparing: Some("scene"),
            ..Status::default()
        };
        let (scene, document) = (setup.scene.clone(), setup.document.clone());
        let baker = Baker::new(&setup.gpu, scene, document, &setup.job, shared)?;
        let session = Session::new(&setup, baker, before, inbox, shared)?;
        let Some(again) = session.work()? else {
            return Ok(());
        };
        before = again;
        // A file that is just being written is tried again when it changes again.
        match setup.source.load() {
            Ok((scene, document)) => {
                setup.scene = scene;
                setup.document = document;
                note(
                    shared,
                    Note::said("the scene's file has changed: loaded again"),
                );
            }
            Err(error) => note(shared, Note::failed(format!("not loaded again: {error}"))),
        }
    }
}

fn note(shared: &Shared, note: Note) {
    shared.state().notes.push(note);
    (shared.wake)();
}

/// A bake of one file.
struct Session<'a> {
    setup: &'a Setup,
    baker: Baker,
    pages: Pages,
    shown: Arc<Shown>,
    inbox: &'a Receiver<Request>,
    shared: &'a Shared,
    start: Instant,
    /// What somebody wants.
    slice: Option<Duration>,
    paused: bool,
    /// Updates to do although paused.
    single: u64,
    frames: u64,
    /// What the last slice left of its time, because no light fitted into it: the next one has it.
    credit: Duration,
    /// The map has changed since the pages were brought up to date.
    stale: bool,
    updated: Instant,
    log: Vec<Command>,
    dragging: bool,
    overlays: Overlays,
    /// When the overlays were drawn last, and how long it took.
    sketched: (Instant, Duration),
    save: Option<PathBuf>,
    compare: Option<Lightmap>,
    status: Status,
    rated: (Instant, u64),
}

impl<'a> Session<'a> {
    fn new(
        setup: &'a Setup,
        baker: Baker,
        before: Arc<Shown>,
        inbox: &'a Receiver<Request>,
        shared: &'a Shared,
    ) -> Result<Self, ViewError> {
        if let Some(reference) = &setup.reference {
            reference.check(baker.page_layout())?;
        }
        let mut pages = Pages::new(&setup.gpu, setup.reference.clone())?;
        pages.update(&baker)?;
        let now = Instant::now();
        let mut session = Self {
            setup,
            baker,
            pages,
            shown: before,
            inbox,
            shared,
            start: now,
            slice: setup.slice,
            paused: false,
            single: 0,
            frames: 0,
            credit: Duration::ZERO,
            stale: true,
            updated: now,
            log: Vec::new(),
            dragging: false,
            overlays: shared.state().overlays.clone(),
            sketched: (now, Duration::ZERO),
            save: None,
            compare: None,
            status: Status::default(),
            rated: (now, 0),
        };
        session.show()?;
        session.sketch()?;
        Ok(session)
    }

    /// Until the window closes (none), or the file is to be loaded again.
    fn work(mut self) -> Result<Option<Arc<Shown>>, ViewError> {
        loop {
            let idle = (self.paused && self.single == 0) || self.baker.is_converged();
            let mut next = if idle {
                self.rest()?;
                Some(self.inbox.recv().unwrap_or(Request::Close))
            } else {
                self.poll()
            };
            while let Some(request) = next.take() {
                match request {
                    Request::Close => return Ok(None),
                    Request::Reload => return Ok(Some(self.shown)),
                    Request::Drag(edit, first) => {
                        // Only the newest place counts of those that are waiting.
                        let (mut edit, mut first) = (edit, first);
                        next = self.poll();
                        while let Some(Request::Drag(newer, newer_first)) = &next {
                            if *newer_first {
                                break;
                            }
                            edit = newer.clone();
                            next = self.poll();
                        }
                        first |= !self.dragging;
                        self.drag(edit, first)?;
                        continue;
                    }
                    request => self.answer(request)?,
                }
                next = self.poll();
            }
            if self.shared.state().closing {
                return Ok(None);
            }
            if (!self.paused || self.single > 0) && !self.baker.is_converged() {
                self.step()?;
            }
        }
    }

    fn poll(&self) -> Option<Request> {
        match self.inbox.try_recv() {
            Ok(request) => Some(request),
            Err(TryRecvError::Disconnected) => Some(Request::Close),
            Err(TryRecvError::Empty) => None,
        }
    }

    /// Draws the overlays as they are now.
    fn sketch(&mut self) -> Result<(), ViewError> {
        let _span = debug_span!("overlays").entered();
        let start = Instant::now();
        let sketch = Sketch::new(&self.baker, &self.overlays)?;
        self.shared.state().sketch = sketch;
        self.sketched = (Instant::now(), start.elapsed());
        (self.shared.wake)();
        Ok(())
    }

    /// Makes the scene as it is now the one that is shown.
    fn show(&mut self) -> Result<(), ViewError> {
        let _span = debug_span!("show scene").entered();
        let atlas = Some(Arc::new(self.baker.atlas()));
        let (scene, document) = (self.baker.scene(), self.baker.document());
        let pages = self.pages.view();
        let samplers = &self.setup.samplers;
        let shown = Shown::new(samplers, scene, document, atlas, &pages, Some(&self.shown))?;
        self.shown = Arc::new(shown);
        let bvh = self.baker.bvh().clone();
        self.shared.state().shown = Some((Arc::clone(&self.shown), Some(bvh)));
        self.publish();
        Ok(())
    }

    /// A slice of updates.
    fn step(&mut self) -> Result<(), ViewError> {
        let live = debug_span!("wait for a frame").in_scope(|| self.wait_for_frame());
        let _span = debug_span!("slice", live).entered();
        let (camera, picture) = {
            let state = self.shared.state();
            (state.camera.clone(), state.picture)
        };
        self.baker.look_from(camera.as_ref());
        self.status.slice = super::pace::slice(self.slice, picture);
        let mut time = self.status.slice;
        if live {
            time += self.credit;
        } else {
            time = time.max(IDLE_SLICE);
        }
        // Brought up to date as often as its cost allows, once no update is halfway into it.
        let cost = self.pages.cost()?;
        if self.stale && self.updated.elapsed() > (cost * SHOWING).max(SHOWN) {
            if !self.baker.is_whole() {
                self.baker.step(Limit::Slice { time, whole: true })?;
                time = self.baker.slice_left();
            }
            if self.baker.is_whole() {
                self.refresh()?;
                time = time.saturating_sub(cost);
            }
            if time < self.status.slice / 4 {
                time = Duration::ZERO;
            }
        }
        let limit = match self.single {
            0 => Limit::Slice { time, whole: false },
            _ => Limit::Updates(1),
        };
        let progress = self.baker.step(limit)?;
        self.credit = self.baker.slice_left().min(self.status.slice / 2);
        // A frame may have been sent while this was: then this is what the next one waits for.
        self.frames = self.shared.state().frames;
        self.single = self.single.saturating_sub(1);
        self.stale = true;
        self.status.updates += progress.updates;
        self.follow(progress);
        let (sketched, cost) = self.sketched;
        let pause = (cost * SHOWING).max(Duration::from_millis(100));
        if self.overlays.follow_updates() && sketched.elapsed() > pause {
            self.sketch()?;
        }
        self.publish();
        Ok(())
    }

    /// While the window is live, until it has drawn a frame since the last slice. Whether it is live.
    fn wait_for_frame(&mut self) -> bool {
        let mut state = self.shared.state();
        let patience = Duration::from_millis(200);
        if state.live && state.frames == self.frames && !state.closing {
            state = self
                .shared
                .drawn
                .wait_timeout(state, patience)
                .unwrap_or_else(|e| e.into_inner())
                .0;
        }
        state.live
    }

    fn follow(&mut self, progress: Progress) {
        let now = Instant::now();
        let since = (now - self.rated.0).as_secs_f64();
        if since > 0.5 {
            self.status.rate = (self.status.updates - self.rated.1) as f64 / since;
            self.rated = (now, self.status.updates);
        }
        let seconds = self.start.elapsed().as_secs_f64();
        self.status.curve.push([seconds, progress.invalid_flux]);
        if self.status.curve.len() > CURVE {
            let mut keep = false;
            self.status.curve.retain(|_| {
                keep = !keep;
                keep
            });
        }
        self.status.progress = Some(progress);
    }

    /// Shows the map as it is.
    fn refresh(&mut self) -> Result<(), GpuError> {
        let _span = debug_span!("show map").entered();
        self.pages.update(&self.baker)?;
        self.updated = Instant::now();
        Ok(())
    }

    fn publish(&mut self) {
        self.status.paused = self.paused;
        self.status.converged = self.baker.is_converged() && !self.stale;
        self.shared.state().status = self.status.clone();
        (self.shared.wake)();
    }

    fn tell(&self, what: Note) {
        note(self.shared, what);
    }
}
