//! Constants that Rust and GLSL share: the build script hands each to the shader compiler as a macro of the same name.

/// Name and value of each, for the build script.
pub const MACROS: &[(&str, u32)] = &[
    ("NONE", NONE),
    ("TILE", TILE),
    ("CHUNK", CHUNK),
    ("GROUP", GROUP),
    ("LEVELS", LEVELS),
    ("BATCH", BATCH),
    ("BLOCKS", BLOCKS),
    ("VIEW_BLOCKS", VIEW_BLOCKS),
    ("FACES", FACES),
    ("PART_SEEN", PART_SEEN),
    ("PART_REST", PART_REST),
    ("KEPT_NOTHING", KEPT_NOTHING),
    ("KEPT_BESIDE", KEPT_BESIDE),
    ("KEPT_BOTH", KEPT_BOTH),
    ("KEPT_ALL", KEPT_ALL),
    ("LIST_ROW", LIST_ROW),
    ("MAX_VERTICES", MAX_VERTICES),
    ("VIEW_HEMICUBE", VIEW_HEMICUBE),
    ("VIEW_ORTHOGRAPHIC", VIEW_ORTHOGRAPHIC),
    ("LIGHT_POLYGON", LIGHT_POLYGON),
    ("LIGHT_DISK", LIGHT_DISK),
    ("LIGHT_POINT", LIGHT_POINT),
    ("LIGHT_SPOT", LIGHT_SPOT),
    ("LIGHT_DIRECTIONAL", LIGHT_DIRECTIONAL),
    ("FORM_CLIPPED", FORM_CLIPPED),
    ("FORM_POLYGON", FORM_POLYGON),
    ("FORM_DISK", FORM_DISK),
    ("FORM_PUNCTUAL", FORM_PUNCTUAL),
    ("FORM_DIRECTIONAL", FORM_DIRECTIONAL),
    ("FORMS", FORMS),
    ("LARGE_ROWS", LARGE_ROWS),
    ("SEARCH_TAPS", SEARCH_TAPS),
    ("FILTER_TAPS", FILTER_TAPS),
    ("WRAP_REPEAT", WRAP_REPEAT),
    ("WRAP_MIRROR", WRAP_MIRROR),
    ("WRAP_CLAMP", WRAP_CLAMP),
    ("UV_UNIT", UV_UNIT),
    ("UV_REACH", UV_REACH),
    ("CLAIM_EDGE", CLAIM_EDGE),
    ("CLAIM_FAR_EDGE", CLAIM_FAR_EDGE),
    ("CLAIM_VERTEX", CLAIM_VERTEX),
    ("LOOK_LIT", LOOK_LIT),
    ("LOOK_UNBAKED", LOOK_UNBAKED),
    ("LOOK_LIGHT", LOOK_LIGHT),
    ("LOOK_LUX", LOOK_LUX),
    ("LOOK_TEXELS", LOOK_TEXELS),
    ("LOOK_ERROR", LOOK_ERROR),
    ("LOOK_PAGE", LOOK_PAGE),
    ("LUX_STEP", LUX_STEP),
];

