//! Pictures without a window: a script of edits, cameras and frames, played to PNG files.

mod endurance;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tracing::debug_span;

use super::ViewError;
use super::camera::{FOV_Y, Pose};
use super::caption::Caption;
use super::display::Display;
use super::legend::Legend;
use super::look::{Look, Overlay};
use super::overlays::{Overlays, Sketch};
use super::picture_file::write_picture;
use super::reference::Reference;
use super::resolve::Pages;
use super::script::{Line, View};
use super::shot::{PageShot, Shot};
use super::shown::Shown;
use super::state::ERROR_SCALE;
use super::textures::Samplers;
use crate::bake::{Baker, Limit};
use crate::gpu::{Format, Gpu, Image, ImageOptions};
use crate::lightmap::viewpoint;
use crate::scene::edit::{Command, Until};

pub use endurance::MemoryUse;

/// What headless pictures are to be.
#[derive(Clone)]
pub struct HeadlessOptions {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Time for updates after each picture.
    pub frame: Duration,
    /// Where `frame_00000.png` and so on go.
    pub folder: PathBuf,
    /// What the light is held against.
    pub reference: Option<Arc<Reference>>,
    /// JPEG files instead of PNG.
    pub jpeg: bool,
}

/// Seconds between two pictures of a film: exposure follows the light at that pace.
const FILM_STEP: f32 = 1.0 / 30.0;

/// Plays scripts.
pub struct Headless<'a> {
    baker: &'a mut Baker,
    pages: Pages,
    samplers: Samplers,
    shown: Option<Arc<Shown>>,
    display: Display,
    caption: Caption,
    target: Image,
    shot: Shot,
    overlays: Overlays,
    options: HeadlessOptions,
    /// The map has been worked on since the pages were brought up to date.
    stale: bool,
    /// The scene has changed since the display was told.
    changed: bool,
    scale: Option<[f32; 2]>,
    frames: u32,
    /// Milliseconds that pictures took.
    frame_ms: Vec<f32>,
    updates: u64,
    start: Instant,
    memory: Vec<MemoryUse>,
}

impl<'a> Headless<'a> {
    /// Stands at the file's first camera, or where much of the scene is seen.
    ///
    /// # Errors
    /// No memory, a lost device, a folder that cannot be made.
    pub fn new(
        gpu: &Gpu,
        baker: &'a mut Baker,
        options: HeadlessOptions,
    ) -> Result<Self, ViewError> {
        std::fs::create_dir_all(&options.folder).map_err(|cause| ViewError::Write {
            path: options.folder.clone(),
            cause,
        })?;
        if let Some(reference) = &options.reference {
            reference.check(baker.page_layout())?;
        }
        let pages = Pages::new(gpu, options.reference.clone())?;
        let display = Display::new(gpu)?;
        let target = gpu.image(
            "frame",
            &ImageOptions {
                size: options.size,
                layers: 1,
                mips: false,
                samples: 1,
                format: Format::Rgba8,
            },
        )?;
        let pose = first_pose(baker.scene());
        Ok(Self {
            baker,
            shot: Shot {
                pose,
                look: Look::Lit,
                scale: pages.view().scale(),
                page: PageShot::default(),
                coarse: 1,
            },
            caption: Caption::new(gpu, target.format())?,
            overlays: Overlays::default(),
            pages,
            samplers: Samplers::new(gpu)?,
            shown: None,
            display,
            target,
            options,
            stale: true,
            changed: true,
            scale: None,
            frames: 0,
            frame_ms: Vec::new(),
            updates: 0,
            start: Instant::now(),
            memory: Vec::new(),
        })
    }

    /// Plays a script; `folder` is where files that edits add are looked up. Returns the number of pictures.
    ///
    /// # Errors
    /// The first line that is refused, with its number; a picture that cannot be written.
    pub fn play(&mut self, script: &[(usize, Line)], folder: &Path) -> Result<u32, ViewError> {
        for (line, what) in script {
            let done = match what {
                Line::Command(command) => self.command(command, folder),
                Line::View(view) => self.view(view),
            };
            done.map_err(|cause| ViewError::Line {
                line: *line,
                cause: Box::new(cause),
            })?;
        }
        Ok(self.frames)
    }

