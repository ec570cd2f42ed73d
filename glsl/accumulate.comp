#version 460
// Adds the irradiance of a batch of lights to the lightmap (VPL13 section 6.1): a workgroup takes a tile and the lights
// that reach it, an invocation one or several texels. One read-modify-write a batch; every light is rounded to fixed point by itself,
// so that sums depend neither on batches nor on order.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "form_factor.glsl"

#extension GL_EXT_shader_atomic_int64 : require

layout(local_size_x_id = 2) in;

layout(constant_id = 0) const uint FORM = FORM_CLIPPED;
// Percentage-closer soft shadows for direct lights (VPL13 section 6); otherwise one tap.
layout(constant_id = 1) const bool SOFT = false;
const bool OWN_VIEW = SOFT || FORM == FORM_PUNCTUAL || FORM == FORM_DIRECTIONAL;
const bool AREA = FORM == FORM_POLYGON || FORM == FORM_CLIPPED || FORM == FORM_DISK;

#include "visibility.glsl"

layout(push_constant, scalar) uniform Push {
    Receivers receivers;
    Tiles tiles;
    Instances instances;
    Lights lights;
    Pairs list;
    ListHeads head;
    Views views;
    Sums sums;
    float scale;   // fixed-point units per lux
    float epsilon; // half a texel
    float disk_area; // factor of a disk's area in its form factor's denominator
    float bias;    // relative
};

// Whether the whole emitter lies behind the receiver's surface, which the interpolated normal may not tell.
bool hidden(Light light, vec3 p, vec3 face) {
    if (FORM == FORM_DIRECTIONAL) return dot(face, light.normal) >= 0.0;
    float above = dot(face, light.position - p);
    return FORM == FORM_PUNCTUAL || FORM == FORM_DISK ? above <= 0.0 : above <= -light.radius;
}

// How far p is moved out of the emitter's plane where it lies within epsilon of it (VPL13 fig. 8); in the receiver's plane.
vec3 out_of_plane(Light light, vec3 p, vec3 n) {
    float height = dot(p - light.position, light.normal);
    vec3 up = light.normal - n * dot(n, light.normal);
    float climb = dot(up, light.normal);
    return up * (abs(height) < epsilon && climb > 0.25 ? (epsilon - height) / climb : 0.0);
}

// Irradiance without visibility at p, per unit of flux (area lights) or intensity (the others). `factor`: a polygon's form factor.
float transfer(Light light, vec3 p, vec3 n, float factor) {
    if (FORM == FORM_DIRECTIONAL) return max(0.0, -dot(n, light.normal));
    vec3 to_light = light.position - p;
    if (FORM == FORM_PUNCTUAL) {
        float d2 = dot(to_light, to_light);
        vec3 l = to_light * inversesqrt(d2);
        // Spot falloff as KHR_lights_punctual suggests; a point has scale 0, offset 1.
        float cone = clamp(-dot(l, light.normal) * light.spot_scale + light.spot_offset, 0.0, 1.0);
        return d2 > 0.0 ? max(0.0, dot(n, l)) * cone * cone / d2 : 0.0;
    }
    float height = -dot(to_light, light.normal);
    if (FORM == FORM_DISK) {
        float d2 = dot(to_light, to_light);
        float cosines = max(0.0, dot(n, to_light)) * max(0.0, height) / d2;
        return d2 > 0.0 ? cosines / (PI * d2 + disk_area * light.area) : 0.0;
    }
    // In the polygon's own plane, or within rounding of it, edges have no direction to speak of.
    return height > 1e-5 * light.radius ? max(0.0, factor) / light.area : 0.0;
}

// A point has two hemicubes, back to back: the one that p lies in.
View facing(View front, View back, vec3 p) {
    if (FORM != FORM_PUNCTUAL) return front;
    bool behind = dot(front.z, p - front.origin) < 0.0;
    View view = front;
    view.x = behind ? back.x : front.x;
    view.y = behind ? back.y : front.y;
    view.z = behind ? back.z : front.z;
    view.depth = behind ? back.depth : front.depth;
    return view;
}

// Where more than one place of a view is looked at, or which one it is differs among receivers.
float visibility(float radius, View view, vec3 p, vec3 face, Clearance clearance) {
    if (FORM == FORM_DIRECTIONAL) return parallel_visibility(view, p, face, clearance, bias);
    if (SOFT) return soft_visibility(view, p, face, clearance, radius, bias);
    return visibility(Uints(view.depth), sight(view, p, face, clearance, bias));
}

// Fixed-point sums of a batch in two halves of 32 bits: 64-bit arithmetic waits until its end. Values beyond 2^49 units
// (2^21 times the scene's mean irradiance) saturate.
const float HALF = 16777216.0; // 2^24
const float MOST = 562949953421312.0; // 2^49

// Adds flux times value, rounded to units, as often as `times` (-1, 0, 1) says. Subtracting is adding the negative: rounding
// is symmetric.
void add(vec3 flux, float value, float times, inout ivec3 high, inout ivec3 low) {
    vec3 units = clamp(round(flux * value), -MOST, MOST) * times;
    vec3 upper = floor(units / HALF);
    high += ivec3(upper);
    low += ivec3(units - upper * HALF);
}

