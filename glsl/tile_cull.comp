#version 460
// Which tiles a batch of lights can reach, and how each is evaluated there: appends (tile, mask of lights) to the list of
// each form. A pair is left out only where the contribution is exactly 0.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "common.glsl"
#include "view.glsl"
#include "hidden.glsl"

// By how much cone_cos is less than the cosine of the largest angle (place.comp), at least.
const float CONE_SLACK = 1e-5;

layout(local_size_x = 64) in;

// Tiles of an invocation, one after the other: they share the reading of the lights.
layout(constant_id = 0) const uint EACH = 1;

layout(push_constant, scalar) uniform Push {
    Tiles tiles;
    Instances instances;
    Regions regions;
    Lights lights;
    Pairs lists;      // FORMS lists of tile_count entries each
    ListHeads heads;  // FORMS
    Sums pairs;       // FORMS: pairs of a texel and a light that were left in, so far
    Views views;
    Uints parts;      // of the map: PART_* by tile of texels
    uint tile_count;
    uint light_count;
    float epsilon;    // half a texel: VPL13 fig. 8
    float far;        // a polygon further away than this many of its radii is evaluated as a disk
    uint occlusion;   // not 0: lights have one tap, and what it finds in no texel of a tile need not be asked for
};

// The t at which `from + way t` is in a box around the origin, `half_size + t widening` large each way, as (first, last):
// empty where first > last.
vec2 inside_box(vec3 from, vec3 way, vec3 half_size, vec3 widening) {
    vec2 when = vec2(-1e30, 1e30);
    [[unroll]] for (uint side = 0; side < 2; ++side) {
        // slope t <= rest, for each axis.
        vec3 slope = (side == 0 ? way : -way) - widening;
        vec3 rest = half_size - (side == 0 ? from : -from);
        vec3 t = rest / mix(slope, vec3(1e-30), lessThan(abs(slope), vec3(1e-30)));
        vec3 first = mix(vec3(-1e30), t, lessThan(slope, vec3(-1e-30)));
        vec3 last = mix(mix(vec3(1e30), vec3(-1e30), lessThan(rest, vec3(0.0))), t, greaterThan(slope, vec3(1e-30)));
        last = mix(last, vec3(1e30), lessThan(slope, vec3(-1e-30)));
        when.x = max(when.x, max(max(first.x, first.y), first.z));
        when.y = min(when.y, min(min(last.x, last.y), last.z));
    }
    return when;
}

// How far a lookup lies from its receiver at most, in distances to the light over the map's size: lifted, and pushed away
// from what stands beside it; and how much further away than a lookup may be what hides it (visibility.glsl).
const float LIFTED = 0.6, PUSHED = 2.2, BEYOND = 4.0;

// Whether what differs between a light's version and the one that its update compares with can change its light on the
// tile: the box meets the bundle of the tile's lookups, which all begin in one point and are as wide at the tile as the
// tile and as far as depth maps are looked up beside a receiver. A little beyond the tile, too: what covers a receiver closely
// hides it where its pixel's ray meets that.
// `corner`: how much further than the box's own corners those of boxes within it may be, each counted from its middle.
bool differs(uint i, vec3 center, vec3 extent, float corner) {
    uint kind = lights.at[i].kind;
    bool parallel = kind == LIGHT_DIRECTIONAL;
    vec3 origin = lights.at[i].origin;
    vec3 normal = lights.at[i].normal;
    vec3 way = parallel ? normal : center - origin;
    float distance = parallel ? 0.0 : length(way) + corner * length(extent);
    // Receivers this close to an emitter's plane are moved out of it (VPL13 fig. 8).
    bool area = kind == LIGHT_POLYGON || kind == LIGHT_DISK;
    float height = abs(dot(normal, center - lights.at[i].position)) - dot(abs(normal), extent);
    float moved = area && height < 2.0 * epsilon ? 8.0 * epsilon : 0.0;
    vec3 wide = extent + lights.at[i].blur + lights.at[i].blur_slope * distance + moved;
    float furthest = (distance + moved) * (1.0 + (LIFTED + PUSHED + BEYOND) / float(views.at[lights.at[i].view].size));
    uint first = lights.at[i].first_region;
    for (uint k = 0; k < lights.at[i].regions; ++k) {
        vec3 middle = regions.at[first + k].center;
        vec3 half_size = regions.at[first + k].extent;
        vec2 when = parallel ? inside_box(center - middle, way, half_size + wide, vec3(0.0))
                             : inside_box(origin - middle, way, half_size, wide);
        bool reached = length(max(abs(origin - middle) - half_size, vec3(0.0))) <= furthest;
        if (when.x <= when.y && (parallel || when.y >= 0.0 && reached)) return true;
    }
    return false;
}