    /// Pictures of the last round.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    fn command(&mut self, command: &Command, folder: &Path) -> Result<(), ViewError> {
        match command {
            Command::Edit(edit) => self.baker.apply(edit, folder)?,
            Command::Undo => self.baker.undo()?,
            Command::Redo => self.baker.redo()?,
            Command::Wait(until) => {
                match until {
                    Until::Converged => {
                        // Eyes have had the time to get used to it.
                        self.display.exposure.reset();
                        self.baker.step(Limit::Converged)?
                    }
                    Until::Updates(n) => self.baker.step(Limit::Updates(*n))?,
                    Until::Seconds(s) => {
                        self.baker.step(Limit::Time(Duration::from_secs_f64(*s)))?
                    }
                };
                self.stale = true;
                return Ok(());
            }
        }
        (self.stale, self.changed) = (true, true);
        Ok(())
    }

    fn view(&mut self, view: &View) -> Result<(), ViewError> {
        match view {
            View::Camera {
                position,
                target,
                fov,
                name,
                frames,
            } => {
                let from = self.shot.pose;
                let to = self.pose(*position, *target, *fov, name.as_deref())?;
                for frame in 1..=*frames {
                    self.shot.pose = from.towards(&to, frame as f32 / *frames as f32);
                    self.frame()?;
                    self.advance(None)?;
                }
                if *frames == 0 {
                    self.display.exposure.reset();
                }
                self.shot.pose = to;
            }
            View::Frame { count, updates } => {
                for _ in 0..*count {
                    self.frame()?;
                    self.advance(*updates)?;
                }
            }
            View::Look {
                look,
                scale,
                page,
                center,
                zoom,
            } => {
                if *look == Look::Error && self.options.reference.is_none() {
                    return Err(ViewError::NoReference);
                }
                let [_, pages] = self.baker.page_layout();
                if *page >= pages {
                    return Err(ViewError::NoPage { page: *page, pages });
                }
                self.shot.look = *look;
                self.shot.page = PageShot {
                    page: *page,
                    center: (*center).into(),
                    zoom: *zoom,
                };
                self.scale = *scale;
            }
            View::Overlay { show } => self.overlays.shown = show.clone(),
            View::Exposure { ev, compensation } => {
                self.display.exposure.ev = *ev;
                self.display.exposure.compensation = *compensation;
            }
        }
        Ok(())
    }

    fn pose(
        &self,
        position: Option<[f32; 3]>,
        target: Option<[f32; 3]>,
        fov: Option<f32>,
        name: Option<&str>,
    ) -> Result<Pose, ViewError> {
        let scene = self.baker.scene();
        let mut pose = self.shot.pose;
        if let Some(name) = name {
            let camera = scene.cameras.iter().find(|c| c.name == name);
            let camera = camera.ok_or_else(|| ViewError::NoCamera {
                name: name.into(),
                there: scene.cameras.iter().map(|c| c.name.clone()).collect(),
            })?;
            pose = Pose::of(camera, pose.distance);
        }
        let at = position.map_or(pose.position, Into::into);
        let ahead = target.map_or(at + pose.ahead() * pose.distance, Into::into);
        let fov_y = fov.map_or(pose.fov_y, f32::to_radians);
        Ok(Pose::looking(at, ahead, fov_y))
    }

    /// Works on the map between two pictures.
    fn advance(&mut self, updates: Option<u64>) -> Result<(), ViewError> {
        let limit = match updates {
            Some(0) => return Ok(()),
            Some(n) => Limit::Updates(n),
            None => Limit::Time(self.options.frame),
        };
        if !self.baker.is_converged() {
            self.baker.look_from(Some(&self.shot.pose.camera()));
            self.updates += self.baker.step(limit)?.updates;
            self.stale = true;
        }
        Ok(())
    }

    /// Takes a picture.
    fn frame(&mut self) -> Result<(), ViewError> {
        let _span = debug_span!("frame", number = self.frames).entered();
        if std::mem::take(&mut self.stale) {
            if self.baker.is_converged() {
                let map = self.baker.lightmap()?;
                self.pages.show(self.baker, &map)?;
            } else {
                self.pages.update(self.baker)?;
            }
        }
        if std::mem::take(&mut self.changed) {
            let atlas = Some(Arc::new(self.baker.atlas()));
            let (scene, document) = (self.baker.scene(), self.baker.document());
            let pages = self.pages.view();
            let before = self.shown.as_deref();
            let shown = Arc::new(Shown::new(
                &self.samplers,
                scene,
                document,
                atlas,
                &pages,
                before,
            )?);
            self.display.show(&shown)?;
            self.shown = Some(shown);
        }
        let wanted = match self.shot.look {
            Look::Page => Overlays {
                shown: [Overlay::Charts].into(),
                page: self.shot.page.page,
            },
            _ => self.overlays.clone(),
        };
        let sketch = Sketch::new(self.baker, &wanted)?;
        self.display
            .mark(sketch.as_ref().map(|s| Arc::clone(&s.marks)));
        if !self.display.exposure.is_set() {
            // The first picture is taken twice: the first time to see how bright it is.
            let look = self.shot.look;
            self.shot.look = if look.is_metered() { look } else { Look::Lit };
            self.take(FILM_STEP, &[])?;
            self.shot.look = look;
        }
        let scales = sketch.iter().flat_map(|s| s.scales.iter());
        let look = Legend::of_look(self.shot.look, self.scale(), None);
        let legends: Vec<Legend> = look
            .into_iter()
            .chain(scales.map(Legend::of_overlay))
            .collect();
        self.take(FILM_STEP, &legends)?;
        let pixels = self.target.read::<u8>()?;
        let ending = if self.options.jpeg { "jpg" } else { "png" };
        let path = self
            .options
            .folder
            .join(format!("frame_{:05}.{ending}", self.frames));
        debug_span!("write picture")
            .in_scope(|| write_picture(&path, self.options.size, &pixels))?;
        self.frames += 1;
        Ok(())
    }

    fn scale(&self) -> [f32; 2] {
        self.scale.unwrap_or_else(|| match self.shot.look {
            Look::Error => ERROR_SCALE,
            _ => self.pages.view().scale(),
        })
    }

    fn take(&mut self, seconds: f32, legends: &[Legend]) -> Result<(), ViewError> {
        let _span = debug_span!("draw").entered();
        let start = Instant::now();
        let mut cmd = self.baker.gpu().commands()?;
        self.shot.scale = self.scale();
        self.display.record(&mut cmd, &self.target, &self.shot)?;
        let measured = self.shot.look == Look::Lit && self.display.measure(&mut cmd);
        if !legends.is_empty() {
            self.caption.record(&mut cmd, &self.target, legends)?;
        }
        cmd.barrier(crate::gpu::Stage::All, crate::gpu::Stage::All);
        let ticket = cmd.submit()?;
        if measured {
            self.display.measured_by(ticket);
            if let Some(mean) = self.display.take_measurement(true)? {
                self.display.exposure.follow(mean, seconds);
            }
        } else {
            ticket.wait()?;
        }
        self.frame_ms.push(start.elapsed().as_secs_f32() * 1e3);
        Ok(())
    }
}

/// The file's first camera, or a place that sees much of the scene.
pub(super) fn first_pose(scene: &crate::scene::Scene) -> Pose {
    let distance = 0.3 * scene.bounds().size().length().max(1e-2);
    match scene.cameras.first() {
        Some(camera) => Pose::of(camera, distance),
        None => Pose {
            fov_y: FOV_Y,
            ..Pose::of(&viewpoint::choose(scene), distance)
        },
    }
}

#[cfg(test)]
mod tests;
