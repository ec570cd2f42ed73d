#version 460
// Which chunk of triangles can be seen in which face of which view: appends (chunk, view and face).
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push {
    Chunks chunks;
    Instances instances;
    Views views;
    Pairs list;
    ListHeads head;
    uint chunk_count;
};

// Whether a box around `offset` from the view's origin touches what the view is limited to.
bool matters(uint view, vec3 offset, vec3 extent) {
    // Loaded as one: see the driver's trap with parts of a vec4.
    vec4 limit = views.at[view].limit;
    if (views.at[view].kind == VIEW_ORTHOGRAPHIC) {
        vec3 x = views.at[view].x, y = views.at[view].y;
        return abs(dot(x, offset) - limit.x) <= dot(abs(x), extent) + limit.z
            && abs(dot(y, offset) - limit.y) <= dot(abs(y), extent) + limit.w;
    }
    float distance = length(offset);
    float radius = length(extent);
    if (limit.w > PI || distance <= radius) return true;
    float angle = acos(clamp(dot(limit.xyz, offset) / distance, -1.0, 1.0));
    return angle <= limit.w + asin(radius / distance) + 1e-3;
}

void main() {
    uint chunk = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    if (chunk >= chunk_count) return;
    if (!stands(instances.at[chunks.at[chunk].instance], views.at[view].version)) return;
    vec3 offset = chunks.at[chunk].center - views.at[view].origin;
    vec3 extent = chunks.at[chunk].extent;
    if (!matters(view, offset, extent)) return;
    vec3 x = views.at[view].x;
    vec3 y = views.at[view].y;
    vec3 z = views.at[view].z;
    bool hemicube = views.at[view].kind == VIEW_HEMICUBE;
    uint faces = hemicube ? 5 : 1;
    for (uint face = 0; face < faces; ++face) {
        Face f = face_axes(face, x, y, z);
        bool seen;
        if (hemicube) {
            // The box lies wholly beyond one of the planes u = w, u = -w, v = w, v = -w (side faces: v = 0).
            vec3 n0 = f.w - f.u, n1 = f.w + f.u, n2 = f.w - f.v, n3 = face == 0 ? f.w + f.v : f.v;
            seen = dot(n0, offset) + dot(abs(n0), extent) > 0.0 && dot(n1, offset) + dot(abs(n1), extent) > 0.0
                && dot(n2, offset) + dot(abs(n2), extent) > 0.0 && dot(n3, offset) + dot(abs(n3), extent) > 0.0;
        } else {
            seen = abs(dot(x, offset)) - dot(abs(x), extent) < 1.0 && abs(dot(y, offset)) - dot(abs(y), extent) < 1.0;
        }
        if (seen) list.at[atomicAdd(head.at[0].entries, 1)] = uvec2(chunk, view * 8 + face);
    }
}
