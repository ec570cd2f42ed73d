// Which faces of a view a box can be seen in. Needs view.glsl.

// On which sides of the plane through the origin some of a box lies: in front, behind.
bvec2 sides(vec3 plane, vec3 offset, vec3 extent) {
    float at = dot(plane, offset), reach = dot(abs(plane), extent);
    return bvec2(at + reach > 0.0, reach - at > 0.0);
}

// A bit for each face that a box can be seen in.
uint faces_of(View view, vec3 offset, vec3 extent) {
    if (view.kind == VIEW_ORTHOGRAPHIC)
        return abs(dot(view.x, offset)) - dot(abs(view.x), extent) < 1.0 && abs(dot(view.y, offset)) - dot(abs(view.y), extent) < 1.0 ? 1 : 0;
    // Faces meet in these planes; what lies wholly beyond one of a face's is not in it. Side faces end at the horizon.
    bvec2 zx = sides(view.z - view.x, offset, extent), xz = sides(view.z + view.x, offset, extent);
    bvec2 zy = sides(view.z - view.y, offset, extent), yz = sides(view.z + view.y, offset, extent);
    bvec2 yx = sides(view.x - view.y, offset, extent), xy = sides(view.x + view.y, offset, extent);
    bool above = sides(view.z, offset, extent).x;
    return (zx.x && xz.x && zy.x && yz.x ? 1 : 0) | (above && zx.y && yx.x && xy.x ? 2 : 0) | (above && xz.y && yx.y && xy.y ? 4 : 0)
        | (above && zy.y && yx.y && xy.x ? 8 : 0) | (above && yz.y && yx.x && xy.y ? 16 : 0);
}

// Whether a box in a face's axes lies beyond a side of a rectangle of (s, t).
bool beside(vec4 r, vec3 center, vec3 half_size) {
    vec4 way = vec4(r.xy * center.z - center.xy, center.xy - r.zw * center.z);
    vec4 reach = half_size.xyxy + abs(r) * half_size.z;
    return any(greaterThan(way, reach));
}

// Faces of which anything is asked (View.asked), a bit each.
uint open_faces(Views views, uint index) {
    uint open = 31;
    [[unroll]] for (uint face = 0; face < FACES; ++face) {
        uint asked = views.at[index].asked[face];
        open &= (asked & 255) > (asked >> 16 & 255) ? ~(1u << face) : ~0u;
    }
    return open;
}

// A box in a face's axes.
struct Framed {
    vec3 center;
    vec3 half_size;
};

Framed framed(Face f, vec3 offset, vec3 extent) {
    return Framed(vec3(dot(f.u, offset), dot(f.v, offset), dot(f.w, offset)), vec3(dot(abs(f.u), extent), dot(abs(f.v), extent), dot(abs(f.w), extent)));
}

// Whether it lies beside what is asked of a face.
bool unasked(View view, uint face, uint asked, Framed box) {
    // Rays of an orthographic map are parallel.
    bool hemicube = view.kind == VIEW_HEMICUBE;
    float at = hemicube ? box.center.z : 1.0, deep = hemicube ? box.half_size.z : 0.0;
    return beside(rectangle(asked, hemicube && face != 0), vec3(box.center.xy, at), vec3(box.half_size.xy, deep));
}
