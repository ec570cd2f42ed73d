#version 460
// How far the lightmap is from another one: per tile, the sum over texels and channels of the squared difference in lux, and
// the same weighted by texel.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Sums sums;
    Sums target;
    Floats weights; // by texel
    Floats residuals;
    uint tile_count;
    float unit; // lux per fixed-point unit
};

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (tile >= tile_count) return;
    float sum = 0.0, weighted = 0.0;
    for (uint i = 0; i < 3 * TILE; ++i) {
        uint at = tile * 3 * TILE + i;
        float difference = float(sums.at[at] - target.at[at]) * unit;
        sum += difference * difference;
        weighted += weights.at[tile * TILE + i % TILE] * difference * difference;
    }
    residuals.at[2 * tile] = sum;
    residuals.at[2 * tile + 1] = weighted;
}
