// What all passes share: extensions, structures (their Rust twins are layout-tested), and small mathematics.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require

const float PI = 3.14159265358979;

// Capitals that are not defined here (TILE, LIST_ROW, LIGHT_*, VIEW_*...) come from src/bake/device/shared.rs.

struct Texel {
    vec3 position;
    uint object;
    vec3 normal;
    vec3 face;
    uint pixel;
};

// What stands near a texel, world space: see Clearance in src/lightmap/mod.rs.
struct Clearance {
    vec3 push;
    float near;
    float way;
    float room;
};

// World-space receiver.
struct Receiver {
    vec3 position;
    vec3 normal; // of shading
    vec3 face;   // of the surface's front: what shades it, and what shades no part of it, follow this one
    Clearance clearance;
};

// Where a tile's receivers are and where they face.
struct Tile {
    vec3 center;
    vec3 extent;    // half the box
    vec3 axis;
    float cone_cos; // of the largest angle between the axis and a normal; -1 if they do not fit a half space
    float face_cos; // of the largest angle between the axis and a face; -1 likewise
    float thickness; // how far a receiver lies from the plane through the centre across the axis, at most
    float aside;    // how far lookups may be pushed from their receivers, at most
    uint sums;      // the lightmap's tile that it adds to
    uint instance;
};

// A tile whose surroundings changed: from now on other receivers take part in its sums.
struct Replaced {
    uint tile;     // of texels, and of sums
    uint old;      // tile of receivers that ends,
    uint ended;    // and the instance that it belongs to now
    uint new;      // tile of receivers that begins,
    uint instance; // and its instance
};

// An object in one place, or some tiles of it, and the versions of the scene in which it stands there.
struct Instance {
    uint since;
    uint until;  // the first version without it
    uint crowded; // not 0: other instances add to the same texels
};

// A box around something that differs between two versions.
struct Region {
    vec3 center;
    vec3 extent;
};

struct Triangle {
    vec3 a, b, c;
};

// Where a triangle of a masked material stops light.
struct Cutout {
    vec2 uv[3];  // of the corners, transformed; near the origin
    uint first;  // word of the mask: a bit a texel, rows of whole words
    uvec2 size;  // texels
    uint wrap;   // WRAP_* of u, and of v shifted by 2
};

struct Chunk {
    vec3 center;
    vec3 extent; // half the box
    uint count;  // triangles: chunk c has those from c * CHUNK on
};

// Chunks that lie together, of one instance: its triangles, or, the coarser the fewer, others that stand for them.
struct Group {
    vec3 center;
    vec3 extent;        // half the box
    uint instance;
    uint first[LEVELS]; // chunk,
    uint count[LEVELS]; // and how many there are
    float cell[LEVELS]; // how far their vertices may lie from those of the triangles, metres; 0: there is no such level
};

// A hemicube of inverse depths, or an orthographic map of scaled depths.
struct View {
    vec3 origin;
    vec3 x, y, z;  // rows of world to local; hemicube: z is the pole
    uvec2 depth;   // address of its map (Uints), and behind that of a hemicube the farthest thing in each of its VIEW_BLOCKS (depth_blocks.comp)
    uint size;     // pixels along the edge of the top face; the four side faces are half as high
    uint kind;     // VIEW_*
    float cos_cone; // nothing outside this cone around the pole is asked for
    float coarse;   // how coarse occluders may be (Group.cell), per metre of distance
    uint version;
    uint other;    // the version that its light's other view shows; its own where there is none
    int base;      // not 0: begins as the map of the view so many after this one; or before it, once what stands in both versions is drawn there
    uint kept;     // how much of it was kept from before (KEPT_*): that is not drawn
    // Of each face, of an orthographic map in the first: the rectangle that is asked for, first column and row, last column
    // and row, a byte each, in 256ths of the face. Both versions of an update see the same beside it.
    uint asked[FACES];
};

struct Light {
    vec3 position;
    vec3 normal;
    vec3 flux;      // polygon, disk: lumens; point, spot: candela; directional: lux
    vec3 other_flux; // what it had, which goes where it comes; or 0
    float area;
    float radius;   // of a sphere around position that holds the emitter
    float spot_scale;
    float spot_offset;
    uint kind;      // LIGHT_*
    int sign;       // +1 adds, -1 subtracts; a difference adds what it is in `version` and subtracts what it is in `other`
    uint view;      // first of its views,
    uint other_view; // and of those in `other`
    uint version;   // the scene that it shines in
    uint other;     // the scene that it shone in; the same where the whole light comes or goes
    uint parts;     // of the map, which it is to reach (PART_*)
    uint first_region; // boxes of what light passes otherwise in the two
    uint regions;
    vec3 origin;    // where shadows are cast from
    float blur;     // how far beside a receiver depth maps may be looked up, metres,
    float blur_slope; // and per metre of distance
    uint vertices;
    vec3 vertex[MAX_VERTICES]; // world space
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Texels { Texel at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Clearances { Clearance at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Receivers { Receiver at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Tiles { Tile at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ReplacedTiles { Replaced at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Instances { Instance at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Regions { Region at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Triangles { Triangle at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Cutouts { Cutout at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Chunks { Chunk at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Groups { Group at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Views { View at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Lights { Light at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Uints { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Floats { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Pairs { uvec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Sums { int64_t at[]; };

// A list that a pass appends to: workgroup counts for an indirect dispatch over it (written by list_args), the length.
struct ListHead {
    uint groups_x, groups_y, groups_z;
    uint entries;
    uint weight; // what the entries hold, where somebody counts it: triangles
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer ListHeads { ListHead at[]; };

bool stands(Instance instance, uint version) {
    return instance.since <= version && version < instance.until;
}

uint list_index() {
    return gl_WorkGroupID.y * LIST_ROW + gl_WorkGroupID.x;
}
