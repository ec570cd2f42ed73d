#version 460
// A page of the lightmap, laid out flat: a unit is a texel, rows go down.
#extension GL_GOOGLE_include_directive : require
#include "view_scene.glsl"
#include "view_page.glsl"

layout(location = 0) out vec2 texel;

void main() {
    vec2 corner = vec2(uvec2(0x16u, 0x34u) >> uint(gl_VertexIndex) & 1u);
    texel = corner * picture.it.page_size;
    gl_Position = picture.it.clip * vec4(texel, 0.0, 1.0);
}