// Those of the lights of `asked` that may differ somewhere on the subgroup's tiles, which lie between `low` and `high`: every
// invocation asks some of them about all tiles.
uint differ_somewhere(uint asked, vec3 low, vec3 high) {
    asked = subgroupOr(asked);
    low = subgroupMin(low);
    high = subgroupMax(high);
    vec3 center = 0.5 * (low + high);
    vec3 extent = (0.5 + 1e-5) * (high - low) + 1e-6 * abs(center);
    uint found = 0;
    for (uint i = gl_SubgroupInvocationID; i < (asked != 0 ? light_count : 0); i += gl_SubgroupSize)
        found |= differs(i, center, extent, 1.5) ? 1u << i : 0u;
    return asked & subgroupOr(found);
}

// Those of the lights of `asked` whose light on the tile is the same in both of their versions.
uint alike(uint asked, vec3 center, vec3 extent) {
    uint same = 0;
    for (;;) {
        uint i = uint(findLSB(asked));
        asked &= asked - 1;
        same |= differs(i, center, extent, 1.0) ? 0u : 1u << i;
        if (asked == 0) break;
    }
    return same;
}

// Pixels' half diagonals between a lookup and the centre of its pixel, as an angle: 1 / size of them.
const float PIXEL_ANGLE = 1.5;
// Depths are compared with less slack than this.
const float SLACK = 1.01;

// Whether no receiver of the tile sees the light: everything that its lookups can find lies before the receivers' planes.
// `lowest`: of the tile above the emitter's plane. `part`: what lies beside what the view was asked for need not be seen.
bool occluded(uint view, uint tile, vec3 center, vec3 extent, vec3 axis, float lowest, bool part) {
    float face_cos = tiles.at[tile].face_cos;
    vec3 offset = center - views.at[view].origin;
    float size = float(views.at[view].size);
    // Near the emitter's plane receivers are moved out of it.
    float shifted = lowest > epsilon ? 0.0 : 8.0 * epsilon;
    float farthest = length(offset) + length(extent) + shifted;
    float lifted = farthest * LIFTED / size;
    float moved = shifted + lifted + min(farthest * PUSHED / size, tiles.at[tile].aside);
    farthest += moved;
    // The least cosine between a face and the way to the light (pushes lie in the face's plane), and how much nearer than a
    // receiver its plane can be along the ray of a pixel beside it.
    float height = -dot(axis, offset) - tiles.at[tile].thickness;
    float least = (height * face_cos - lifted - shifted) / farthest - sqrt(max(0.0, 1.0 - face_cos * face_cos));
    float angle = PIXEL_ANGLE / size;
    float plane = least / (least + angle) * (1.0 - angle);
    vec3 x = views.at[view].x, y = views.at[view].y, z = views.at[view].z;
    vec3 local = vec3(dot(x, offset), dot(y, offset), dot(z, offset));
    vec3 a = abs(local);
    bool top = local.z >= max(a.x, a.y);
    uint face = top ? 0 : a.x >= a.y ? (local.x < 0.0 ? 2 : 1) : (local.y < 0.0 ? 4 : 3);
    Face f = face_axes(face, x, y, z);
    vec3 middle = vec3(dot(f.u, offset), dot(f.v, offset), dot(f.w, offset));
    vec3 half_size = vec3(dot(abs(f.u), extent), dot(abs(f.v), extent), dot(abs(f.w), extent)) + moved;
    return least > 0.0 && face_cos > 0.0 && covered(Uints(views.at[view].depth), views.at[view].size, face, part ? views.at[view].asked[face] : EVERYTHING, middle, half_size, SLACK / max(plane, 1e-6), true);
}

// An outline that dips below a horizon by no more than this angle need not be cut: what is lost is its square.
const float HARMLESS = 2e-3;

