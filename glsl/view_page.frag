#version 460
// A page of the lightmap: its light on grey; a hatching where nothing is lit.
#extension GL_GOOGLE_include_directive : require
#include "view_scene.glsl"
#include "view_page.glsl"

layout(set = 0, binding = 0) uniform sampler2DArray lightmap;

layout(location = 0) in vec2 texel;
layout(location = 0) out vec4 color;

void main() {
    Picture p = picture.it;
    ivec2 at = clamp(ivec2(floor(texel)), ivec2(0), ivec2(p.page_size) - 1);
    // Texels that are larger than pixels are seen one by one.
    vec3 light = fwidth(texel.x) < 1.0 ? texelFetch(lightmap, ivec3(at, int(p.page)), 0).rgb
        : textureLod(lightmap, vec3(texel / p.page_size, p.page), 0.0).rgb;
    bool hatched = mod(gl_FragCoord.x + gl_FragCoord.y, 8.0) < 1.0;
    vec3 empty = vec3(hatched ? 0.03 : 0.012);
    bool filled = max(light.r, max(light.g, light.b)) > 0.0;
    color = vec4(filled ? min(light * (p.lux * 0.5 / PI * p.exposure), 65000.0) : empty, 1.0);
}
