//! Why an edit was refused, in one line that names the place and the way out.

use super::super::error::{SceneError, one_line};

/// Why an edit was refused. Scene and document are then as they were. Every message is a single line.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// The line is no edit.
    #[error("{why}")]
    Syntax {
        /// What is wrong with it and what would be right.
        why: String,
    },
    /// No node or material of that name or number.
    #[error("there is no {kind} {name}; {way_out}")]
    Unknown {
        /// `node` or `material`.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// What there is.
        way_out: String,
    },
    /// Several nodes or materials of that name.
    #[error("{count} {kind}s are called \"{name}\": give one of their numbers, {numbers}")]
    Ambiguous {
        /// `node` or `material`.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// How many there are.
        count: usize,
        /// The first of their indices.
        numbers: String,
    },
    /// A value that makes no sense there.
    #[error("{place}, \"{field}\": {why}")]
    Field {
        /// The node or material.
        place: String,
        /// The edit's field.
        field: &'static str,
        /// What is wrong and what would be right.
        why: String,
    },
    /// The edited scene could not be baked.
    #[error("{place}: {why}")]
    Scene {
        /// Where the edited scene is wrong.
        place: String,
        /// What would be wrong with it and the way out.
        why: String,
    },
    /// The file to be added cannot be.
    #[error("\"{file}\" cannot be added: {cause}")]
    File {
        /// Its name in the edit.
        file: String,
        /// What is wrong with it.
        cause: Box<SceneError>,
    },
    /// Nothing to take back or to do again.
    #[error(
        "there is nothing to {what}; it takes back edits of this session, the last one first, and an edit ends what can be done again"
    )]
    Nothing {
        /// `undo` or `redo`.
        what: &'static str,
    },
}

impl EditError {
    pub(super) fn field(place: &str, field: &'static str, why: impl std::fmt::Display) -> Self {
        Self::Field {
            place: place.into(),
            field,
            why: why.to_string(),
        }
    }

    pub(super) fn file(file: &str, cause: SceneError) -> Self {
        Self::File {
            file: one_line(file),
            cause: Box::new(cause),
        }
    }
}

impl From<SceneError> for EditError {
    fn from(error: SceneError) -> Self {
        match error {
            // Its way out is for files.
            SceneError::Invalid { place, why } => Self::Scene {
                place,
                why: format!("{why}; choose other values"),
            },
            error => Self::Scene {
                place: "the edited scene".into(),
                why: error.to_string(),
            },
        }
    }
}