// How far an outline stays above the plane through the centre across the axis, if `asked` (what is returned otherwise means
// nothing). No branch around the loop, which costs more than the loop on SIMD processors.
float lowest_vertex(uint i, bool asked, vec3 center, vec3 axis) {
    uint vertices = asked ? lights.at[i].vertices : 0;
    float lowest = asked ? 1e30 : -1e30;
    for (uint v = 0; v < vertices; ++v) lowest = min(lowest, dot(axis, lights.at[i].vertex[v] - center));
    return lowest;
}

// Where a light stands to a tile's horizons.
struct Standing {
    bool any_above; // some of it may be seen from some receiver
    bool all_above; // no receiver's horizon cuts it
    float distance;
};

Standing standing(uint kind, vec3 to_light, vec3 normal, float radius, vec3 axis, float cone_cos, float reach) {
    Standing s;
    s.distance = length(to_light);
    // Parallel light comes from -normal; its distance and size play no part.
    bool parallel = kind == LIGHT_DIRECTIONAL;
    vec3 direction = parallel ? -normal : to_light / max(s.distance, 1e-20);
    // Cosines of the smallest and largest angle between a receiver's normal and the centre's direction to the light.
    float cone_sin = sqrt(max(0.0, 1.0 - cone_cos * cone_cos));
    float c = dot(axis, direction);
    float sine = sqrt(max(0.0, 1.0 - c * c));
    float best = c >= cone_cos ? 1.0 : c * cone_cos + sine * cone_sin;
    float worst = c <= -cone_cos ? -1.0 : c * cone_cos - sine * cone_sin;
    float spread = parallel ? 1e-5 : reach + radius + epsilon;
    float across = parallel ? 1.0 : s.distance;
    s.any_above = cone_cos < 0.0 || best * across + spread > 0.0;
    s.all_above = cone_cos >= 0.0 && worst * across - spread > 0.0;
    return s;
}

// Lists a tile with those of the lights of `reaching` that reach it: the dear tests, for what passed the others.
void list(uint tile, uint reaching) {
    Instance instance = instances.at[tiles.at[tile].instance];
    vec3 center = tiles.at[tile].center;
    vec3 extent = tiles.at[tile].extent;
    vec3 axis = tiles.at[tile].axis;
    float cone_cos = tiles.at[tile].cone_cos;
    float tilt = sqrt(max(0.0, 1.0 - pow(min(cone_cos + CONE_SLACK, 1.0), 2.0))) - HARMLESS;
    float reach = length(extent);
    uint masks[FORMS];
    for (uint form = 0; form < FORMS; ++form) masks[form] = 0;
    for (;;) {
        uint i = uint(findLSB(reaching));
        reaching &= reaching - 1;
        uint kind = lights.at[i].kind;
        vec3 normal = lights.at[i].normal;
        vec3 to_light = lights.at[i].position - center;
        float radius = lights.at[i].radius;
        Standing s = standing(kind, to_light, normal, radius, axis, cone_cos, reach);
        // Near by, the outline itself is asked: the sphere around it stands below many a horizon that it does not.
        bool near = kind == LIGHT_POLYGON && !s.all_above && s.distance - reach <= 2.0 * far * radius;
        if (lowest_vertex(i, near, center, axis) > tiles.at[tile].thickness + tilt * (s.distance + reach + radius)) s.all_above = true;
        bool asked = (kind == LIGHT_POLYGON || kind == LIGHT_DISK) && occlusion != 0;
        bool seen = !asked;
        float lowest = -dot(normal, to_light) - dot(abs(normal), extent);
        uint version = lights.at[i].version, other = lights.at[i].other;
        uint view = lights.at[i].view;
        uint rounds = asked ? (version == other ? 1 : 2) : 0;
        // Where one tile takes another's place, what the one adds beside what was asked for, the other has to take away.
        bool part = version != other && stands(instance, version) && stands(instance, other);
        // The version that it comes in, then that which it goes from.
        for (uint k = 0; k < rounds; ++k) {
            if (stands(instance, version) && !occluded(view, tile, center, extent, axis, lowest, part)) seen = true;
            version = other;
            view = lights.at[i].other_view;
        }
        uint form = FORM_DIRECTIONAL;
        if (kind == LIGHT_POINT || kind == LIGHT_SPOT) form = FORM_PUNCTUAL;
        if (kind == LIGHT_DISK) form = FORM_DISK;
        if (kind == LIGHT_POLYGON)
            // A horizon may cut the outline: twice as far, that is worth less than 2 % of what it gives face on.
            form = s.distance - reach > (s.all_above ? far : 2.0 * far) * radius ? FORM_DISK
                 : s.all_above ? FORM_POLYGON : FORM_CLIPPED;
        [[unroll]] for (uint k = 0; k < FORMS; ++k) masks[k] |= seen && form == k ? 1u << i : 0u;
        if (reaching == 0) break;
    }
    [[unroll]] for (uint form = 0; form < FORMS; ++form) {
        if (masks[form] != 0) {
            uint slot = atomicAdd(heads.at[form].entries, 1);
            lists.at[form * tile_count + slot] = uvec2(tile, masks[form]);
            atomicAdd(pairs.at[form], int64_t(bitCount(masks[form]) * TILE));
        }
    }
}

