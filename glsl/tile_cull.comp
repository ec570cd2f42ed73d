#version 460
// Which tiles a batch of lights can reach, and how each is evaluated there: appends (tile, mask of lights) to the list of
// each form. A pair is left out only where the contribution is exactly 0.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Tiles tiles;
    Lights lights;
    Pairs lists;      // FORMS lists of tile_count entries each
    ListHeads heads;  // FORMS
    uint first_tile;
    uint tile_count;
    uint light_count;
    float epsilon;    // half a texel: VPL13 fig. 8
    float far;        // a polygon further away than this many of its radii is evaluated as a disk
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= tile_count) return;
    uint tile = first_tile + index;
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
        }
    }
}
