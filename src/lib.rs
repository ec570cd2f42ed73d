//! `rebake` bakes lightmaps from glTF scenes by many-light global illumination, and updates them when the scene is edited.
//!
//! The modules stand in the order of the data's way; dependencies run one way:
//! `trace` <- `gpu`, `scene` <- `lightmap`, `transport` <- `cluster` <- `bake` <- `view` <- `bench`.
//!
//! ```text
//! glTF -> scene -> unwrap -> texels                          what is lit, and where its light is kept
//!           |                  |
//!           v                  |
//!    lights -> paths -> VPLs -> octree -> selected cells -> virtual lights     how light travels, and what stands for it
//!           ^                                   |               |
//!         edits -> validation -> invalid flux -> schedule -> update {subtract, add}
//!                                                               |
//!                         [cube shadow -> accumulate]* -> resolve -> EXR + glTF | viewer
//! ```

pub mod trace;

pub mod gpu;
pub mod scene;

pub mod lightmap;
pub mod transport;

pub mod cluster;

pub mod bake;

pub mod view;

pub mod bench;