void main() {
    uint first = gl_GlobalInvocationID.x * EACH;
    Instance whose[EACH];
    vec3 centers[EACH], extents[EACH], axes[EACH];
    float cones[EACH];
    uint parts_of[EACH];
    // Lights that the tile may see, and those of them that light it in both of their versions.
    uint reaching[EACH], both[EACH];
    [[unroll]] for (uint k = 0; k < EACH; ++k) {
        uint tile = min(first + k, tile_count - 1);
        uint instance = tiles.at[tile].instance;
        bool any = first + k < tile_count && instance != NONE;
        // One that has ended before it began stands in no version.
        whose[k] = Instance(0, 0, 0);
        parts_of[k] = 0;
        if (any) {
            whose[k] = instances.at[instance];
            parts_of[k] = parts.at[tiles.at[tile].sums];
        }
        centers[k] = tiles.at[tile].center;
        extents[k] = tiles.at[tile].extent;
        axes[k] = tiles.at[tile].axis;
        cones[k] = tiles.at[tile].cone_cos;
        reaching[k] = both[k] = 0;
    }
    uint i = 0;
    for (;;) {
        uint kind = lights.at[i].kind;
        uint version = lights.at[i].version;
        uint other = lights.at[i].other;
        vec3 normal = lights.at[i].normal;
        vec3 position = lights.at[i].position;
        float radius = lights.at[i].radius;
        uint wanted = lights.at[i].parts;
        bool one_sided = kind == LIGHT_POLYGON || kind == LIGHT_DISK || kind == LIGHT_SPOT;
        [[unroll]] for (uint k = 0; k < EACH; ++k) {
            bool comes = stands(whose[k], version);
            bool goes = other != version && stands(whose[k], other);
            vec3 to_light = position - centers[k];
            bool faced = !one_sided || -dot(normal, to_light) + dot(abs(normal), extents[k]) + epsilon > 0.0;
            bool above = standing(kind, to_light, normal, radius, axes[k], cones[k], length(extents[k])).any_above;
            reaching[k] |= (comes || goes) && (wanted & parts_of[k]) != 0 && faced && above ? 1u << i : 0u;
            both[k] |= comes && goes ? 1u << i : 0u;
        }
        if (++i == light_count) break;
    }
    uint asked = 0;
    vec3 low = vec3(1e30), high = vec3(-1e30);
    [[unroll]] for (uint k = 0; k < EACH; ++k) {
        bool changes = (reaching[k] & both[k]) != 0;
        asked |= reaching[k] & both[k];
        low = changes ? min(low, centers[k] - extents[k]) : low;
        high = changes ? max(high, centers[k] + extents[k]) : high;
    }
    // The first of the dear tests by itself, for all tiles and then for each: of a local edit it leaves little.
    uint differing = differ_somewhere(asked, low, high);
    uint at = 0;
    for (;;) {
        uint tile = first + at;
        uint left = 0, ask = 0;
        [[unroll]] for (uint k = 0; k < EACH; ++k) {
            left = at == k ? reaching[k] : left;
            ask = at == k ? reaching[k] & both[k] : ask;
        }
        left &= ~(ask & ~differing);
        ask &= differing;
        if (ask != 0) left &= ~alike(ask, tiles.at[tile].center, tiles.at[tile].extent);
        if (left != 0) list(tile, left);
        if (++at == EACH) break;
    }
}
