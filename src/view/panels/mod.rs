//! What lies on the picture: a bar with commands, the inspector, the bake's progress, notes, keys, marks in the scene.

mod inspector;
mod marks;
mod progress;

use egui::{Align2, Color32, RichText};

use super::input::{Action, MOVES, bindings};
use super::legend::Legend;
use super::look::{Look, Overlay};
use super::place::Handle;
use super::shown::Shown;
use super::state::Viewer;
use super::worker::{Request, Status};

pub(super) use marks::{edges, marks};
pub(super) use progress::frame_times;

/// Most files that are offered.
const FILES: usize = 40;

/// Draws all panels.
pub(super) fn draw(
    viewer: &mut Viewer,
    ctx: &egui::Context,
    shown: &Shown,
    status: &Status,
    actions: &mut Vec<Action>,
) {
    if viewer.panels {
        egui::TopBottomPanel::top("bar").show(ctx, |ui| {
            ui.horizontal_wrapped(|ui| bar(viewer, ui, status, actions));
        });
        egui::SidePanel::right("inspector")
            .default_width(260.0)
            .show(ctx, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    inspector::inspector(viewer, ui, shown, actions);
                    ui.separator();
                    progress::progress(viewer, ui, status);
                });
            });
    }
    state_of_bake(viewer, ctx, shown, status);
    notes(viewer, ctx);
    if viewer.help {
        keys(viewer, ctx);
    }
    scales(viewer, ctx, shown);
}

fn bar(viewer: &mut Viewer, ui: &mut egui::Ui, status: &Status, actions: &mut Vec<Action>) {
    let mut chosen = Vec::new();
    let mut button = |ui: &mut egui::Ui, text: &str, hint: &str, action: Action| {
        if ui.button(text).on_hover_text(hint).clicked() {
            actions.push(action);
        }
    };
    ui.menu_button("File", |ui| {
        button(
            ui,
            "Save bake",
            "scene.glb, pages, bake.json (Ctrl+S)",
            Action::SaveBake,
        );
        button(
            ui,
            "Save edited scene",
            "glTF (Ctrl+Shift+S)",
            Action::SaveScene,
        );
        button(
            ui,
            "Save edits as script",
            "for rebake replay (Ctrl+H)",
            Action::SaveHistory,
        );
        ui.menu_button("Add a file", |ui| {
            let files = beside(&viewer.files.scene);
            if files.is_empty() {
                ui.weak("no other .gltf or .glb file lies beside the scene");
            }
            for file in files {
                button(ui, &file, "into the scene", Action::Add(file.clone()));
            }
        });
        button(ui, "Screenshot", "F12", Action::Screenshot);
        button(ui, "Quit", "Ctrl+Q", Action::Quit);
    });
    button(ui, "Undo", "Ctrl+Z", Action::Undo);
    button(ui, "Redo", "Ctrl+Shift+Z", Action::Redo);
    ui.separator();
    ui.menu_button(format!("Look: {}", viewer.look.words()[0]), |ui| {
        for look in Look::ALL {
            let [text, hint] = look.words();
            let there = look != Look::Error || viewer.has_reference;
            let label = egui::Button::selectable(viewer.look == look, text);
            let label = ui.add_enabled(there, label).on_hover_text(hint);
            let label = label.on_disabled_hover_text("start with --reference DIR");
            if label.clicked() && viewer.look != look {
                chosen.push(Action::Look(look));
            }
        }
    });
    ui.menu_button("Overlays", |ui| {
        for overlay in Overlay::ALL {
            let [text, hint] = overlay.words();
            let mut on = viewer.overlays.contains(&overlay);
            if ui.checkbox(&mut on, text).on_hover_text(hint).changed() {
                chosen.push(Action::Overlay(overlay));
            }
        }
    });
    ui.separator();
    for (handle, text) in [
        (Handle::Move, "Move"),
        (Handle::Turn, "Turn"),
        (Handle::Scale, "Scale"),
    ] {
        if ui.selectable_label(viewer.handle == handle, text).clicked() {
            chosen.push(Action::Handle(handle));
        }
    }
    ui.checkbox(&mut viewer.local, "own axes");
    ui.checkbox(&mut viewer.snap, "steps");
    if viewer.snap {
        let [metres, degrees, factor] = &mut viewer.steps;
        let (value, suffix) = match viewer.handle {
            Handle::Move => (metres, " m"),
            Handle::Turn => (degrees, "°"),
            Handle::Scale => (factor, "x"),
        };
        let field = egui::DragValue::new(value).speed(0.01).suffix(suffix);
        ui.add(field.range(1e-3..=1e3));
    }
    ui.separator();
    let mut by_hand = viewer.exposure.ev.is_some();
    if ui.checkbox(&mut by_hand, "EV").changed() {
        viewer.exposure.ev = by_hand.then(|| viewer.exposure.current_ev());
    }
    match &mut viewer.exposure.ev {
        Some(ev) => {
            ui.add(egui::DragValue::new(ev).speed(0.05).range(-20.0..=30.0));
        }
        None => {
            ui.weak(format!("{:.1}", viewer.exposure.current_ev()));
            let stops = &mut viewer.exposure.compensation;
            let field = egui::DragValue::new(stops).speed(0.05).range(-10.0..=10.0);
            ui.add(field.prefix("± "))
                .on_hover_text("stops brighter than measured");
        }
    }
    ui.separator();
    let text = if status.paused { "Go on" } else { "Pause" };
    button(ui, text, "P", Action::Pause);
    button(ui, "One update", "N", Action::Step);
    button(ui, "Rebake", "from the empty map", Action::StartOver(false));
    button(
        ui,
        "Rebake and compare",
        "from the empty map, then compare every bit",
        Action::StartOver(true),
    );
    button(ui, "?", "keys", Action::Help);
    actions.append(&mut chosen);
}

