//! What a picture shows of the surfaces, and what is laid over them.

use serde::{Deserialize, Serialize};

use crate::bake::shared::{
    LOOK_ERROR, LOOK_LIGHT, LOOK_LIT, LOOK_LUX, LOOK_PAGE, LOOK_TEXELS, LOOK_UNBAKED, LUX_STEP,
};

/// What a picture shows.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// The scene in its light.
    #[default]
    Lit,
    /// The scene in a light that stands in until there is a map.
    Unbaked,
    /// The light on grey surfaces.
    Light,
    /// Lux in false colours.
    Lux,
    /// Where the lightmap's texels lie.
    Texels,
    /// How far the light is from a reference, in false colours.
    Error,
    /// A page of the lightmap, laid out flat.
    Page,
}

impl Look {
    /// All that can be asked for, in the order in which they are gone through.
    pub const ALL: [Self; 6] = [
        Self::Lit,
        Self::Light,
        Self::Lux,
        Self::Texels,
        Self::Page,
        Self::Error,
    ];

    /// For people, with what it is.
    pub fn words(self) -> [&'static str; 2] {
        match self {
            Self::Lit => ["Lit", "the scene in its light"],
            Self::Unbaked => ["Unbaked", "the scene in a light that stands in"],
            Self::Light => ["Light", "the light on grey surfaces"],
            Self::Lux => [
                "Lux",
                "irradiance in false colours, with a probe under the cursor",
            ],
            Self::Texels => ["Texels", "a checker of the lightmap's texels"],
            Self::Error => [
                "Error",
                "relative error against --reference in false colours, with a probe under the cursor",
            ],
            Self::Page => ["Page", "a page of the lightmap with its charts"],
        }
    }

    pub(super) fn constant(self) -> u32 {
        match self {
            Self::Lit => LOOK_LIT,
            Self::Unbaked => LOOK_UNBAKED,
            Self::Light => LOOK_LIGHT,
            Self::Lux => LOOK_LUX,
            Self::Texels => LOOK_TEXELS,
            Self::Error => LOOK_ERROR,
            Self::Page => LOOK_PAGE,
        }
    }

    /// What a unit of the picture's radiance stands for, where it is shown in false colours.
    pub fn unit(self) -> Option<f32> {
        match self {
            Self::Lux => Some(LUX_STEP as f32),
            Self::Error => Some(1.0),
            _ => None,
        }
    }

    /// Whether the exposure follows pictures of it.
    pub fn is_metered(self) -> bool {
        matches!(self, Self::Lit | Self::Light)
    }
}

/// Something that is laid over the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Overlay {
    /// The polygons, disks and points that stand for the light, by their flux.
    Lights,
    /// The cells that they stand for, by their flux.
    Cells,
    /// The virtual point lights that these are made of, in their colours.
    Vpls,
    /// The cells whose light is not right yet, by how many lumens of it.
    Invalid,
    /// Outlines of charts, on a page of the lightmap.
    Charts,
}

impl Overlay {
    /// All that lie in the scene.
    pub const ALL: [Self; 4] = [Self::Lights, Self::Cells, Self::Vpls, Self::Invalid];

    /// For people, with what it is.
    pub fn words(self) -> [&'static str; 2] {
        match self {
            Self::Lights => [
                "Virtual lights",
                "polygons, disks and points that stand for the light, by their flux",
            ],
            Self::Cells => [
                "Cells",
                "the octree's cells that they stand for, by their flux",
            ],
            Self::Vpls => ["VPLs", "the points where light paths were sent on"],
            Self::Invalid => [
                "Invalid flux",
                "cells whose light is not right yet, by how many lumens of it",
            ],
            Self::Charts => ["Charts", "outlines of charts on a page"],
        }
    }
}
