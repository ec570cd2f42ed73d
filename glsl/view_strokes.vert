#version 460
// Lines and points of marks, as rectangles that face the eye.
#extension GL_GOOGLE_include_directive : require
#include "view_marks.glsl"

layout(location = 0) out vec4 color;
// From the middle (0) to the edge (1) of a point; 0 on lines.
layout(location = 1) out vec2 across;
layout(location = 2) flat out float width;

const vec2 CORNERS[6] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(1, 1), vec2(-1, -1), vec2(1, 1), vec2(-1, 1));

// Where a line that goes behind the eye leaves the picture: there its depth is 1.
vec4 cut(vec4 inside, vec4 outside) {
    float in_by = inside.w - inside.z;
    return mix(inside, outside, in_by / (in_by - (outside.w - outside.z)));
}

void main() {
    Stroke s = strokes.at[gl_VertexIndex / 6];
    vec2 corner = CORNERS[gl_VertexIndex % 6];
    bool point = s.from == s.to;
    color = unpackUnorm4x8(s.color);
    width = s.width + 1.0;
    across = point ? corner : vec2(0.0);
    vec4 a = picture.it.clip * vec4(s.from, 1.0);
    vec4 b = picture.it.clip * vec4(s.to, 1.0);
    bool a_out = a.w < a.z, b_out = b.w < b.z;
    if (a_out && b_out) {
        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
        return;
    }
    if (a_out) a = cut(b, a);
    else if (b_out) b = cut(a, b);
    vec2 along = (b.xy / b.w - a.xy / a.w) * size;
    along = length(along) > 1e-4 ? normalize(along) : vec2(1.0, 0.0);
    vec2 aside = vec2(-along.y, along.x);
    vec4 place = corner.x < 0.0 ? a : b;
    float reach = point ? width : s.width;
    place.xy += (along * corner.x + aside * corner.y) * reach / size * place.w;
    gl_Position = vec4(place.xy, place.z * NEARER * NEARER, place.w);
}
