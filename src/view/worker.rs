//! The bake in a thread of its own: takes edits, works on the map in slices, and tells the window what is new.
//!
//! Frames and slices share the device's queue. While the window is live (the camera moves, something is dragged), one slice
//! is done per frame, and what it sends is what is expected to fit into its time, if need be a part of an update, so that a
//! frame never waits for more than about a slice. While nothing moves, slice follows slice. The map is shown between updates.

use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::overlays::{Overlays, Sketch};
use super::reference::Reference;
use super::shown::Shown;
use super::textures::Samplers;
use super::{Note, Source, session};
use crate::bake::{Job, Listener, Progress, Stage};
use crate::gpu::Gpu;
use crate::scene::edit::{Command, Edit};
use crate::scene::{Camera, Document, Scene};
use crate::transport::SceneBvh;

/// What the window asks of the bake.
#[derive(Clone, Debug)]
pub enum Request {
    /// An edit, undo or redo.
    Command(Command),
    /// Something is dragged: all edits of one drag are one to undo. The first one of a drag says so.
    Drag(Edit, bool),
    /// Stop working on the map, or go on.
    Pause(bool),
    /// One update.
    Step,
    /// All again from the empty map; with `true`, then compare with the map as it is now.
    StartOver(bool),
    /// Time for updates per frame.
    Slice(Duration),
    /// Whether frames are drawn all the time.
    Live(bool),
    /// Lay this over the picture.
    Overlays(Overlays),
    /// Write the bake's folder, when it has converged.
    SaveBake(PathBuf),
    /// Write all commands as a script.
    SaveHistory(PathBuf),
    /// Write the edited scene.
    SaveScene(PathBuf),
    /// Load the scene's file again.
    Reload,
    /// End.
    Close,
}

/// Where the bake stands.
#[derive(Clone, Debug, Default)]
pub struct Status {
    /// What is being prepared; none once updates are done.
    pub preparing: Option<&'static str>,
    /// The last step's.
    pub progress: Option<Progress>,
    /// Updates in all.
    pub updates: u64,
    /// Time for updates per frame.
    pub slice: Duration,
    /// Updates in a second, lately.
    pub rate: f64,
    /// Seconds since the start, lumens that are wrong: the convergence curve.
    pub curve: Vec<[f64; 2]>,
    /// Seconds at which edits came.
    pub edits: Vec<f64>,
    /// Whether the worker waits for the person.
    pub paused: bool,
    /// Whether there is nothing left to do.
    pub converged: bool,
    /// Texels that are lit.
    pub texels: u64,
    /// Virtual lights in the map.
    pub lights: u64,
    /// The bake ended for this reason.
    pub failed: Option<String>,
}

/// What is shared with the window.
#[derive(Default)]
pub(super) struct State {
    pub(super) status: Status,
    pub(super) shown: Option<(Arc<Shown>, Option<SceneBvh>)>,
    pub(super) notes: Vec<Note>,
    pub(super) sketch: Option<Arc<Sketch>>,
    /// Asked for; kept over a reload of the scene's file.
    pub(super) overlays: Overlays,
    /// Frames sent to the device.
    pub(super) frames: u64,
    /// Where the last one was taken from.
    pub(super) camera: Option<Camera>,
    /// What frames take on the device while something moves.
    pub(super) picture: Duration,
    pub(super) live: bool,
    pub(super) closing: bool,
    /// Stages of the preparation that are under way.
    stages: Vec<Stage>,
    /// The window is gone, and nobody waits any more: what is under way is never to touch the device again.
    abandoned: bool,
}

/// How long closing waits for a stage that cannot be interrupted.
const PATIENCE: Duration = Duration::from_millis(150);

pub(super) struct Shared {
    pub(super) state: Mutex<State>,
    pub(super) drawn: Condvar,
    pub(super) wake: Box<dyn Fn() + Send + Sync>,
}

impl Shared {
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }
}

