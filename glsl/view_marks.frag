#version 460
// Marks: their colour; points are round.
#extension GL_GOOGLE_include_directive : require
#include "view_marks.glsl"

layout(location = 0) in vec4 color;
layout(location = 1) in vec2 across;
layout(location = 2) flat in float width;

layout(location = 0) out vec4 out_color;

void main() {
    out_color = color * clamp((1.0 - length(across)) * 0.5 * width, 0.0, 1.0);
}
