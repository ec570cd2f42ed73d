//! Why a scene has no atlas.

/// Why there is no atlas.
#[derive(Debug, thiserror::Error)]
pub enum LightmapError {
    /// Nothing to light.
    #[error("the scene has no surface: add a mesh to a node of the default scene")]
    NoSurface,
    /// An option out of range.
    #[error("{option} must be {requirement}")]
    Option {
        /// As on the command line.
        option: &'static str,
        /// What would be right.
        requirement: &'static str,
    },
    /// Positions or a transform with NaN or infinity.
    #[error(
        "object '{object}' has a position or a transform that is not a number: repair it in the modelling tool"
    )]
    NotFinite {
        /// The object's name.
        object: String,
    },
    /// One object is larger than a page.
    #[error(
        "object '{object}' needs {width} x {height} texels, and a page has {page_size} x {page_size}: lower --density or --texels, raise --page-size, or split the object"
    )]
    TooLarge {
        /// The object's name.
        object: String,
        /// Texels.
        width: u64,
        /// Texels.
        height: u64,
        /// Texels.
        page_size: u32,
    },
    /// More texels than can be addressed.
    #[error(
        "{pages} pages of {page_size} x {page_size} are more than can be addressed: lower --density, --texels or --page-size"
    )]
    TooManyPages {
        /// Number of pages.
        pages: usize,
        /// Texels.
        page_size: u32,
    },
    /// Unwrapping failed.
    #[error("object '{object}' cannot be unwrapped ({reason}): give it a TEXCOORD_1, or split it")]
    Unwrap {
        /// The object's name.
        object: String,
        /// From the unwrapper.
        reason: String,
    },
    /// A written atlas does not fit the scene.
    #[error(
        "object '{object}' does not fit the recorded atlas ({reason}): repeat with the scene.glb that was written beside it"
    )]
    Repeat {
        /// The object's name.
        object: String,
        /// What does not fit.
        reason: String,
    },
}
