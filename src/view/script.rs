//! Scripts of the viewer: the lines of an edit script, and lines about cameras and pictures.
//!
//! ```text
//! {"do": "camera", "position": [0, 1, 3], "target": [0, 1, 0], "fov": 50, "frames": 60}
//! {"do": "camera", "name": "front"}
//! {"do": "frame", "count": 30, "updates": 4}
//! {"do": "look", "look": "lux", "scale": [1, 1000]}
//! {"do": "look", "look": "page", "page": 0, "center": [0.5, 0.5], "zoom": 2}
//! {"do": "overlay", "show": ["lights", "cells"]}
//! {"do": "exposure", "ev": 5}
//! ```

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::look::{Look, Overlay};
use crate::scene::edit::{Command, EditError};

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// An edit, undo, redo or wait.
    Command(Command),
    /// Of the viewer itself.
    View(View),
}

/// A line about what is seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum View {
    /// Goes to a place, or to a camera of the file.
    Camera {
        /// World, metres; else where the camera is.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        position: Option<[f32; 3]>,
        /// What is looked at; else the direction stays.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        target: Option<[f32; 3]>,
        /// Vertical field of view, degrees; else as it is.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fov: Option<f32>,
        /// A camera of the file, instead of a position.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        /// Pictures to take on the way there, the last one there; 0 jumps, and takes none.
        #[serde(default)]
        frames: u32,
    },
    /// Takes pictures. The map is worked on after each, for `--frame-ms`, or for so many updates.
    Frame {
        /// How many.
        #[serde(default = "one")]
        count: u32,
        /// Updates after each picture, instead of a time: then the same script gives the same pictures.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        updates: Option<u64>,
    },
    /// Chooses what is shown.
    Look {
        /// The lit scene, its light on grey, its texels, lux or error in false colours, a page of the lightmap.
        look: Look,
        /// Lux, or relative errors, at both ends of the false colours; else fitted to the scene.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        scale: Option<[f32; 2]>,
        /// Which page, from 0.
        #[serde(default)]
        page: u32,
        /// What of the page lies in the middle of the picture, as shares of width and height.
        #[serde(default = "middle")]
        center: [f32; 2],
        /// How much larger than what fits into the picture the page is shown.
        #[serde(default = "whole")]
        zoom: f32,
    },
    /// Lays something over the pictures from now on.
    Overlay {
        /// All of it; nothing: none.
        #[serde(default)]
        show: BTreeSet<Overlay>,
    },
    /// Sets the exposure.
    Exposure {
        /// EV at ISO 100; else by the picture.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ev: Option<f32>,
        /// Stops to add to the picture's own.
        #[serde(default)]
        compensation: f32,
    },
}

fn one() -> u32 {
    1
}

fn middle() -> [f32; 2] {
    [0.5; 2]
}

fn whole() -> f32 {
    1.0
}

const WORDS: [&str; 5] = ["camera", "frame", "look", "overlay", "exposure"];