/// Names of the other glTF files in a scene's folder, in order.
fn beside(scene: &std::path::Path) -> Vec<String> {
    let folder = match scene.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => std::path::Path::new("."),
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| Some(entry.file_name().as_os_str()) != scene.file_name())
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| name.ends_with(".gltf") || name.ends_with(".glb"))
        .collect();
    names.sort();
    names.truncate(FILES);
    names
}

/// Says over the picture what it is, as long as it is not the finished light.
fn state_of_bake(viewer: &Viewer, ctx: &egui::Context, shown: &Shown, status: &Status) {
    let stands_in = viewer.look_of(shown, status) == Look::Unbaked;
    let text = match status.preparing {
        Some(what) => format!("not the scene's light yet · preparing: {what}"),
        None if stands_in => "not the scene's light yet · baking".to_owned(),
        None if status.paused => "paused".to_owned(),
        None => return,
    };
    egui::Area::new("state".into())
        .anchor(Align2::LEFT_BOTTOM, [12.0, -12.0])
        .interactable(false)
        .show(ctx, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| ui.label(RichText::new(text).strong()));
        });
}

fn notes(viewer: &mut Viewer, ctx: &egui::Context) {
    let notes = viewer.notes(ctx.input(|i| i.time));
    if notes.is_empty() {
        return;
    }
    egui::Area::new("notes".into())
        .anchor(Align2::LEFT_BOTTOM, [12.0, -48.0])
        .interactable(false)
        .show(ctx, |ui| {
            for note in notes {
                let color = if note.failed {
                    Color32::from_rgb(255, 150, 120)
                } else {
                    ui.visuals().strong_text_color()
                };
                egui::Frame::popup(ui.style())
                    .show(ui, |ui| ui.label(RichText::new(note.text).color(color)));
            }
        });
    ctx.request_repaint_after_secs(0.5);
}

/// Points around the window with the keys.
const AROUND_KEYS: f32 = 60.0;
/// What two columns of keys take, points.
const TWO_COLUMNS: f32 = 860.0;

