#version 460
// Panels: triangles in points of the screen.
#extension GL_GOOGLE_include_directive : require
#include "view_panels.glsl"

layout(location = 0) out vec2 uv;
layout(location = 1) out vec4 color;

void main() {
    PanelVertex v = vertices.at[gl_VertexIndex];
    uv = v.uv;
    color = unpackUnorm4x8(v.color);
    gl_Position = vec4(v.position.x * scale.x - 1.0, 1.0 - v.position.y * scale.y, 0.0, 1.0);
}