/// No index.
pub const NONE: u32 = u32::MAX;
/// Texels per tile: one workgroup of the accumulation.
pub const TILE: u32 = 64;
/// Triangles per chunk: one workgroup of the shadow pass.
pub const CHUNK: u32 = 64;
/// Chunks of a group at most.
pub const GROUP: u32 = 32;
/// What a group may be drawn as: its triangles, or fewer that stand for them.
pub const LEVELS: u32 = 4;
/// Rows of a large triangle that one workgroup draws, at least 8 at a time: lavapipe ends an invocation's loops after 65,535 rounds in
/// all, and the widest map has 8,192 columns.
pub const LARGE_ROWS: u32 = 32;
/// Lookups that find a soft shadow's mean blocker, and those that filter over its penumbra.
pub const SEARCH_TAPS: u32 = 5;
/// See [`SEARCH_TAPS`].
pub const FILTER_TAPS: u32 = 8;
/// `Cutout.wrap`: two bits an axis.
pub const WRAP_REPEAT: u32 = 0;
/// `Cutout.wrap`.
pub const WRAP_MIRROR: u32 = 1;
/// `Cutout.wrap`.
pub const WRAP_CLAMP: u32 = 2;
/// Most lights per batch: one bit each in a tile's mask.
pub const BATCH: u32 = 32;
/// Blocks of pixels along the edge of a hemicube's top face, by which is told what is hidden.
pub const BLOCKS: u32 = 32;
/// Blocks of a hemicube.
pub const VIEW_BLOCKS: u32 = 3 * BLOCKS * BLOCKS;
/// Faces of a hemicube.
pub const FACES: u32 = 5;
/// Parts of the map, a bit each: what a camera sees.
pub const PART_SEEN: u32 = 1;
/// What it does not.
pub const PART_REST: u32 = 2;
/// `View.kept`: it is drawn.
pub const KEPT_NOTHING: u32 = 0;
/// What lies beside what is asked for is there; that is cleared and drawn.
pub const KEPT_BESIDE: u32 = 1;
/// What stands in both of its light's versions is there, and nothing else.
pub const KEPT_BOTH: u32 = 2;
/// It is there.
pub const KEPT_ALL: u32 = 3;
/// Lists are dispatched as rows of this many workgroups: the guaranteed limit is 65,535 a dimension.
pub const LIST_ROW: u32 = 32768;
/// Most vertices of a polygon light (VPL13 section 5.2).
pub const MAX_VERTICES: u32 = 8;

/// A view is five faces of half a cube around its pole.
pub const VIEW_HEMICUBE: u32 = 0;
/// A view is a square of parallel rays.
pub const VIEW_ORTHOGRAPHIC: u32 = 1;

/// `Light.kind`.
pub const LIGHT_POLYGON: u32 = 0;
/// `Light.kind`.
pub const LIGHT_DISK: u32 = 1;
/// `Light.kind`.
pub const LIGHT_POINT: u32 = 2;
/// `Light.kind`.
pub const LIGHT_SPOT: u32 = 3;
/// `Light.kind`.
pub const LIGHT_DIRECTIONAL: u32 = 4;

/// How a tile evaluates a light: polygon clipped to the horizon.
pub const FORM_CLIPPED: u32 = 0;
/// Polygon wholly above every horizon of the tile.
pub const FORM_POLYGON: u32 = 1;
/// Disk, or a polygon so far away that its outline does not matter.
pub const FORM_DISK: u32 = 2;
/// Point or spot.
pub const FORM_PUNCTUAL: u32 = 3;
/// Parallel light.
pub const FORM_DIRECTIONAL: u32 = 4;
/// Number of forms.
pub const FORMS: u32 = 5;

/// Steps per texel of the grid that uv coordinates are rounded to, so that coverage is decided in integers: alike on
/// every device.
pub const UV_UNIT: u32 = 4096;
/// How near to a texel's centre, in steps along u and along v, a point must lie for bilinear filtering to fetch that
/// texel: one texel, and what a coordinate can be off by when it is stored as a 32-bit float and rounded to a step.
pub const UV_REACH: u32 = UV_UNIT + 4;
/// Added to the triangle of a claim on a texel that an edge crosses: triangles that cover its centre come first.
pub const CLAIM_EDGE: u32 = 1 << 30;
/// Added to the triangle of a claim on a texel that an edge only passes.
pub const CLAIM_FAR_EDGE: u32 = 2 << 30;
/// Added to the triangle of a claim that a vertex makes.
pub const CLAIM_VERTEX: u32 = 3 << 30;

/// What the viewer shows: the lit scene.
pub const LOOK_LIT: u32 = 0;
/// The scene before there is a map.
pub const LOOK_UNBAKED: u32 = 1;
/// The scene as if it were of one grey.
pub const LOOK_LIGHT: u32 = 2;
/// Lux in false colours.
pub const LOOK_LUX: u32 = 3;
/// What a picture of the scene shows: where the lightmap's texels lie.
pub const LOOK_TEXELS: u32 = 4;
/// What a picture of the scene shows: how far the light is from a reference.
pub const LOOK_ERROR: u32 = 5;
/// What a picture of the scene shows: a page of the lightmap.
pub const LOOK_PAGE: u32 = 6;
/// Lux per unit of a half float in a picture of [`LOOK_LUX`].
pub const LUX_STEP: u32 = 16;
