#version 460
// Adds the irradiance of a batch of lights to the lightmap (VPL13 section 6.1): a workgroup takes a tile and the lights
// that reach it, an invocation a texel. One read-modify-write a batch; every light is rounded to fixed point by itself,
// so that sums depend neither on batches nor on order.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"
#include "form_factor.glsl"
#include "visibility.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 0) const uint FORM = FORM_CLIPPED;
// Percentage-closer soft shadows for direct lights (VPL13 section 6); otherwise one tap.
layout(constant_id = 1) const bool SOFT = false;
layout(constant_id = 2) const bool SHADOWS = true;

layout(push_constant, scalar) uniform Push {
    Receivers receivers;
    Lights lights;
    Pairs list;
    Views views;
    Uints depth;
    Sums sums;
    float scale;   // fixed-point units per lux
    float epsilon; // half a texel
    float disk_area; // factor of a disk's area in its form factor's denominator
    float bias;    // relative
};

// Irradiance without visibility, per unit of flux (area lights) or intensity (the others). Moves p out of the emitter's
// plane where it lies within epsilon of it (VPL13 fig. 8).
float transfer(uint i, inout vec3 p, vec3 n) {
    vec3 normal = lights.at[i].normal;
    if (FORM == FORM_DIRECTIONAL) return max(0.0, -dot(n, normal));
    vec3 to_light = lights.at[i].position - p;
    if (FORM == FORM_PUNCTUAL) {
        float d2 = dot(to_light, to_light);
        vec3 l = to_light * inversesqrt(d2);
        // Spot falloff as KHR_lights_punctual suggests; a point has scale 0, offset 1.
        float cone = clamp(-dot(l, normal) * lights.at[i].spot_scale + lights.at[i].spot_offset, 0.0, 1.0);
        return d2 > 0.0 ? max(0.0, dot(n, l)) * cone * cone / d2 : 0.0;
    }
    float height = -dot(to_light, normal);
    vec3 up = normal - n * dot(n, normal);
    float climb = dot(up, normal);
    float shift = abs(height) < epsilon && climb > 0.25 ? (epsilon - height) / climb : 0.0;
    p += up * shift;
    to_light -= up * shift;
    height += climb * shift;
    if (FORM == FORM_DISK) {
        float d2 = dot(to_light, to_light);
        float cosines = max(0.0, dot(n, to_light)) * max(0.0, height) / d2;
        return d2 > 0.0 ? cosines / (PI * d2 + disk_area * lights.at[i].area) : 0.0;
    }
    float factor = 0.0;
    uint count = lights.at[i].vertices;
    vec3 a = lights.at[i].vertex[count - 1] - p;
    vec3 leave = vec3(0.0), enter = vec3(0.0);
    uint k = 0;
    for (;;) {
        vec3 b = lights.at[i].vertex[k] - p;
        if (FORM == FORM_CLIPPED) factor += clipped_edge(a, b, n, leave, enter);
        else factor += edge(a, b, n);
        a = b;
        if (++k >= count) break;
    }
    if (FORM == FORM_CLIPPED) factor += edge(leave, enter, n);
    return height > 0.0 ? max(0.0, factor) / lights.at[i].area : 0.0;
}

void main() {
    uvec2 entry = list.at[list_index()];
    uint lane = gl_LocalInvocationIndex;
    vec3 position = receivers.at[entry.x * TILE + lane].position;
    vec3 n = receivers.at[entry.x * TILE + lane].normal;
    int64_t red = 0, green = 0, blue = 0;
    uint mask = entry.y;
    for (;;) {
        uint i = uint(findLSB(mask));
        mask &= mask - 1;
        vec3 p = position;
        float value = transfer(i, p, n) * scale;
        if (SHADOWS) {
            uint view = lights.at[i].view;
            bool two = FORM == FORM_PUNCTUAL && lights.at[i].kind == LIGHT_POINT;
            if (FORM == FORM_DIRECTIONAL) value *= parallel_visibility(views, depth, view, p, n, bias);
            else if (SOFT) value *= soft_visibility(views, depth, view, two, p, n, lights.at[i].radius, bias);
            else value *= visibility(views, depth, view, two, p, n, bias);
        }
        vec3 units = round(lights.at[i].flux * value);
        int sign = lights.at[i].sign;
        red += int64_t(units.x) * sign;
        green += int64_t(units.y) * sign;
        blue += int64_t(units.z) * sign;
        if (mask == 0) break;
    }
    uint slot = entry.x * TILE * 3 + lane;
    sums.at[slot] += red;
    sums.at[slot + TILE] += green;
    sums.at[slot + 2 * TILE] += blue;
}
