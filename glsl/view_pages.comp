#version 460
// The lightmap as it is now, as half floats, texel by texel into its pages.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Sums sums;
    Texels texels;
    Pairs pages;     // two halves a word
    uint first_tile;
    float unit;      // of the image, per fixed-point unit
};

void main() {
    uint tile = first_tile + gl_WorkGroupID.x;
    uint lane = gl_LocalInvocationID.x;
    uint pixel = texels.at[tile * TILE + lane].pixel;
    if (pixel == NONE) return;
    uint at = tile * 3 * TILE + lane;
    vec3 light = vec3(float(sums.at[at]), float(sums.at[at + TILE]), float(sums.at[at + 2 * TILE])) * unit;
    // Halves end at 65504.
    light = clamp(light, 0.0, 65000.0);
    pages.at[pixel] = uvec2(packHalf2x16(light.rg), packHalf2x16(vec2(light.b, 1.0)));
}
