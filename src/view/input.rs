//! Keys and mouse: what they ask for.

use egui::{Key, Modifiers, PointerButton};
use glam::Vec2;

use super::camera::Motion;
use super::look::{Look, Overlay};
use super::place::Handle;

/// Radians that a point of mouse movement turns the head.
const TURN: f32 = 0.004;
/// How much a notch of the wheel changes speed or distance.
const NOTCH: f32 = 1.2;

/// Something to do once.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Close the window.
    Quit,
    /// Show or hide the keys.
    Help,
    /// Show or hide the panels.
    Panels,
    /// Look at the selection, or at everything.
    Focus,
    /// Go to a camera of the file, from 0.
    Camera(usize),
    /// Take the last edit back.
    Undo,
    /// Do it again.
    Redo,
    /// Remove the selection.
    Delete,
    /// Add what a file beside the scene shows.
    Add(String),
    /// Copy the selection.
    Duplicate,
    /// Select nothing.
    Deselect,
    /// Stop working on the map, or go on.
    Pause,
    /// One update.
    Step,
    /// Write the bake.
    SaveBake,
    /// Write the edits as a script.
    SaveHistory,
    /// Write the edited scene.
    SaveScene,
    /// Write the window's picture.
    Screenshot,
    /// Bake from nothing; with `true`, compare with what is there.
    StartOver(bool),
    /// Show this, or the lit scene again.
    Look(Look),
    /// Lay this over the picture, or take it away.
    Overlay(Overlay),
    /// Show the next thing.
    NextLook,
    /// What dragging does.
    Handle(Handle),
    /// The node's own axes or the world's.
    Axes,
    /// In steps or freely.
    Snap,
    /// Select a node.
    Select(u32),
}