/// A bake that runs beside the window.
pub struct Worker {
    requests: Sender<Request>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// What came since the last look.
pub struct News {
    /// Where the bake stands.
    pub status: Status,
    /// Another version of the scene, with a tree for rays into it.
    pub shown: Option<(Arc<Shown>, Option<SceneBvh>)>,
    /// What the person should read.
    pub notes: Vec<Note>,
    /// What lies over the picture at this moment.
    pub sketch: Option<Arc<Sketch>>,
}

/// What the bake begins with.
pub struct Setup {
    /// The device.
    pub gpu: Gpu,
    /// Images that all scenes share.
    pub samplers: Samplers,
    /// What is baked.
    pub scene: Scene,
    /// What it was read from.
    pub document: Document,
    /// Where it is loaded from again.
    pub source: Source,
    /// How.
    pub job: Job,
    /// Where files that edits add are looked up.
    pub folder: PathBuf,
    /// Time for updates per frame; none: as pictures take.
    pub slice: Option<Duration>,
    /// What the light is held against.
    pub reference: Option<Arc<Reference>>,
}

impl Worker {
    /// Begins. `shown`: what is shown until there is a map; `wake`: called when there is news.
    pub fn start(setup: Setup, shown: Arc<Shown>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (requests, inbox) = channel();
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                status: Status {
                    preparing: Some("scene"),
                    ..Status::default()
                },
                ..State::default()
            }),
            drawn: Condvar::new(),
            wake: Box::new(wake),
        });
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("bake".into())
            .spawn(move || {
                if let Err(error) = session::run(setup, shown, &inbox, &theirs) {
                    theirs.state().status.failed = Some(error.to_string());
                    (theirs.wake)();
                }
            });
        let thread = match thread {
            Ok(thread) => Some(thread),
            Err(error) => {
                shared.state().status.failed = Some(format!("no thread for the bake: {error}"));
                None
            }
        };
        Self {
            requests,
            shared,
            thread,
        }
    }

    /// Asks for something. What is asked after the bake has failed is not done.
    pub fn send(&self, request: Request) {
        if let Request::Overlays(overlays) = &request {
            self.shared.state().overlays = overlays.clone();
        }
        if self.requests.send(request).is_err() {
            tracing::debug!("the bake has ended");
        }
    }

    /// What is new.
    pub fn news(&self) -> News {
        let mut state = self.shared.state();
        News {
            status: state.status.clone(),
            shown: state.shown.take(),
            notes: std::mem::take(&mut state.notes),
            sketch: state.sketch.clone(),
        }
    }

    /// Whether frames are drawn all the time.
    pub fn set_live(&self, live: bool) {
        let was = std::mem::replace(&mut self.shared.state().live, live);
        if was != live {
            self.shared.drawn.notify_all();
            self.send(Request::Live(live));
        }
    }

    /// A frame was sent to the device, from here: a live bake does its next slice, what is seen first. `took`: what frames take on the
    /// device while something moves.
    pub fn frame_sent(&self, camera: Camera, took: Duration) {
        let mut state = self.shared.state();
        state.picture = took;
        state.frames += 1;
        state.camera = Some(camera);
        drop(state);
        self.shared.drawn.notify_all();
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.shared.state().closing = true;
        self.shared.drawn.notify_all();
        self.send(Request::Close);
        let Some(thread) = self.thread.take() else {
            return;
        };
        let on_host = |stage: &Stage| {
            matches!(
                stage,
                Stage::Bvh | Stage::Paths | Stage::Cluster | Stage::Unwrap
            )
        };
        let closing = Instant::now();
        while !thread.is_finished() {
            let mut state = self.shared.state();
            let stages = &state.stages;
            let busy = !stages.is_empty() && stages.iter().all(on_host);
            if busy && closing.elapsed() > PATIENCE {
                // Charts of a large mesh can take many seconds. It ends with the process, and sleeps before it would go on.
                state.abandoned = true;
                return;
            }
            drop(state);
            std::thread::sleep(Duration::from_millis(2));
        }
        if thread.join().is_err() {
            tracing::error!("the bake's thread panicked");
        }
    }
}

impl Listener for Shared {
    fn at(&self, stage: Stage, done: u64, _: u64) {
        let mut state = self.state();
        if done == 0 && !state.stages.contains(&stage) {
            state.stages.push(stage);
        }
        while state.abandoned {
            state = self.drawn.wait(state).unwrap_or_else(|e| e.into_inner());
        }
        state.status.preparing = Some(stage.name());
        drop(state);
        (self.wake)();
    }

    fn ended(&self, stage: Stage, _: Duration) {
        self.state().stages.retain(|s| *s != stage);
    }
}
