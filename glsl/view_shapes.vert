#version 460
// Filled shapes of marks.
#extension GL_GOOGLE_include_directive : require
#include "view_marks.glsl"

layout(location = 0) out vec4 color;
layout(location = 1) out vec2 across;
layout(location = 2) flat out float width;

void main() {
    Corner c = corners.at[gl_VertexIndex];
    color = unpackUnorm4x8(c.color);
    across = vec2(0.0);
    width = 1e6;
    vec4 place = picture.it.clip * vec4(c.position, 1.0);
    gl_Position = vec4(place.xy, place.z * NEARER, place.w);
}
