#version 460
// How far the lightmap is from another one: per tile, the sum over texels and channels of the squared difference in lux, and
// the same weighted by texel. And what it holds: the sum in lux, and how far a value is at most outside of what lies between
// that of the other one and that of a third.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Sums sums;
    Sums target;
    Sums first;
    Floats weights; // by texel
    Floats residuals;
    uint tile_count;
    float unit; // lux per fixed-point unit
};

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (tile >= tile_count) return;
    float sum = 0.0, weighted = 0.0, held = 0.0, beyond = 0.0;
    for (uint i = 0; i < 3 * TILE; ++i) {
        uint at = tile * 3 * TILE + i;
        int64_t now = sums.at[at], end = target.at[at], begin = first.at[at];
        float difference = float(now - end) * unit;
        sum += difference * difference;
        weighted += weights.at[tile * TILE + i % TILE] * difference * difference;
        held += float(now) * unit;
        beyond = max(beyond, float(max(now - max(begin, end), min(begin, end) - now)) * unit);
    }
    residuals.at[4 * tile] = sum;
    residuals.at[4 * tile + 1] = weighted;
    residuals.at[4 * tile + 2] = held;
    residuals.at[4 * tile + 3] = beyond;
}