/// Key, with the command key, with shift, what it does, for people.
type Binding = (Key, bool, bool, Action, &'static str);

/// All keys but those that move the camera.
pub fn bindings() -> Vec<Binding> {
    let key = |key, action, text| (key, false, false, action, text);
    vec![
        key(
            Key::Questionmark,
            Action::Help,
            "show or hide the keys (also F1)",
        ),
        key(Key::F1, Action::Help, ""),
        key(
            Key::F,
            Action::Focus,
            "focus on the selection, or on everything",
        ),
        key(Key::T, Action::Handle(Handle::Move), "handles move"),
        key(Key::R, Action::Handle(Handle::Turn), "handles turn"),
        key(Key::Y, Action::Handle(Handle::Scale), "handles scale"),
        key(
            Key::X,
            Action::Axes,
            "along the world's axes or the object's",
        ),
        key(
            Key::G,
            Action::Snap,
            "in steps or freely (Ctrl while dragging: in steps)",
        ),
        key(Key::Delete, Action::Delete, "remove the selection"),
        (
            Key::D,
            true,
            false,
            Action::Duplicate,
            "duplicate the selection",
        ),
        (Key::Z, true, false, Action::Undo, "undo"),
        (Key::Z, true, true, Action::Redo, "redo (also Ctrl+Y)"),
        (Key::Y, true, false, Action::Redo, ""),
        (Key::S, true, false, Action::SaveBake, "save the bake"),
        (
            Key::S,
            true,
            true,
            Action::SaveScene,
            "save the edited scene",
        ),
        (
            Key::H,
            true,
            false,
            Action::SaveHistory,
            "save the edits as a script",
        ),
        key(Key::F12, Action::Screenshot, "screenshot"),
        key(
            Key::L,
            Action::NextLook,
            "lit, light on grey, lux, texels, page, error",
        ),
        key(Key::M, Action::Look(Look::Page), "a page of the lightmap"),
        key(Key::K, Action::Look(Look::Texels), "the lightmap's texels"),
        key(Key::V, Action::Overlay(Overlay::Lights), "virtual lights"),
        key(
            Key::C,
            Action::Overlay(Overlay::Cells),
            "the octree's cells",
        ),
        key(
            Key::B,
            Action::Overlay(Overlay::Vpls),
            "virtual point lights",
        ),
        key(
            Key::I,
            Action::Overlay(Overlay::Invalid),
            "invalid flux by cell",
        ),
        key(Key::P, Action::Pause, "pause the bake, or go on"),
        key(Key::N, Action::Step, "one update"),
        key(Key::H, Action::Panels, "show or hide the panels"),
        key(Key::Escape, Action::Deselect, "select nothing"),
        (Key::Q, true, false, Action::Quit, "quit"),
    ]
}

/// How the camera is moved, for people.
pub const MOVES: [(&str, &str); 6] = [
    (
        "W A S D, E, Q",
        "fly ahead, left, back, right, up, down (Shift: four times as fast)",
    ),
    ("right drag", "look around; wheel meanwhile: flying speed"),
    (
        "Alt + left drag, middle drag",
        "circle around what is looked at",
    ),
    ("Shift + middle drag", "shift the picture"),
    ("wheel", "nearer, farther"),
    ("1 ... 9", "cameras of the file; pages of the lightmap"),
];

/// What the keys that were pressed ask for. None while something is being typed.
pub fn actions(ctx: &egui::Context) -> Vec<Action> {
    if ctx.wants_keyboard_input() {
        return Vec::new();
    }
    let digits = [
        Key::Num1,
        Key::Num2,
        Key::Num3,
        Key::Num4,
        Key::Num5,
        Key::Num6,
        Key::Num7,
        Key::Num8,
        Key::Num9,
    ];
    let bindings = bindings();
    // Keys count with what was held when they were pressed, not with what is held when the frame comes.
    let action = |event: &egui::Event| {
        let egui::Event::Key {
            key,
            pressed: true,
            repeat: false,
            modifiers: held,
            ..
        } = event
        else {
            return None;
        };
        if let Some(camera) = digits.iter().position(|d| d == key) {
            return (*held == Modifiers::NONE).then_some(Action::Camera(camera));
        }
        let bound = |(k, command, shift, ..): &&Binding| {
            // "?" takes a shift on most keyboards.
            let shift = *key == Key::Questionmark || held.shift == *shift;
            k == key && held.command == *command && shift && !held.alt
        };
        bindings.iter().find(bound).map(|b| b.3.clone())
    };
    ctx.input(|i| i.events.iter().filter_map(action).collect())
}

/// Takes out of a frame's events what is typed after a click: where it goes is known when the click has been taken in, so it is the
/// next frame's.
pub(super) fn after_click(events: &mut Vec<egui::Event>) -> Vec<egui::Event> {
    use egui::Event;
    let clicked = |e: &Event| matches!(e, Event::PointerButton { pressed: false, .. });
    let typed = |e: &Event| matches!(e, Event::Key { .. } | Event::Text(_) | Event::Ime(_));
    let end = events.iter().position(clicked).and_then(|click| {
        let typed = events[click..].iter().position(typed);
        typed.map(|typed| click + typed)
    });
    events.split_off(end.unwrap_or(events.len()))
}

/// A frame's movement of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Navigation {
    /// Flying.
    pub motion: Motion,
    /// Seconds since the last frame, times what hurrying adds.
    pub seconds: f32,
    /// Radians to the left and up, around the camera.
    pub look: Vec2,
    /// Radians to the left and up, around the target.
    pub orbit: Vec2,
    /// Shares of the picture's height.
    pub pan: Vec2,
    /// Factor of the distance to the target.
    pub zoom: f32,
    /// Factor of the flying speed.
    pub speed: Option<f32>,
    /// Whether the camera moves, or is about to.
    pub moves: bool,
}

