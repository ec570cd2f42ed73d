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

// A degenerate edge (leave = enter = 0) gives 0.
float edge(vec3 a, vec3 b, vec3 n) {
    a *= inversesqrt(max(dot(a, a), 1e-30));
    b *= inversesqrt(max(dot(b, b), 1e-30));
    vec3 c = cross(a, b);
    return -dot(c, n) * angle_over_sine(dot(a, b), dot(c, c));
}

// The part of an edge above the receiver's horizon; notes where the outline leaves and enters the upper half space.
float clipped_edge(vec3 a, vec3 b, vec3 n, inout vec3 leave, inout vec3 enter) {
    float ha = dot(a, n), hb = dot(b, n);
    vec3 crossing = a + (b - a) * clamp(ha / (ha - hb), 0.0, 1.0);
    bool down = ha > 0.0 && hb <= 0.0;
    bool up = ha <= 0.0 && hb > 0.0;
    leave = down ? crossing : leave;
    enter = up ? crossing : enter;
    float part = edge(up ? crossing : a, down ? crossing : b, n);
    return ha > 0.0 || hb > 0.0 ? part : 0.0;
}
