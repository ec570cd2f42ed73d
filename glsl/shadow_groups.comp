#version 460
// Which groups of chunks can be seen in which view: appends (group, view and level) to the list of what stands in both of a light's versions,
// once for both, or to that of what one of them has alone.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"
#include "faces.glsl"

layout(local_size_x = 64) in;

// Views have limits.
layout(constant_id = 0) const bool LIMITED = false;

layout(push_constant, scalar) uniform Push {
    Groups groups;
    Instances instances;
    Views views;
    Pairs both;
    ListHeads both_head;
    Pairs own;
    ListHeads own_head;
    uint group_count;
};

// Groups of an invocation: they share the reading of the view.
layout(constant_id = 1) const uint EACH = 1;

void list(uint group, uint index, View view, uint open) {
    Instance instance = instances.at[groups.at[group].instance];
    bool in_both = stands(instance, view.other);
    // What was kept of the view need not be drawn.
    bool drawn = view.kept < KEPT_BOTH || !in_both;
    bool asked = stands(instance, view.version) && drawn && (!in_both || view.base >= 0);
    vec3 offset = groups.at[group].center - view.origin;
    vec3 extent = groups.at[group].extent;
    uint faces = asked ? faces_of(view, offset, extent) & open : 0;
    if (LIMITED) {
        for (uint left = faces; left != 0; left &= left - 1) {
            uint face = uint(findLSB(left));
            bool out_of_it = unasked(view, face, views.at[index].asked[face], framed(face_axes(face, view.x, view.y, view.z), offset, extent));
            faces &= out_of_it ? ~(1u << face) : ~0u;
        }
    }
    if (faces == 0) return;
    // The coarsest level whose error the view does not see.
    float cell = view.coarse * length(max(abs(offset) - extent, vec3(0.0)));
    uint level = 0;
    [[unroll]] for (uint k = 1; k < LEVELS; ++k) {
        float at = groups.at[group].cell[k];
        level = at > 0.0 && at <= cell ? k : level;
    }
    uvec2 entry = uvec2(group, index | level << 6);
    if (in_both) both.at[atomicAdd(both_head.at[0].entries, 1)] = entry;
    else own.at[atomicAdd(own_head.at[0].entries, 1)] = entry;
}

void main() {
    uint index = gl_WorkGroupID.y;
    // Nor need any of what was kept whole.
    if (views.at[index].kept == KEPT_ALL) return;
    View view = views.at[index];
    uint open = LIMITED ? open_faces(views, index) : 31;
    uint group = gl_WorkGroupID.x * gl_WorkGroupSize.x * EACH + gl_LocalInvocationIndex;
    for (uint left = EACH;;) {
        if (group < group_count) list(group, index, view, open);
        group += gl_WorkGroupSize.x;
        if (--left == 0) break;
    }
}