fn keys(viewer: &mut Viewer, ctx: &egui::Context) {
    let moves = MOVES.iter().map(|(keys, text)| (keys.to_string(), *text));
    let click = [("left click".to_owned(), "select an object or a light")];
    let bindings = bindings();
    let bound = bindings.iter().filter(|(.., text)| !text.is_empty());
    let bound = bound.map(|(key, command, shift, _, text)| {
        let command = if *command { "Ctrl + " } else { "" };
        let shift = if *shift { "Shift + " } else { "" };
        (format!("{command}{shift}{}", key.symbol_or_name()), *text)
    });
    let all: Vec<(String, &str)> = moves.chain(click).chain(bound).collect();
    let room = ctx.content_rect().size() - egui::Vec2::splat(AROUND_KEYS);
    let columns = if room.x < TWO_COLUMNS { 1 } else { 2 };
    egui::Window::new("Keys")
        .open(&mut viewer.help)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .show(ctx, |ui| {
            ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
            let height = room.y - ui.spacing().interact_size.y;
            let scroll = egui::ScrollArea::vertical().max_height(height);
            scroll.show(ui, |ui| {
                ui.horizontal_top(|ui| {
                    for (column, rows) in all.chunks(all.len().div_ceil(columns)).enumerate() {
                        egui::Grid::new(column).striped(true).show(ui, |ui| {
                            for (keys, text) in rows {
                                ui.strong(keys);
                                ui.label(*text);
                                ui.end_row();
                            }
                        });
                    }
                });
            });
        });
}

/// The scales of what is shown in false colours, what is under the cursor, and which page is looked at.
fn scales(viewer: &mut Viewer, ctx: &egui::Context, shown: &Shown) {
    let look = viewer.look;
    let ends = viewer.scale_of(look, shown);
    let legend = Legend::of_look(look, ends, viewer.probe);
    let sketch = viewer.sketch.clone();
    let overlays: Vec<Legend> = sketch
        .iter()
        .flat_map(|s| s.scales.iter().map(Legend::of_overlay))
        .collect();
    if legend.is_none() && overlays.is_empty() && look != Look::Page {
        return;
    }
    egui::Area::new("scale".into())
        .anchor(Align2::LEFT_TOP, [12.0, 48.0])
        .show(ctx, |ui| {
            ui.horizontal_top(|ui| {
                if let Some(legend) = legend {
                    egui::Frame::popup(ui.style()).show(ui, |ui| {
                        ui.vertical(|ui| scale(viewer, ui, &legend));
                    });
                }
                for legend in overlays {
                    egui::Frame::popup(ui.style()).show(ui, |ui| {
                        ui.vertical(|ui| legend.draw(ui));
                    });
                }
                if look == Look::Page {
                    egui::Frame::popup(ui.style()).show(ui, |ui| page(viewer, ui, shown));
                }
            });
        });
}

/// A scale whose ends can be changed.
fn scale(viewer: &mut Viewer, ui: &mut egui::Ui, legend: &Legend) {
    legend.draw(ui);
    ui.label(legend.read_out());
    let mut ends = legend.ends;
    let factor = if legend.percent { 100.0 } else { 1.0 };
    ui.horizontal(|ui| {
        for end in &mut ends {
            let mut value = *end * factor;
            let speed = 0.02 * value;
            let field = egui::DragValue::new(&mut value).speed(speed);
            if ui.add(field.range(1e-4..=1e6)).changed() {
                *end = value / factor;
            }
        }
    });
    let changed = ends != legend.ends && ends[0] < ends[1];
    match viewer.look {
        Look::Error if changed => viewer.error_scale = ends,
        _ if changed => viewer.scale = Some(ends),
        Look::Lux if viewer.scale.is_some() && ui.small_button("fit").clicked() => {
            viewer.scale = None;
        }
        _ => {}
    }
}

/// Which page is looked at.
fn page(viewer: &mut Viewer, ui: &mut egui::Ui, shown: &Shown) {
    let Some(atlas) = &shown.atlas else {
        ui.label("there is no lightmap yet");
        return;
    };
    let pages = atlas.pages.max(1);
    let mut number = viewer.page.page.min(pages - 1) + 1;
    ui.horizontal(|ui| {
        ui.label("page");
        ui.add(egui::DragValue::new(&mut number).range(1..=pages));
        ui.label(format!("of {pages}, {0} x {0} texels", atlas.page_size));
    });
    viewer.page.page = number - 1;
    ui.weak("drag, wheel; click: select");
}

/// Asks for another slice of updates per frame.
pub(super) fn slice_of(ms: f32) -> Request {
    Request::Slice(std::time::Duration::from_secs_f32(ms / 1e3))
}

#[cfg(test)]
mod tests {
    use super::beside;

    #[test]
    fn offers_the_other_gltf_files_in_order() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.glb", "a.gltf", "scene.glb", "scene.bin"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(
            beside(&folder.path().join("scene.glb")),
            ["a.gltf", "b.glb"]
        );
        assert!(beside(&folder.path().join("none/scene.glb")).is_empty());
    }
}