// Texels of an invocation: what is read of a light serves them all.
const uint TEXELS = TILE / gl_WorkGroupSize.x;

void main() {
    if (list_index() >= head.at[0].entries) return;
    uvec2 entry = list.at[list_index()];
    uint first = gl_LocalInvocationIndex;
    vec3 positions[TEXELS], normals[TEXELS], faces[TEXELS];
    Clearance clearances[TEXELS];
    ivec3 high[TEXELS], low[TEXELS];
    [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
        uint slot = entry.x * TILE + first + k * gl_WorkGroupSize.x;
        positions[k] = receivers.at[slot].position;
        normals[k] = receivers.at[slot].normal;
        faces[k] = receivers.at[slot].face;
        clearances[k] = receivers.at[slot].clearance;
        high[k] = low[k] = ivec3(0);
    }
    Instance instance = instances.at[tiles.at[entry.x].instance];
    uint mask = entry.y;
    for (;;) {
        uint i = uint(findLSB(mask));
        mask &= mask - 1;
        Light light = lights.at[i];
        View first_view = views.at[light.view];
        // What a difference was in the other version, it is no more.
        bool difference = light.other_view != light.view;
        float comes = difference ? (stands(instance, light.version) ? 1.0 : 0.0) : float(light.sign);
        float goes = stands(instance, light.other) ? -1.0 : 0.0;
        // Where it is looked up once, to do so again costs less than asking of every light whether it is dimmed.
        bool dimmed = any(notEqual(light.other_flux, vec3(0.0)));
        bool twice = difference || dimmed && !OWN_VIEW;
        vec3 moved[TEXELS];
        float factors[TEXELS];
        [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
            moved[k] = positions[k];
            if (AREA) moved[k] += out_of_plane(light, positions[k], normals[k]);
            factors[k] = 0.0;
        }
        if (FORM == FORM_POLYGON || FORM == FORM_CLIPPED) {
            Corner corners[TEXELS], leave[TEXELS], enter[TEXELS];
            vec3 last = lights.at[i].vertex[light.vertices - 1];
            [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
                corners[k] = corner(last - moved[k], normals[k]);
                leave[k] = enter[k] = Corner(vec3(0.0), 0.0);
            }
            uint v = 0;
            for (;;) {
                vec3 vertex = lights.at[i].vertex[v];
                [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
                    Corner next = corner(vertex - moved[k], normals[k]);
                    if (FORM == FORM_CLIPPED) factors[k] += clipped_edge(corners[k], next, normals[k], leave[k], enter[k]);
                    else factors[k] += edge(corners[k].direction, next.direction, normals[k]);
                    corners[k] = next;
                }
                if (++v >= light.vertices) break;
            }
            if (FORM == FORM_CLIPPED)
                [[unroll]] for (uint k = 0; k < TEXELS; ++k) factors[k] += edge(leave[k].direction, enter[k].direction, normals[k]);
        }
        float values[TEXELS];
        Sight sights[TEXELS];
        [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
            // Both, then the choice: on SIMD processors a branch around the loop over edges costs more than the loop.
            bool dark = hidden(light, positions[k], faces[k]);
            float value = transfer(light, moved[k], normals[k], factors[k]) * scale;
            values[k] = dark ? 0.0 : value;
            if (!OWN_VIEW) sights[k] = sight(first_view, moved[k], faces[k], clearances[k], bias);
        }
        // Once for each version, or flux, by the same instructions: only so is what is taken away what was added, to the last bit.
        uint version = 0;
        for (;;) {
            uint index = version == 0 ? light.view : light.other_view;
            float times = version == 0 ? comes : difference ? goes : -1.0;
            vec3 flux = version == 0 || difference ? light.flux : light.other_flux;
            View front = views.at[index];
            View back = views.at[light.kind == LIGHT_POINT ? index + 1 : index];
            [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
                float seen = OWN_VIEW ? visibility(light.radius, facing(front, back, moved[k]), moved[k], faces[k], clearances[k])
                                      : visibility(Uints(front.depth), sights[k]);
                add(flux, values[k] * seen, times, high[k], low[k]);
                if (OWN_VIEW && dimmed) add(light.other_flux, values[k] * seen, -1.0, high[k], low[k]);
            }
            if (++version > uint(twice)) break;
        }
        if (mask == 0) break;
    }
    uint start = tiles.at[entry.x].sums * TILE * 3 + first;
    // An object that moved stands in several places at once, in different versions: their tiles meet in the same sums.
    bool shared_sums = instance.crowded != 0;
    [[unroll]] for (uint k = 0; k < TEXELS; ++k) {
        [[unroll]] for (uint channel = 0; channel < 3; ++channel) {
            uint slot = start + k * gl_WorkGroupSize.x + channel * TILE;
            int64_t sum = int64_t(high[k][channel]) * 16777216L + low[k][channel];
            if (shared_sums) atomicAdd(sums.at[slot], sum);
            else sums.at[slot] += sum;
        }
    }
}
