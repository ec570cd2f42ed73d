//! What lies on the picture: a bar with commands, the inspector, the bake's progress, notes, keys, marks in the scene.

mod inspector;
mod marks;
mod progress;

use egui::{Align2, Color32, RichText};

use super::display::Look;
use super::input::{Action, MOVES, bindings};
use super::place::Handle;
use super::shown::Shown;
use super::state::Viewer;
use super::worker::{Request, Status};

pub(super) use marks::marks;
pub(super) use progress::frame_times;

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
    if viewer.look == Look::Lux {
        scale(viewer, ctx, shown);
    }
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
        button(ui, "Screenshot", "F12", Action::Screenshot);
        button(ui, "Quit", "Ctrl+Q", Action::Quit);
    });
    button(ui, "Undo", "Ctrl+Z", Action::Undo);
    button(ui, "Redo", "Ctrl+Shift+Z", Action::Redo);
    ui.separator();
    for (look, text, hint) in [
        (Look::Lit, "Lit", "the scene in its light"),
        (Look::Light, "Light", "the light on grey surfaces"),
        (
            Look::Lux,
            "Lux",
            "irradiance in false colours, with a probe under the cursor",
        ),
    ] {
        let label = ui.selectable_label(viewer.look == look, text);
        if label.on_hover_text(hint).clicked() {
            chosen.push(Action::Look(look));
        }
    }
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

fn keys(viewer: &mut Viewer, ctx: &egui::Context) {
    egui::Window::new("Keys")
        .open(&mut viewer.help)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .show(ctx, |ui| {
            ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
            egui::Grid::new("keys")
                .num_columns(2)
                .striped(true)
                .show(ui, |ui| {
                    for (keys, text) in MOVES {
                        ui.strong(keys);
                        ui.label(text);
                        ui.end_row();
                    }
                    ui.strong("left click");
                    ui.label("select an object or a light");
                    ui.end_row();
                    for (key, command, shift, _, text) in bindings() {
                        if text.is_empty() {
                            continue;
                        }
                        let command = if command { "Ctrl + " } else { "" };
                        let shift = if shift { "Shift + " } else { "" };
                        ui.strong(format!("{command}{shift}{}", key.symbol_or_name()));
                        ui.label(text);
                        ui.end_row();
                    }
                });
        });
}

/// The false colours' scale, and the lux under the cursor.
fn scale(viewer: &mut Viewer, ctx: &egui::Context, shown: &Shown) {
    let [low, high] = viewer.scale.unwrap_or_else(|| shown.scale());
    egui::Area::new("scale".into())
        .anchor(Align2::LEFT_TOP, [12.0, 48.0])
        .show(ctx, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.strong("lux");
                let (rect, _) =
                    ui.allocate_exact_size(egui::vec2(86.0, 240.0), egui::Sense::hover());
                let bar = egui::Rect::from_min_size(rect.min, egui::vec2(22.0, rect.height()));
                let steps = 120;
                for i in 0..steps {
                    let share = (i as f32 + 0.5) / steps as f32;
                    let top = bar.bottom() - (i + 1) as f32 / steps as f32 * bar.height();
                    let height = bar.height() / steps as f32 + 0.5;
                    let line = egui::Rect::from_min_size(
                        egui::pos2(bar.left(), top),
                        egui::vec2(bar.width(), height),
                    );
                    ui.painter().rect_filled(line, 0.0, turbo(share));
                }
                let stops = (high / low).log2();
                let place = |lux: f32| bar.bottom() - (lux / low).log2() / stops * bar.height();
                for lux in marks::round_numbers(low, high) {
                    let at = egui::pos2(bar.right() + 6.0, place(lux));
                    let font = egui::TextStyle::Small.resolve(ui.style());
                    let color = ui.visuals().text_color();
                    let text = marks::short(lux);
                    ui.painter()
                        .text(at, Align2::LEFT_CENTER, text, font, color);
                }
                if let Some(lux) = viewer.probe {
                    let y = place(lux.clamp(low, high));
                    let stroke = egui::Stroke::new(2.0, Color32::WHITE);
                    ui.painter().hline(bar.x_range(), y, stroke);
                    ui.label(format!("here: {} lx", marks::short(lux)));
                } else {
                    ui.weak("here: -");
                }
                let mut ends = [low, high];
                ui.horizontal(|ui| {
                    for end in &mut ends {
                        let speed = 0.02 * *end;
                        ui.add(egui::DragValue::new(end).speed(speed).range(1e-4..=1e6));
                    }
                });
                if ends != [low, high] && ends[0] < ends[1] {
                    viewer.scale = Some(ends);
                }
                if viewer.scale.is_some() && ui.small_button("fit").clicked() {
                    viewer.scale = None;
                }
            });
        });
}

/// As in `view_tone.frag`.
pub(super) fn turbo(x: f32) -> Color32 {
    let fit = |c: [f32; 6]| {
        c.iter()
            .rev()
            .fold(0.0, |sum, c| sum * x + c)
            .clamp(0.0, 1.0)
    };
    let byte = |v: f32| (v * 255.0 + 0.5) as u8;
    Color32::from_rgb(
        byte(fit([
            0.135_721_4,
            4.615_392_6,
            -42.660_324,
            132.131_08,
            -152.942_4,
            59.286_38,
        ])),
        byte(fit([
            0.091_402_61,
            2.194_188_4,
            4.842_966_6,
            -14.185_034,
            4.277_298_5,
            2.829_566,
        ])),
        byte(fit([
            0.106_673_3,
            12.641_946,
            -60.582_047,
            110.362_77,
            -89.903_11,
            27.348_25,
        ])),
    )
}

/// Asks for another slice of updates per frame.
pub(super) fn slice_of(ms: f32) -> Request {
    Request::Slice(std::time::Duration::from_secs_f32(ms / 1e3))
}
