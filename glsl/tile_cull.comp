#version 460
// Which tiles a batch of lights can reach, and how each is evaluated there: appends (tile, mask of lights) to the list of
// each form. A pair is left out only where the contribution is exactly 0.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_atomic_int64 : require
#include "common.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Tiles tiles;
    Instances instances;
    Regions regions;
    Lights lights;
    Pairs lists;      // FORMS lists of tile_count entries each
    ListHeads heads;  // FORMS
    Sums pairs;       // FORMS: pairs of a texel and a light that were left in, so far
    uint tile_count;
    uint light_count;
    float epsilon;    // half a texel: VPL13 fig. 8
    float far;        // a polygon further away than this many of its radii is evaluated as a disk
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

// Whether what differs between a light's version and the one that its update compares with can change its light on the
// tile: the box meets the bundle of the tile's lookups, which all begin in one point and are as wide at the tile as the
// tile and as far as depth maps are looked up beside a receiver. Beyond the tile, too: what covers a receiver closely hides it
// wherever its pixel's ray meets that.
bool differs(uint i, vec3 center, vec3 extent) {
    uint kind = lights.at[i].kind;
    bool parallel = kind == LIGHT_DIRECTIONAL;
    vec3 origin = lights.at[i].origin;
    vec3 normal = lights.at[i].normal;
    vec3 way = parallel ? normal : center - origin;
    float distance = parallel ? 0.0 : length(way) + length(extent);
    // Receivers this close to an emitter's plane are moved out of it (VPL13 fig. 8).
    bool area = kind == LIGHT_POLYGON || kind == LIGHT_DISK;
    float height = abs(dot(normal, center - lights.at[i].position)) - dot(abs(normal), extent);
    float moved = area && height < 2.0 * epsilon ? 8.0 * epsilon : 0.0;
    vec3 wide = extent + lights.at[i].blur + lights.at[i].blur_slope * distance + moved;
    uint first = lights.at[i].first_region;
    for (uint k = 0; k < lights.at[i].regions; ++k) {
        vec3 middle = regions.at[first + k].center;
        vec3 half_size = regions.at[first + k].extent;
        vec2 when = parallel ? inside_box(center - middle, way, half_size + wide, vec3(0.0))
                             : inside_box(origin - middle, way, half_size, wide);
        if (when.x <= when.y && (parallel || when.y >= 0.0)) return true;
    }
    return false;
}

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (tile >= tile_count) return;
    uint whose = tiles.at[tile].instance;
    if (whose == NONE) return;
    Instance instance = instances.at[whose];
    if (instance.until == 0) return;
    vec3 center = tiles.at[tile].center;
    vec3 extent = tiles.at[tile].extent;
    vec3 axis = tiles.at[tile].axis;
    float cone_cos = tiles.at[tile].cone_cos;
    float cone_sin = sqrt(max(0.0, 1.0 - cone_cos * cone_cos));
    float reach = length(extent);

    uint masks[FORMS];
    for (uint form = 0; form < FORMS; ++form) masks[form] = 0;
    for (uint i = 0; i < light_count; ++i) {
        uint kind = lights.at[i].kind;
        uint version = lights.at[i].version;
        uint other = lights.at[i].other;
        bool here = stands(instance, version);
        if (here && other != version && stands(instance, other)) here = differs(i, center, extent);
        if (!here) continue;
        vec3 normal = lights.at[i].normal;
        vec3 to_light = lights.at[i].position - center;
        float radius = lights.at[i].radius;
        float distance = length(to_light);
        // Parallel light comes from -normal; its distance and size play no part.
        bool parallel = kind == LIGHT_DIRECTIONAL;
        vec3 direction = parallel ? -normal : to_light / max(distance, 1e-20);
        // Cosines of the smallest and largest angle between a receiver's normal and the centre's direction to the light.
        float c = dot(axis, direction);
        float s = sqrt(max(0.0, 1.0 - c * c));
        float best = c >= cone_cos ? 1.0 : c * cone_cos + s * cone_sin;
        float worst = c <= -cone_cos ? -1.0 : c * cone_cos - s * cone_sin;
        float spread = parallel ? 1e-5 : reach + radius + epsilon;
        float across = parallel ? 1.0 : distance;
        bool any_above = cone_cos < 0.0 || best * across + spread > 0.0;
        bool all_above = cone_cos >= 0.0 && worst * across - spread > 0.0;
        bool faced = true;
        bool area = kind == LIGHT_POLYGON || kind == LIGHT_DISK;
        if (area || kind == LIGHT_SPOT)
            faced = -dot(normal, to_light) + dot(abs(normal), extent) + epsilon > 0.0;
        if (any_above && faced) {
            uint form = FORM_DIRECTIONAL;
            if (kind == LIGHT_POINT || kind == LIGHT_SPOT) form = FORM_PUNCTUAL;
            if (kind == LIGHT_DISK) form = FORM_DISK;
            if (kind == LIGHT_POLYGON)
                // A horizon may cut the outline: twice as far, that is worth less than 2 % of what it gives face on.
                form = distance - reach > (all_above ? far : 2.0 * far) * radius ? FORM_DISK
                     : all_above ? FORM_POLYGON : FORM_CLIPPED;
            [[unroll]] for (uint k = 0; k < FORMS; ++k) masks[k] |= form == k ? 1u << i : 0u;
        }
    }
    [[unroll]] for (uint form = 0; form < FORMS; ++form) {
        if (masks[form] != 0) {
            uint slot = atomicAdd(heads.at[form].entries, 1);
            lists.at[form * tile_count + slot] = uvec2(tile, masks[form]);
            atomicAdd(pairs.at[form], int64_t(bitCount(masks[form]) * TILE));
        }
    }
}
