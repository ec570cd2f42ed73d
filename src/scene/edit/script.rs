//! A script's lines: edits, and what else a session can be told.

use serde::{Deserialize, Serialize};

use super::super::error::one_line;
use super::{Edit, EditError};

/// A line of a script.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Changes the scene.
    Edit(Edit),
    /// `{"do": "undo"}`: takes back the last edit that has not been taken back.
    Undo,
    /// `{"do": "redo"}`: does again what was taken back last.
    Redo,
    /// `{"do": "wait", "until": …}`: lets the bake go on before the next line.
    Wait(Until),
}

/// How long to wait.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Until {
    /// Until nothing is left to do.
    Converged,
    /// For so many updates.
    Updates(u64),
    /// For so long, seconds; finite and not negative.
    Seconds(f64),
}

const WORDS: [&str; 9] = [
    "transform",
    "light",
    "material",
    "add",
    "copy",
    "remove",
    "undo",
    "redo",
    "wait",
];

impl Command {
    /// Reads one line.
    ///
    /// # Errors
    /// [`EditError::Syntax`], which says what is wrong with it.
    pub fn parse(line: &str) -> Result<Self, EditError> {
        #[derive(Deserialize)]
        struct Tag {
            r#do: String,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Bare {
            #[serde(rename = "do")]
            _do: String,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Wait {
            #[serde(rename = "do")]
            _do: String,
            until: Until,
        }
        let tag: Tag = serde_json::from_str(line).map_err(|e| syntax("no edit", &e))?;
        let word = tag.r#do.as_str();
        let wrong = |e| syntax(&format!("no \"{word}\""), &e);
        match word {
            "undo" | "redo" => {
                serde_json::from_str::<Bare>(line).map_err(wrong)?;
                Ok(if word == "undo" {
                    Self::Undo
                } else {
                    Self::Redo
                })
            }
            "wait" => {
                let wait: Wait = serde_json::from_str(line).map_err(wrong)?;
                match wait.until {
                    Until::Seconds(s) if !(s.is_finite() && s >= 0.0) => Err(EditError::Syntax {
                        why: "\"until\": seconds must be a finite number, 0 or more".into(),
                    }),
                    until => Ok(Self::Wait(until)),
                }
            }
            _ if WORDS.contains(&word) => serde_json::from_str(line).map(Self::Edit).map_err(wrong),
            _ => Err(EditError::Syntax {
                why: format!(
                    "there is no edit \"{}\"; \"do\" is one of {}",
                    one_line(word),
                    WORDS.join(", ")
                ),
            }),
        }
    }
}

impl Command {
    /// The line that [`Command::parse`] reads it from.
    ///
    /// # Errors
    /// Numbers that JSON has no words for.
    pub fn to_line(&self) -> serde_json::Result<String> {
        Ok(match self {
            Self::Edit(edit) => serde_json::to_string(edit)?,
            Self::Undo => r#"{"do":"undo"}"#.into(),
            Self::Redo => r#"{"do":"redo"}"#.into(),
            Self::Wait(until) => serde_json::json!({ "do": "wait", "until": until }).to_string(),
        })
    }
}

fn syntax(what: &str, error: &serde_json::Error) -> EditError {
    let why: String = error
        .to_string()
        .chars()
        .take(300)
        .map(|c| if c.is_control() { '?' } else { c })
        .collect();
    // There is but one line.
    let why = why.replace(" at line 1 column", " at column");
    EditError::Syntax {
        why: format!("this is {what}: {why}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn refusal(line: &str) -> String {
        match Command::parse(line) {
            Ok(command) => panic!("{line} was read as {command:?}"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn reads_every_line_of_the_manual_and_writes_it_back() {
        let edits = [
            json!({"do": "transform", "node": "small.box", "translation": [1.0, 2.0, 3.5], "rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0, 1.0, 2.0]}),
            json!({"do": "transform", "node": 7, "scale": [1.0, 1.0, 2.0]}),
            json!({"do": "light", "node": "lamp", "intensity": 30.0, "color": [1.0, 0.5, 0.25], "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}}),
            json!({"do": "material", "material": "wall", "baseColorFactor": [1.0, 0.5, 0.25, 1.0], "emissiveFactor": [0.0, 0.0, 1.0], "emissiveStrength": 5.0}),
            json!({"do": "add", "file": "chair.glb", "name": "chair2", "parent": "room"}),
            json!({"do": "copy", "node": "chair", "name": "chair3"}),
            json!({"do": "remove", "node": "chair"}),
        ];
        for edit in edits {
            let Ok(Command::Edit(read)) = Command::parse(&edit.to_string()) else {
                panic!("{edit}");
            };
            assert_eq!(serde_json::to_value(&read).unwrap(), edit);
            let line = Command::Edit(read.clone()).to_line().unwrap();
            assert_eq!(Command::parse(&line).unwrap(), Command::Edit(read));
        }
        let wait = |line| match Command::parse(line) {
            Ok(Command::Wait(until)) => until,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            wait(r#"{"do":"wait","until":"converged"}"#),
            Until::Converged
        );
        assert_eq!(
            wait(r#"{"do":"wait","until":{"updates":9}}"#),
            Until::Updates(9)
        );
        assert_eq!(
            wait(r#"{"until":{"seconds":0.5},"do":"wait"}"#),
            Until::Seconds(0.5)
        );
        assert_eq!(Command::parse(r#"{"do":"undo"}"#).unwrap(), Command::Undo);
        assert_eq!(Command::parse(r#"{"do":"redo"}"#).unwrap(), Command::Redo);
        for until in [Until::Converged, Until::Updates(9), Until::Seconds(0.5)] {
            let line = Command::Wait(until).to_line().unwrap();
            assert_eq!(Command::parse(&line).unwrap(), Command::Wait(until));
        }
    }

    #[test]
    fn says_what_is_wrong_with_a_line() {
        for (line, what) in [
            ("", "EOF"),
            ("[]", "expected"),
            ("{\"do\": 3}", "expected a string"),
            (r#"{"do": "explode"}"#, "one of transform, light"),
            (r#"{"do": "undo", "twice": true}"#, "unknown field `twice`"),
            (r#"{"do": "undo", "do": "redo"}"#, "duplicate field"),
            (r#"{"do": "transform"}"#, "missing field `node`"),
            (
                r#"{"do": "transform", "node": 1.5}"#,
                "a name in quotes or an index",
            ),
            (
                r#"{"do": "transform", "node": -1}"#,
                "a name in quotes or an index",
            ),
            (
                r#"{"do": "transform", "node": 4294967296}"#,
                "a name in quotes or an index",
            ),
            (
                r#"{"do": "transform", "node": "a", "node": "b"}"#,
                "duplicate field",
            ),
            (
                r#"{"do": "transform", "node": "a", "translation": null}"#,
                "null",
            ),
            (
                r#"{"do": "transform", "node": "a", "translation": [null, 0, 0]}"#,
                "null",
            ),
            (
                r#"{"do": "transform", "node": "a", "translation": [1e999, 0, 0]}"#,
                "out of range",
            ),
            (
                r#"{"do": "transform", "node": "a", "translation": [NaN, 0, 0]}"#,
                "expected",
            ),
            (
                r#"{"do": "transform", "node": "a", "translation": [0, 0]}"#,
                "invalid length 2",
            ),
            (
                r#"{"do": "transform", "node": "a", "position": [0, 0, 0]}"#,
                "unknown field `position`",
            ),
            (r#"{"do": "wait", "until": "doomsday"}"#, "unknown variant"),
            (r#"{"do": "wait", "until": {"seconds": -1}}"#, "0 or more"),
            (r#"{"do": "wait"}"#, "missing field `until`"),
        ] {
            let message = refusal(line);
            assert!(
                message.contains(what) && !message.contains('\n'),
                "{line}: {message}"
            );
        }
        let nested = "[".repeat(100_000) + &"]".repeat(100_000);
        let deep = format!(r#"{{"do": "copy", "node": {nested}}}"#);
        assert!(refusal(&deep).contains("recursion limit"));
        assert!(refusal(&format!(r#"{{"do": "{}"}}"#, "x\\n".repeat(100_000))).len() < 400);
    }
}
