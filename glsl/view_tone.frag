#version 460
// Exposed radiance to sRGB: AgX (Troy Sobotka), with the polynomial fit of its default contrast by Benjamin Wrensch.
#extension GL_GOOGLE_include_directive : require
#include "view_scene.glsl"

layout(constant_id = 0) const uint LOOK = LOOK_LIT;

layout(push_constant, scalar) uniform Push {
    PictureAt picture;
};

layout(set = 0, binding = 0) uniform sampler2DArray radiance;

layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;

const mat3 INSET = mat3(0.842479, 0.0423282, 0.0423757, 0.0784336, 0.878469, 0.0784336, 0.0792237, 0.0791661, 0.879143);
const mat3 OUTSET = mat3(1.19688, -0.0528969, -0.0529716, -0.0980209, 1.1519, -0.0980435, -0.0990297, -0.0989612, 1.15107);
const vec2 STOPS = vec2(-12.4739, 4.02607);
// The emptiness around a scene, as displayed.
const vec3 BACKGROUND = vec3(24.0, 26.0, 29.0) / 255.0;

vec3 agx(vec3 exposed) {
    vec3 x = (clamp(log2(max(INSET * exposed, 1e-10)), STOPS.x, STOPS.y) - STOPS.x) / (STOPS.y - STOPS.x);
    vec3 x2 = x * x;
    vec3 x4 = x2 * x2;
    vec3 curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return clamp(OUTSET * curve, 0.0, 1.0);
}

// Turbo by Anton Mikhailov: a polynomial fit of the rainbow that is even to the eye.
vec3 turbo(float x) {
    vec4 v = vec4(1.0, x, x * x, x * x * x);
    vec2 w = v.zw * v.z;
    return clamp(vec3(
        dot(v, vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234)) + dot(w, vec2(-152.94239396, 59.28637943)),
        dot(v, vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333)) + dot(w, vec2(4.27729857, 2.82956604)),
        dot(v, vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771)) + dot(w, vec2(-89.90310912, 27.34824973))), 0.0, 1.0);
}

void main() {
    vec4 seen = texture(radiance, vec3(uv, 0.0));
    vec3 inside = seen.rgb / max(seen.a, 1e-6);
    if (LOOK == LOOK_LUX || LOOK == LOOK_ERROR) {
        vec2 ends = log2(picture.it.scale);
        float value = inside.r * (LOOK == LOOK_LUX ? LUX_STEP : 1u);
        inside = turbo(clamp((log2(max(value, 1e-20)) - ends.x) / (ends.y - ends.x), 0.0, 1.0));
    } else if (LOOK == LOOK_TEXELS) {
        inside = pow(inside, vec3(1.0 / 2.2));
    } else {
        inside = agx(inside);
    }
    color = vec4(mix(BACKGROUND, inside, seen.a), 1.0);
}
