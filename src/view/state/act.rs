//! What keys and buttons do.

use super::super::camera::Pose;
use super::super::input::Action;
use super::super::look::Look;
use super::super::shown::Shown;
use super::super::worker::{Request, Status};
use super::Viewer;
use crate::scene::edit::{Command, Edit, Name};

impl Viewer {
    pub(super) fn act(&mut self, action: Action, shown: &Shown, status: &Status) {
        let aspect = self.screen.width() / self.screen.height().max(1.0);
        match action {
            Action::Quit | Action::Screenshot => {}
            Action::Help => self.help = !self.help,
            Action::Panels => self.panels = !self.panels,
            Action::Focus => {
                let bounds = self.selection.and_then(|n| bounds_of(shown, n));
                self.pose
                    .focus(&bounds.unwrap_or_else(|| shown.bounds()), aspect);
            }
            Action::Camera(number) if self.look == Look::Page => {
                let pages = shown.atlas.as_ref().map_or(1, |a| a.pages);
                self.page.page = (number as u32).min(pages.max(1) - 1);
            }
            Action::Camera(number) => {
                if let Some(camera) = shown.scene.cameras.get(number) {
                    self.pose = Pose::of(camera, self.pose.distance);
                    self.exposure.reset();
                }
            }
            Action::Undo => self.ask(Request::Command(Command::Undo)),
            Action::Redo => self.ask(Request::Command(Command::Redo)),
            Action::Delete => {
                if let Some(node) = self.selection.take() {
                    self.edit(Edit::Remove {
                        node: Name::Index(node),
                    });
                }
            }
            Action::Add(file) => {
                self.select_new = true;
                self.edit(Edit::Add {
                    file,
                    name: None,
                    parent: None,
                });
            }
            Action::Duplicate => {
                if let Some(node) = self.selection {
                    self.select_new = true;
                    self.edit(Edit::Copy {
                        node: Name::Index(node),
                        name: None,
                    });
                }
            }
            Action::Deselect => {
                if self.help {
                    self.help = false;
                } else {
                    self.selection = None;
                }
            }
            Action::Pause => self.ask(Request::Pause(!status.paused)),
            Action::Step => {
                self.ask(Request::Pause(true));
                self.ask(Request::Step);
            }
            Action::SaveBake => self.ask(Request::SaveBake(self.files.bake.clone())),
            Action::SaveHistory => self.ask(Request::SaveHistory(self.files.history.clone())),
            Action::SaveScene => self.ask(Request::SaveScene(self.files.edited.clone())),
            Action::StartOver(compare) => self.ask(Request::StartOver(compare)),
            Action::Look(look) => self.look = if self.look == look { Look::Lit } else { look },
            Action::NextLook => {
                let at = Look::ALL.iter().position(|l| *l == self.look);
                let count = Look::ALL.len() - usize::from(!self.has_reference);
                self.look = Look::ALL[at.map_or(0, |at| (at + 1) % count)];
            }
            Action::Overlay(overlay) => {
                if !self.overlays.remove(&overlay) {
                    self.overlays.insert(overlay);
                }
            }
            Action::Handle(handle) => self.handle = handle,
            Action::Axes => self.local = !self.local,
            Action::Snap => self.snap = !self.snap,
            Action::Select(node) => {
                self.selection = Some(node);
                self.place = None;
            }
        }
    }
}

/// The box around what a node shows.
fn bounds_of(shown: &Shown, node: u32) -> Option<crate::scene::Bounds> {
    let object = shown.scene.objects.iter().position(|o| o.node == node);
    let bounds = object.map(|o| shown.object_bounds(o as u32));
    bounds.filter(|b| b.min.x <= b.max.x).or_else(|| {
        let light = shown.scene.lights.iter().find(|l| l.node == node)?;
        let at = glam::Vec3::from(light.transform.translation);
        let reach = glam::Vec3::splat(0.05 * shown.bounds().size().length());
        Some(crate::scene::Bounds {
            min: at - reach,
            max: at + reach,
        })
    })
}
