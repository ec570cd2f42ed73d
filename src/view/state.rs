//! What the person at the window has chosen, and what each frame of input makes of it: no window and no device is needed.

mod act;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use egui::{Rect, Sense};
use glam::Mat4;

use super::camera::Pose;
use super::exposure::Exposure;
use super::gizmo::Manipulator;
use super::input::{self, Action};
use super::look::{Look, Overlay};
use super::overlays::{Overlays, Sketch};
use super::pick;
use super::place::{Handle, Place};
use super::shot::PageShot;
use super::shown::Shown;
use super::worker::{Request, Status};
use super::{Note, panels};
use crate::scene::edit::{Command, Edit};
use crate::transport::SceneBvh;

/// Share of the invalid flux below which the map is worth more than the light that stands in for it.
const WORTH_SHOWING: f64 = 0.8;
/// Relative errors at both ends of the false colours.
pub(super) const ERROR_SCALE: [f32; 2] = [0.002, 1.0];
/// Seconds that a note is shown.
const NOTE: f64 = 6.0;

/// The viewer's state.
pub struct Viewer {
    /// Where the picture is taken from.
    pub pose: Pose,
    /// Metres per second that flying takes.
    pub speed: f32,
    /// What is looked at, once there is a map.
    pub look: Look,
    /// Lux at both ends of the false colours; none: what suits the scene.
    pub scale: Option<[f32; 2]>,
    /// Relative errors at both ends of the false colours.
    pub error_scale: [f32; 2],
    /// Laid over the picture of the scene.
    pub overlays: BTreeSet<Overlay>,
    /// How a page of the lightmap is looked at.
    pub page: PageShot,
    /// There is something to hold the light against.
    pub has_reference: bool,
    /// Exposure; the display measures.
    pub exposure: Exposure,
    /// The node that is selected.
    pub selection: Option<u32>,
    /// What dragging the selection's handles does.
    pub handle: Handle,
    /// Handles along the node's own axes instead of the world's.
    pub local: bool,
    /// Dragging goes in steps.
    pub snap: bool,
    /// Metres, degrees, factor.
    pub steps: [f32; 3],
    /// The keys are shown.
    pub help: bool,
    /// Panels are shown.
    pub panels: bool,
    /// What is under the cursor, where false colours are shown: lux, or a relative error.
    pub probe: Option<f32>,
    /// Milliseconds of the last frames.
    pub frame_ms: Vec<f32>,
    /// Device milliseconds per frame, by pass.
    pub passes: Vec<(&'static str, f64)>,
    /// Bytes on the device at most so far.
    pub device_bytes: u64,
    /// Where files go and what they are called.
    pub files: Files,
    pub(super) manipulator: Manipulator,
    notes: Vec<(f64, Note)>,
    requests: Vec<Request>,
    /// Of the selection, until the bake has taken the edit in.
    pub(super) place: Option<(u32, Place)>,
    /// What the bake was asked to lay over the picture.
    asked: Overlays,
    /// What is laid over the picture in this frame, and its scales.
    pub(super) sketch: Option<Arc<Sketch>>,
    objects: usize,
    select_new: bool,
    /// Where the picture is on the screen, points.
    pub screen: Rect,
}

/// Where files go.
#[derive(Clone, Debug)]
pub struct Files {
    /// The scene.
    pub scene: PathBuf,
    /// The folder of a saved bake.
    pub bake: PathBuf,
    /// The script of all edits.
    pub history: PathBuf,
    /// The edited scene.
    pub edited: PathBuf,
    /// Screenshots, a number before the ending.
    pub screenshot: PathBuf,
}

impl Files {
    /// Beside each other in `folder`, named after the scene.
    pub fn new(scene: PathBuf, folder: PathBuf) -> Self {
        let stem = scene
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Self {
            bake: folder.join(format!("{stem}-bake")),
            history: folder.join(format!("{stem}-edits.jsonl")),
            edited: folder.join(format!("{stem}-edited.glb")),
            screenshot: folder.join(format!("{stem}.png")),
            scene,
        }
    }
}

/// What a frame's input came to.
pub struct Outcome {
    /// What egui wants drawn and done.
    pub output: egui::FullOutput,
    /// For the bake.
    pub requests: Vec<Request>,
    /// Take a picture of the window.
    pub screenshot: bool,
    /// Close the window.
    pub quit: bool,
    /// Frames should follow each other without a pause.
    pub live: bool,
    /// Where lux are asked for, as a share of the picture.
    pub probe: Option<[f32; 2]>,
}

impl Viewer {
    /// Looks at a scene from its first camera.
    pub fn new(shown: &Shown, files: Files) -> Self {
        let size = shown.bounds().size().length().max(1e-2);
        Self {
            pose: super::headless::first_pose(&shown.scene),
            speed: 0.15 * size,
            look: Look::Lit,
            scale: None,
            error_scale: ERROR_SCALE,
            overlays: BTreeSet::new(),
            page: PageShot::default(),
            has_reference: false,
            exposure: Exposure::default(),
            selection: None,
            handle: Handle::Move,
            local: false,
            snap: false,
            steps: [0.05, 5.0, 0.1],
            help: false,
            panels: true,
            probe: None,
            frame_ms: Vec::new(),
            passes: Vec::new(),
            device_bytes: 0,
            files,
            manipulator: Manipulator::default(),
            notes: Vec::new(),
            requests: Vec::new(),
            place: None,
            asked: Overlays::default(),
            sketch: None,
            objects: shown.scene.objects.len(),
            select_new: false,
            screen: Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1.0, 1.0)),
        }
    }

    /// What the picture shows: until the map is worth it, something that stands in.
    pub fn look_of(&self, shown: &Shown, status: &Status) -> Look {
        let first = status.curve.first().map_or(0.0, |c| c[1]);
        let left = status.progress.map_or(f64::INFINITY, |p| p.invalid_flux);
        let worth = status.converged || !status.edits.is_empty() || left <= WORTH_SHOWING * first;
        match shown.atlas {
            Some(_) if worth => self.look,
            _ => Look::Unbaked,
        }
    }

    /// What both ends of the false colours stand for.
    pub fn scale_of(&self, look: Look, shown: &Shown) -> [f32; 2] {
        match look {
            Look::Error => self.error_scale,
            _ => self.scale.unwrap_or_else(|| shown.scale()),
        }
    }

    /// What is to lie over the picture.
    fn wanted(&self) -> Overlays {
        match self.look {
            Look::Page => Overlays {
                shown: [Overlay::Charts].into(),
                page: self.page.page,
            },
            _ => Overlays {
                shown: self.overlays.clone(),
                page: 0,
            },
        }
    }

    /// Takes in what there is to lie over the picture.
    pub(super) fn sketched(&mut self, sketch: Option<Arc<Sketch>>) {
        // What belongs to a page lies nowhere in the scene, and the other way round.
        let wanted = self.wanted();
        let fits = |of: &Overlays| of.page == wanted.page && of.shown.is_subset(&wanted.shown);
        self.sketch = sketch.filter(|s| fits(&s.of));
    }

    /// Another version of the scene is shown.
    pub fn scene_changed(&mut self, shown: &Shown) {
        let objects = &shown.scene.objects;
        if std::mem::take(&mut self.select_new) && objects.len() > self.objects {
            self.selection = objects.get(self.objects).map(|o| o.node);
        }
        self.objects = objects.len();
        if !self.manipulator.is_dragging() {
            self.place = None;
        }
        let there = |node: u32| {
            let object = (0u32..).zip(objects).find(|(_, o)| o.node == node);
            object.is_some_and(|(o, _)| !shown.scene.is_gone(o))
                || shown.scene.lights.iter().any(|l| l.node == node)
        };
        self.selection = self.selection.filter(|n| there(*n));
    }

    /// Shows a note for a while.
    pub fn note(&mut self, now: f64, note: Note) {
        self.notes.push((now, note));
    }

    pub(super) fn notes(&mut self, now: f64) -> Vec<Note> {
        self.notes.retain(|(since, _)| now - since < NOTE);
        self.notes.iter().map(|(_, n)| n.clone()).collect()
    }

    pub(super) fn ask(&mut self, request: Request) {
        self.requests.push(request);
    }

    pub(super) fn edit(&mut self, edit: Edit) {
        self.requests.push(Request::Command(Command::Edit(edit)));
    }

    /// Takes a frame of input in.
    pub fn frame(
        &mut self,
        ctx: &egui::Context,
        input: egui::RawInput,
        shown: &Arc<Shown>,
        bvh: Option<&SceneBvh>,
        status: &Status,
    ) -> Outcome {
        let mut actions = Vec::new();
        let (mut live, mut probe) = (false, None);
        let output = ctx.run(input, |ctx| {
            (live, probe) = (false, None);
            actions.extend(input::actions(ctx));
            panels::draw(self, ctx, shown, status, &mut actions);
            let frame = egui::Frame::NONE;
            egui::CentralPanel::default().frame(frame).show(ctx, |ui| {
                // The picture fills the window; panels lie on it.
                self.screen = ctx.content_rect();
                let aspect = self.screen.width() / self.screen.height().max(1.0);
                let clip = self.pose.clip(aspect, 0.01);
                let area = ui.interact(
                    ui.max_rect(),
                    ui.id().with("picture"),
                    Sense::click_and_drag(),
                );
                if self.look == Look::Page {
                    live |= super::paging::page(self, ui, &area, shown);
                    return;
                }
                panels::marks(self, ui, shown, &clip);
                let busy = self.manipulate(ui, &area, shown);
                live |= busy;
                if !busy && area.clicked() {
                    self.click(&area, shown, bvh, &clip);
                }
                live |= !busy && self.navigate(ctx, &area);
                if let (Some(at), Some(_)) = (area.hover_pos(), self.look.unit()) {
                    let share = (at - self.screen.min) / self.screen.size();
                    probe = Some([share.x, share.y]);
                }
            });
        });
        let (mut quit, mut screenshot) = (false, false);
        for action in actions {
            match action {
                Action::Quit => quit = true,
                Action::Screenshot => screenshot = true,
                action => self.act(action, shown, status),
            }
        }
        let wanted = self.wanted();
        if self.asked != wanted {
            self.ask(Request::Overlays(wanted.clone()));
            self.asked = wanted;
        }
        Outcome {
            output,
            requests: std::mem::take(&mut self.requests),
            screenshot,
            quit,
            live,
            probe,
        }
    }

    fn click(&mut self, area: &egui::Response, shown: &Shown, bvh: Option<&SceneBvh>, clip: &Mat4) {
        if let Some(at) = area.interact_pointer_pos() {
            let bounds = shown.bounds();
            let scene = &shown.scene;
            self.selection = pick::pick(scene, bvh, &bounds, &self.pose, clip, self.screen, at);
            self.place = None;
        }
    }

    /// Moves the camera as keys and mouse say; whether it moves.
    fn navigate(&mut self, ctx: &egui::Context, area: &egui::Response) -> bool {
        let step = input::navigation(ctx, area);
        if let Some(factor) = step.speed {
            self.speed = (self.speed * factor).clamp(1e-3, 1e4);
        }
        self.pose.turn(step.look.x, step.look.y);
        if step.orbit != glam::Vec2::ZERO {
            self.pose.orbit(step.orbit.x, step.orbit.y);
        }
        self.pose.pan(step.pan.x, step.pan.y);
        if step.zoom != 1.0 {
            self.pose.zoom(step.zoom);
        }
        self.pose.fly(step.motion, self.speed * step.seconds);
        step.moves
    }

    /// Draws and follows the handles of what is selected; whether they are, or were until now, held.
    fn manipulate(&mut self, ui: &egui::Ui, area: &egui::Response, shown: &Shown) -> bool {
        let held = self.manipulator.is_dragging();
        let Some(node) = self.selection else {
            self.manipulator.rest();
            return false;
        };
        let known = self.place.filter(|(n, _)| *n == node).map(|(_, p)| p);
        let Some(place) = known.or_else(|| Place::of(&shown.json, node)) else {
            return false;
        };
        let pivot = shown.pivot_of(node);
        let settings = super::gizmo::Settings {
            pose: self.pose,
            screen: self.screen,
            handle: self.handle,
            local: self.local,
            snap: self.snap || ui.input(|i| i.modifiers.ctrl),
            steps: self.steps,
            pivot,
        };
        if let Some((moved, first)) = self.manipulator.follow(ui, area, &settings, &place) {
            self.place = Some((node, moved));
            let edit = moved.edit(node, self.handle, pivot != glam::DVec3::ZERO);
            self.requests.push(Request::Drag(edit, first));
        }
        held || self.manipulator.is_dragging()
    }
}