/// What keys and mouse ask of the camera; `area` is the picture.
pub fn navigation(ctx: &egui::Context, area: &egui::Response) -> Navigation {
    let typing = ctx.wants_keyboard_input();
    let over = area.hovered() || area.dragged();
    ctx.input(|i| {
        let down = |key| !typing && i.key_down(key) && !i.modifiers.command;
        let axis = |plus, minus| f32::from(u8::from(down(plus))) - f32::from(u8::from(down(minus)));
        let motion = Motion {
            ahead: axis(Key::W, Key::S),
            right: axis(Key::D, Key::A),
            rise: axis(Key::E, Key::Q),
        };
        let drag = i.pointer.delta();
        let with = |button| area.dragged_by(button);
        let turn = Vec2::new(-drag.x, -drag.y) * TURN;
        let orbits = with(PointerButton::Primary) && i.modifiers.alt
            || with(PointerButton::Middle) && !i.modifiers.shift;
        let looks = with(PointerButton::Secondary);
        let pans = with(PointerButton::Middle) && i.modifiers.shift;
        let wheel = if over {
            i.raw_scroll_delta.y / 50.0
        } else {
            0.0
        };
        let zero = |yes: bool, v: Vec2| if yes { v } else { Vec2::ZERO };
        Navigation {
            motion,
            // After a pause, not all of it at once.
            seconds: i.stable_dt.min(0.1) * if i.modifiers.shift { 4.0 } else { 1.0 },
            look: zero(looks, turn),
            orbit: zero(orbits, turn),
            pan: zero(
                pans,
                Vec2::new(-drag.x, drag.y) / area.rect.height().max(1.0),
            ),
            zoom: if looks { 1.0 } else { NOTCH.powf(-wheel) },
            speed: (looks && wheel != 0.0).then(|| NOTCH.powf(wheel)),
            moves: motion != Motion::default() || looks || orbits || pans || wheel != 0.0,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_after_a_click_waits_for_it() {
        let button = |pressed| egui::Event::PointerButton {
            pos: egui::Pos2::ZERO,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        let text = |text: &str| egui::Event::Text(text.into());
        let mut events = vec![
            text("a"),
            button(true),
            button(false),
            text("b"),
            button(true),
        ];
        assert_eq!(after_click(&mut events), [text("b"), button(true)]);
        assert_eq!(events, [text("a"), button(true), button(false)]);
        assert!(
            after_click(&mut events).is_empty(),
            "nothing is typed after it"
        );
        assert_eq!(events.len(), 3);
    }

    /// A frame in which keys are pressed.
    fn press(ctx: &egui::Context, keys: &[Key], modifiers: Modifiers) -> Vec<Action> {
        let event = |key: &Key| egui::Event::Key {
            key: *key,
            physical_key: None,
            pressed: true,
            repeat: false,
            modifiers,
        };
        let input = egui::RawInput {
            modifiers,
            events: keys.iter().map(event).collect(),
            ..Default::default()
        };
        let mut found = Vec::new();
        let _ = ctx.run(input, |ctx| found = actions(ctx));
        found
    }

    #[test]
    fn keys_do_what_their_list_says_and_no_two_the_same() {
        for (key, command, shift, action, _) in bindings() {
            // Of its own: a key that is pressed twice and never released repeats.
            let ctx = egui::Context::default();
            let modifiers = Modifiers {
                command,
                ctrl: command,
                shift,
                ..Modifiers::NONE
            };
            assert_eq!(press(&ctx, &[key], modifiers), [action], "{key:?}");
        }
        assert_eq!(
            press(&egui::Context::default(), &[Key::Num3], Modifiers::NONE),
            [Action::Camera(2)]
        );
        let ctx = egui::Context::default();
        assert_eq!(press(&ctx, &[Key::W], Modifiers::NONE), []);
    }

    #[test]
    fn nothing_is_done_while_something_is_typed() {
        let ctx = egui::Context::default();
        let mut text = String::new();
        let mut frame = || {
            let _ = ctx.run(egui::RawInput::default(), |ctx| {
                egui::CentralPanel::default().show(ctx, |ui| {
                    ui.text_edit_singleline(&mut text).request_focus();
                });
            });
        };
        frame();
        frame();
        assert!(ctx.wants_keyboard_input());
        assert_eq!(press(&ctx, &[Key::Delete], Modifiers::NONE), []);
    }
}
