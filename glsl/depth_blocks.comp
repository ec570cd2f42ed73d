#version 460
// The farthest thing in every block of a hemicube's pixels: what lies wholly behind it is hidden there (hierarchical depth,
// Greene, Kass and Miller 1993). A workgroup takes a side face, or half of the top one.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"

layout(local_size_x = BLOCKS) in;

// Views have limits.
layout(constant_id = 0) const bool LIMITED = false;

layout(push_constant, scalar) uniform Push {
    Views views;
};

void main() {
    uint view = gl_WorkGroupID.y;
    uint size = views.at[view].size;
    uint edge = size / BLOCKS;
    // What cannot be cut into blocks hides nothing; what was kept, or is not asked for, stays as it began.
    if (views.at[view].kind != VIEW_HEMICUBE || views.at[view].kept == KEPT_ALL || edge * BLOCKS != size) return;
    // Rows of blocks, which follow each other from face to face as rows of pixels do.
    uint first = gl_WorkGroupID.x * BLOCKS / 2, last = first + BLOCKS / 2 - 1;
    uint column = gl_LocalInvocationIndex;
    if (LIMITED) {
        uint face = gl_WorkGroupID.x < 2 ? 0 : gl_WorkGroupID.x - 1;
        uint start = face == 0 ? 0 : first;
        const uint across = 256 / BLOCKS;
        uint down = face == 0 ? across : 2 * across;
        uint asked = views.at[view].asked[face];
        if (column < (asked & 255) / across || column > (asked >> 16 & 255) / across) return;
        first = max(first, start + (asked >> 8 & 255) / down);
        last = min(last, start + (asked >> 24) / down);
    }
    Uints depth = Uints(views.at[view].depth);
    uint row = first;
    for (;;) {
        if (row > last) break;
        uint pixel = row * edge * size + column * edge;
        float farthest = 1e30;
        uint along = 0;
        for (uint left = edge * edge;;) {
            farthest = min(farthest, uintBitsToFloat(depth.at[pixel + along]));
            if (--left == 0) break;
            bool wrap = ++along == edge;
            along = wrap ? 0 : along;
            pixel += wrap ? size : 0;
        }
        depth.at[first_block(size) + row * BLOCKS + column] = floatBitsToUint(farthest);
        ++row;
    }
}
