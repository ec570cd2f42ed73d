#version 460
// Turns list lengths into workgroup counts, one invocation a list.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"

layout(local_size_x = 8) in;

layout(push_constant, scalar) uniform Push {
    ListHeads heads;
    Sums totals;  // entries and weight of each list, over all batches
    uint count;
    uint counted; // a bit for each list that is complete by now
};

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    uint length = heads.at[i].entries;
    heads.at[i].groups_x = min(length, LIST_ROW);
    heads.at[i].groups_y = (length + LIST_ROW - 1) / LIST_ROW;
    heads.at[i].groups_z = 1;
    if ((counted >> i & 1) == 0) return;
    totals.at[2 * i] += int64_t(length);
    totals.at[2 * i + 1] += int64_t(heads.at[i].weight);
}
