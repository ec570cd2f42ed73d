#version 460
// Panels: texture times colour, both encoded as the screen is.
#extension GL_GOOGLE_include_directive : require
#include "view_panels.glsl"

layout(set = 0, binding = 0) uniform sampler2DArray image;

layout(location = 0) in vec2 uv;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 out_color;

void main() {
    out_color = texture(image, vec3(uv, 0.0)) * color;
}
