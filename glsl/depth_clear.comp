#version 460
// Clears what is asked of maps that were kept otherwise: that is drawn anew.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Views views;
    Uints depth;
};

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    uint size = views.at[view].size;
    if (views.at[view].kept != KEPT_BESIDE || pixel >= 3 * size * size) return;
    uint top = size * size;
    uint face = pixel < top ? 0 : 1 + (pixel - top) / (top / 2);
    uint own = pixel - face_offset(face, size);
    Span span = asked_pixels(views.at[view].asked[face], size, face != 0);
    vec2 at = vec2(own % size, own / size);
    if (all(greaterThanEqual(at, span.first)) && all(lessThanEqual(at, span.last))) depth.at[views.at[view].offset + pixel] = 0;
}