impl Line {
    /// Reads one line.
    ///
    /// # Errors
    /// [`EditError::Syntax`], which says what is wrong with it.
    pub fn parse(line: &str) -> Result<Self, EditError> {
        #[derive(Deserialize)]
        struct Tag {
            r#do: String,
        }
        let ours =
            serde_json::from_str::<Tag>(line).is_ok_and(|t| WORDS.contains(&t.r#do.as_str()));
        if !ours {
            return match Command::parse(line) {
                Err(EditError::Syntax { why }) if why.starts_with("there is no edit") => {
                    let why = format!("{why}, or, in the viewer, {}", WORDS.join(", "));
                    Err(EditError::Syntax { why })
                }
                parsed => parsed.map(Self::Command),
            };
        }
        let wrong = |why: String| EditError::Syntax { why };
        let view: View = serde_json::from_str(line)
            .map_err(|e| wrong(e.to_string().replace(" at line 1 column", " at column")))?;
        match view.fault() {
            Some(why) => Err(wrong(why.into())),
            None => Ok(Self::View(view)),
        }
    }

    /// Reads a script: its lines with their numbers from 1; empty ones are none.
    ///
    /// # Errors
    /// The first line that is wrong, with its number.
    pub fn parse_all(text: &str) -> Result<Vec<(usize, Self)>, (usize, EditError)> {
        (1..)
            .zip(text.lines())
            .filter(|(_, line)| !line.trim().is_empty())
            .map(|(n, line)| Ok((n, Self::parse(line).map_err(|e| (n, e))?)))
            .collect()
    }
}

impl View {
    /// What serde lets pass.
    fn fault(&self) -> Option<&'static str> {
        match self {
            Self::Camera {
                position,
                target,
                name: Some(_),
                ..
            } if position.is_some() || target.is_some() => {
                Some("a camera has a \"name\" or a \"position\" and \"target\", not both")
            }
            Self::Camera {
                position, target, ..
            } if position
                .iter()
                .chain(target)
                .flatten()
                .any(|v| !v.is_finite()) =>
            {
                Some("a \"position\" or \"target\" is out of range")
            }
            Self::Camera { fov: Some(fov), .. } if !(1.0..=170.0).contains(fov) => {
                Some("\"fov\" must be between 1 and 170 degrees")
            }
            Self::Frame { count: 0, .. } => Some("\"count\" must be at least 1"),
            Self::Look {
                scale: Some([low, high]),
                ..
            } if !(0.0 < *low && low < high && high.is_finite()) => {
                Some("\"scale\" must be two numbers above 0, the smaller one first")
            }
            Self::Look { zoom, .. } if !(0.1..=1000.0).contains(zoom) => {
                Some("\"zoom\" must be between 0.1 and 1000")
            }
            Self::Look { center, .. } if !center.iter().all(|c| (0.0..=1.0).contains(c)) => {
                Some("\"center\" must be two shares between 0 and 1")
            }
            Self::Overlay { show } if show.contains(&Overlay::Charts) => {
                Some("charts are shown with {\"do\": \"look\", \"look\": \"page\"}")
            }
            Self::Exposure { ev: Some(ev), .. } if !(-20.0..=30.0).contains(ev) => {
                Some("\"ev\" must be between -20 and 30")
            }
            Self::Exposure { compensation, .. } if !(-20.0..=20.0).contains(compensation) => {
                Some("\"compensation\" must be between -20 and 20")
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_edits_and_views_and_numbers_them() {
        let text = concat!(
            r#"{"do":"camera","position":[0,1,3],"target":[0,1,0],"frames":2}"#,
            "\n\n",
            r#"{"do":"undo"}"#,
            "\n",
            r#"{"do":"frame"}"#,
        );
        let lines = Line::parse_all(text).unwrap();
        assert_eq!(lines.iter().map(|l| l.0).collect::<Vec<_>>(), [1, 3, 4]);
        assert_eq!(lines[1].1, Line::Command(Command::Undo));
        let frame = View::Frame {
            count: 1,
            updates: None,
        };
        assert_eq!(lines[2].1, Line::View(frame));
    }

    #[test]
    fn says_which_line_is_wrong_and_how() {
        for (line, what) in [
            (r#"{"do":"frame","count":0}"#, "at least 1"),
            (r#"{"do":"frame","size":3}"#, "unknown field `size`"),
            (
                r#"{"do":"camera","name":"a","position":[0,0,0]}"#,
                "not both",
            ),
            (r#"{"do":"camera","target":[0,1e300,0]}"#, "out of range"),
            (r#"{"do":"camera","fov":0}"#, "between 1 and 170"),
            (r#"{"do":"look","look":"nice"}"#, "unknown variant"),
            (
                r#"{"do":"look","look":"lux","scale":[5,5]}"#,
                "the smaller one first",
            ),
            (
                r#"{"do":"look","look":"page","zoom":0}"#,
                "between 0.1 and 1000",
            ),
            (r#"{"do":"overlay","show":["mist"]}"#, "unknown variant"),
            (
                r#"{"do":"overlay","show":["charts"]}"#,
                "\"look\": \"page\"",
            ),
            (r#"{"do":"exposure","ev":99}"#, "between -20 and 30"),
            (r#"{"do":"fly"}"#, "wait, or, in the viewer, camera, frame"),
            ("{", "EOF"),
        ] {
            let text = format!("\n{line}");
            let (number, error) = Line::parse_all(&text).unwrap_err();
            assert_eq!(number, 2);
            assert!(error.to_string().contains(what), "{line}: {error}");
        }
    }
}
