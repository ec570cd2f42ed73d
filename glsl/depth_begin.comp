#version 460
// Clears what is asked of maps that begin as another version's: that is drawn anew. An invocation takes a row of pixels.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Views views;
};

void main() {
    uint row = gl_GlobalInvocationID.x;
    uint view = gl_WorkGroupID.y;
    uint size = views.at[view].size;
    uint rows = views.at[view].kind == VIEW_HEMICUBE ? 3 * size : size;
    if (views.at[view].kept != KEPT_BESIDE || row >= rows) return;
    uint face = row < size ? 0 : 1 + (row - size) / (size / 2);
    Span asked = asked_pixels(views.at[view].asked[face], size, face != 0);
    // Rows follow each other from face to face.
    float own = float(face == 0 ? row : (row - size) % (size / 2));
    uint column = uint(asked.first.x);
    uint end = own >= asked.first.y && own <= asked.last.y ? uint(max(asked.last.x + 1.0, 0.0)) : 0;
    Uints depth = Uints(views.at[view].depth);
    for (;;) {
        if (column >= end) break;
        depth.at[row * size + column++] = 0;
    }
}
