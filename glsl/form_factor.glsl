// Form factor of a differential receiver to a polygon, edge by edge (Baum et al. 1989; VPL13 eqs. 3 and 4). Vertices are
// relative to the receiver and counter-clockwise seen from the polygon's front.

// angle / (2 pi sin(angle)) of the angle between unit vectors with the given cosine: rational fit of Heitz et al. 2016,
// "Real-time polygonal-light shading with linearly transformed cosines", whose error is 0.02 % in the mean. The sine comes
// from the cross product: near 180 degrees nothing of it is left in the cosine.
float angle_over_sine(float cosine, float sine_squared) {
    float x = abs(cosine);
    float near = (0.8543985 + (0.4965155 + 0.0145206 * x) * x) / (3.4175940 + (4.1616724 + x) * x);
    return cosine > 0.0 ? near : 0.5 * inversesqrt(max(sine_squared, 1e-20)) - near;
}

// A vertex: the way to it, of length 1, and how far above the horizon that leads.
struct Corner {
    vec3 direction;
    float height;
};

Corner corner(vec3 way, vec3 n) {
    vec3 direction = way * inversesqrt(max(dot(way, way), 1e-30));
    return Corner(direction, dot(direction, n));
}

// Of unit vectors. A degenerate edge (a = b = 0) gives 0.
float edge(vec3 a, vec3 b, vec3 n) {
    vec3 c = cross(a, b);
    return -dot(c, n) * angle_over_sine(dot(a, b), dot(c, c));
}

// The part of an edge above the receiver's horizon; notes where the outline leaves and enters the upper half space.
float clipped_edge(Corner a, Corner b, vec3 n, inout Corner leave, inout Corner enter) {
    Corner crossing = corner(a.direction + (b.direction - a.direction) * clamp(a.height / (a.height - b.height), 0.0, 1.0), n);
    bool down = a.height > 0.0 && b.height <= 0.0;
    bool up = a.height <= 0.0 && b.height > 0.0;
    if (down) leave = crossing;
    if (up) enter = crossing;
    float part = edge(up ? crossing.direction : a.direction, down ? crossing.direction : b.direction, n);
    return a.height > 0.0 || b.height > 0.0 ? part : 0.0;
}
