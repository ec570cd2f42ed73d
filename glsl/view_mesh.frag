#version 460
// Surfaces of the scene, lit by the lightmap: albedo / pi * E + emission.
#extension GL_GOOGLE_include_directive : require
#include "view_scene.glsl"
#include "view_mesh.glsl"

layout(constant_id = 0) const uint LOOK = LOOK_LIT;
// What a material has: without a discard, depth is tested before anything is looked up.
layout(constant_id = 1) const bool MASKED = true;
layout(constant_id = 2) const bool COLOR_IMAGE = true;
layout(constant_id = 3) const bool EMITS = true;

layout(set = 0, binding = 0) uniform sampler2DArray color_image;
layout(set = 0, binding = 1) uniform sampler2DArray emission_image;
layout(set = 0, binding = 2) uniform sampler2DArray lightmap;
layout(set = 0, binding = 3) uniform sampler2DArray reference;

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 color_uv;
layout(location = 3) in vec2 emission_uv;
layout(location = 4) centroid in vec2 light_uv;

layout(location = 0) out vec4 color;

// Half floats end there.
const float MOST = 65000.0;

// A checker's mean over a box: 1 and -1 by turns (Inigo Quilez).
float checker(vec2 at, vec2 extent) {
    vec2 ends = abs(fract((at + 0.5 * extent) * 0.5) - 0.5) - abs(fract((at - 0.5 * extent) * 0.5) - 0.5);
    vec2 stripes = 2.0 * ends / extent;
    return stripes.x * stripes.y;
}

void main() {
    Surface s = surfaces.at[surface];
    Picture p = picture.it;
    vec4 base = vec4(s.color, s.alpha);
    if (COLOR_IMAGE) base *= texture(color_image, vec3(color_uv, 0.0));
    if (MASKED && base.a < s.cutoff) discard;
    float page = placed.at[object].page;
    vec3 light = texture(lightmap, vec3(light_uv, page)).rgb * p.lux;
    if (LOOK == LOOK_UNBAKED) {
        // Stands in until there is a map: a sky above, a darker ground, and a lamp at the eye.
        vec3 n = normalize(normal);
        vec3 to_eye = normalize(p.eye - position);
        float sky = 0.5 + 0.5 * n.y;
        vec3 flat_light = mix(vec3(0.35, 0.33, 0.31), vec3(0.75, 0.8, 0.88), sky) + 0.35 * abs(dot(n, to_eye));
        color = vec4(base.rgb * flat_light * 0.55, 1.0);
    } else if (LOOK == LOOK_LIGHT) {
        color = vec4(min(light * (0.5 / PI) * p.exposure, MOST), 1.0);
    } else if (LOOK == LOOK_TEXELS) {
        // Of texels, and where these are too small to be seen, of squares of 8 by 8.
        vec2 texel = light_uv * p.page_size;
        vec2 extent = max(max(abs(dFdx(texel)), abs(dFdy(texel))), 1e-4);
        float small = checker(texel, extent);
        float large = checker(texel / 8.0, extent / 8.0);
        float facing = abs(dot(normalize(normal), normalize(p.eye - position)));
        vec3 tint = vec3(0.5) + (0.3 * small + 0.12 * large) * vec3(1.0, 0.55, -0.35);
        color = vec4(tint * (0.25 + 0.6 * facing), 1.0);
    } else if (LOOK == LOOK_ERROR) {
        float is = dot(light, vec3(1.0 / 3.0)) / p.lux;
        float should = dot(texture(reference, vec3(light_uv, page)).rgb, vec3(1.0 / 3.0));
        color = vec4(vec3(min(abs(is - should) / max(should, p.least), MOST)), 1.0);
    } else if (LOOK == LOOK_LUX) {
        color = vec4(vec3(min(dot(light, LUMINANCE) / LUX_STEP, MOST)), 1.0);
    } else {
        vec3 seen = base.rgb / PI * light;
        if (EMITS) seen += texture(emission_image, vec3(emission_uv, 0.0)).rgb * s.emission;
        color = vec4(min(seen * p.exposure, MOST), 1.0);
    }
}
