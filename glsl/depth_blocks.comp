#version 460
// The farthest thing in every block of a hemicube's pixels: what lies wholly behind it is hidden there (hierarchical depth,
// Greene, Kass and Miller 1993).
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"

layout(local_size_x = 64) in;

// Views have limits.
layout(constant_id = 0) const bool LIMITED = false;

layout(push_constant, scalar) uniform Push {
    Views views;
};

void main() {
    uint block = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    if (block >= VIEW_BLOCKS) return;
    uint size = views.at[view].size;
    uint edge = size / BLOCKS;
    // What cannot be cut into blocks hides nothing; what was kept, or is not asked for, stays as it began.
    bool asked = views.at[view].kind == VIEW_HEMICUBE && views.at[view].kept != KEPT_ALL && edge * BLOCKS == size;
    if (LIMITED) {
        uint row = block / BLOCKS, face = row < BLOCKS ? 0 : 1 + (row - BLOCKS) / (BLOCKS / 2);
        uvec2 first = uvec2(block % BLOCKS, face == 0 ? row : (row - BLOCKS) % (BLOCKS / 2)) * edge;
        Span span = asked_pixels(views.at[view].asked[face], size, face != 0);
        vec2 low = vec2(first), high = vec2(first + edge - 1);
        asked = asked && all(greaterThanEqual(low, span.first)) && all(lessThanEqual(high, span.last));
    }
    if (!asked) return;
    Uints depth = Uints(views.at[view].depth);
    // Rows of blocks follow each other from face to face as rows of pixels do.
    uint pixel = (block / BLOCKS * edge) * size + block % BLOCKS * edge;
    float farthest = 1e30;
    uint column = 0;
    for (uint left = edge * edge;;) {
        farthest = min(farthest, uintBitsToFloat(depth.at[pixel + column]));
        if (--left == 0) break;
        bool wrap = ++column == edge;
        column = wrap ? 0 : column;
        pixel += wrap ? size : 0;
    }
    depth.at[first_block(size) + block] = floatBitsToUint(farthest);
}
