// Reads the views of a light. What lies in the receiver's own plane must not shade it: the receiver is moved along its
// face normal by what one pixel spans, and depths are compared with a relative slack.

// Pixels by which receivers are lifted: face on, and more at grazing angles. Direct light needs its shadows where they
// are; the coarse maps of indirect lights would darken every fold.
const vec2 DIRECT_LIFT = vec2(0.05, 0.1);
const vec2 INDIRECT_LIFT = vec2(0.1, 0.5);

// A receiver's lookup.
struct Lookup {
    vec3 d;      // where, relative to the view's origin
    float range; // how far away that is
    float limit; // as far away at most is what hides the receiver
    float bias;  // relative slack of the comparison
};

// Where a hemicube holds what is seen in a direction, and what turns that into how much nearer it is than a receiver's plane.
struct Sight {
    uint pixel;  // from the map's first element
    float plane; // distance along the pixel's ray
    float most;  // the nearness that does not hide the receiver yet
};

// Along the ray of the pixel that `direction` falls into; the receiver's plane goes through `local` and has the normal `n`,
// both in the view's axes. Measuring at the pixel's own centre keeps a plane from shading itself at any angle.
Sight sight(uint size, vec3 direction, vec3 local, vec3 n, Lookup at) {
    vec3 a = abs(direction);
    bool top = direction.z >= max(a.x, a.y);
    bool along_x = a.x >= a.y;
    float w = top ? direction.z : (along_x ? a.x : a.y);
    float u = top || !along_x ? direction.x : direction.y;
    float v = top ? direction.y : direction.z;
    float facing = (along_x ? direction.x : direction.y) < 0.0 ? -1.0 : 1.0;
    uint side = (along_x ? 0 : 2) + (facing < 0.0 ? 1 : 0);
    float inverse = 1.0 / w;
    float half_size = 0.5 * float(size);
    float shift = top ? 1.0 : 0.0;
    // Clamped as integers: no direction, not even an undefined one, leads out of the map.
    uint column = min(uint(max((u * inverse + 1.0) * half_size, 0.0)), size - 1);
    uint row = min(uint(max((v * inverse + shift) * half_size, 0.0)), (top ? size : size / 2) - 1);
    uint start = top ? 0 : size * size + side * (size * size / 2);
    // The pixel's ray is s, t, 1 in the face's axes; the plane's inverse depth along it is n . ray / n . local.
    float s = (float(column) + 0.5) / half_size - 1.0;
    float t = (float(row) + 0.5) / half_size - shift;
    vec3 ray = top ? vec3(s, t, 1.0) : (along_x ? vec3(facing, s, t) : vec3(s, facing, t));
    float plane = dot(n, local);
    float along = dot(n, ray);
    // What is no nearer than the receiver hides nothing of it, wherever the ray meets its plane, if at all.
    float far = inversesqrt(dot(ray, ray));
    return Sight(start + row * size + column, along < 0.0 ? min(plane / along, at.limit * far) : at.range * far, 1.0 + at.bias);
}

// That of what is nearest along the ray: above 1 it hides the receiver.
float nearness(Uints depth, Sight sight) {
    return uintBitsToFloat(depth.at[sight.pixel]) * sight.plane;
}

// As far away from what stands beside a receiver it is looked up: pixels' half widths, so that no pixel that the lookup
// falls into sees that instead.
const float CLEAR = 1.5;
// What is nearer above a receiver than this, in the same measure, covers it.
const float COVER = 8.0;
// How much further away than the receiver, in the same measure, what covers it may be met.
const float BEYOND = 4.0;

// Moved along its normal by what a pixel spans there, but no further than half the way to what covers it, and away from
// what stands beside it. The comparison's slack is no more than half of what is left. What covers the receiver so closely
// that pixels' rays meet it at other distances hides it wherever they do.
Lookup lookup(View view, vec3 p, vec3 n, Clearance clearance, vec2 lift, float bias) {
    vec3 d = p - view.origin;
    float distance = length(d);
    float cosine = dot(d, n) / max(distance, 1e-20);
    float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
    float pixel = distance / float(view.size);
    float pushed = clamp(CLEAR * pixel - clearance.near, 0.0, clearance.way);
    Lookup at;
    at.d = d + n * min(pixel * (lift.x + lift.y * sine), 0.5 * clearance.room) + clearance.push * pushed;
    at.range = length(at.d);
    at.limit = clearance.room < COVER * pixel ? at.range + BEYOND * pixel : at.range;
    at.bias = min(bias, 0.25 * clearance.room / max(at.range, 1e-20));
    return at;
}

vec3 to_local(View view, vec3 d) {
    return vec3(dot(view.x, d), dot(view.y, d), dot(view.z, d));
}

// As to_local, kept inside the hemicube.
vec3 to_direction(vec3 local) {
    return vec3(local.xy, max(local.z, 1e-9));
}

Sight sight(View view, vec3 p, vec3 n, Clearance clearance, float bias) {
    Lookup at = lookup(view, p, n, clearance, INDIRECT_LIFT, bias);
    vec3 local = to_local(view, at.d);
    Sight s = sight(view.size, to_direction(local), local, to_local(view, n), at);
    // What lies behind the surface that the light is on, that hides.
    s.most = dot(view.z, p - view.origin) < 0.0 ? -3e38 : s.most;
    return s;
}

// 1, or 0.
float visibility(Uints depth, Sight sight) {
    return nearness(depth, sight) > sight.most ? 0.0 : 1.0;
}

const float SOFT_FURTHEST = 2.0;
// Taps come in rounds of four, a quarter turn apart: where blockers are searched beside the receiver's own ray, then the two
// rings of the filter.
const uint ROUNDS = 1 + FILTER_TAPS / 4;
const vec2 ROUND[ROUNDS] = vec2[](vec2(0.65, 0.25), vec2(0.354, 0.0), vec2(0.56, 0.56));

// Percentage-closer soft shadows (Fernando 2005) of an emitter of the given radius, zero included: 5 taps find the mean
// blocker, and if there is one, 8 taps filter over the penumbra it casts, never narrower than a pixel. Each tap is compared with the
// receiver's plane, not with the receiver; and what a tap at distance L from the receiver's own ray finds can only cut a
// ray to the emitter if radius (nearness - 1) >= L, by similar triangles: a wall beside the receiver does not. Where the
// receiver's own ray is cut, whatever a tap finds counts: a nearer blocker may hide from the map what cuts that ray too.
float soft_visibility(View view, vec3 p, vec3 n, Clearance clearance, float radius, float bias) {
    Uints depth = Uints(view.depth);
    uint size = view.size;
    Lookup at = lookup(view, p, n, clearance, DIRECT_LIFT, bias);
    vec3 d = at.d;
    float distance = at.range;
    bias = at.bias;
    vec3 local = to_local(view, d);
    vec3 local_n = to_local(view, n);
    // Across the receiver's ray, in the view's axes: taps are sums of these.
    vec3 t = normalize(abs(local.x) > abs(local.z) ? vec3(-local.y, local.x, 0.0) : vec3(0.0, -local.z, local.y));
    vec3 b = cross(local, t) / max(distance, 1e-20);
    // What lies further away than twice the receiver does not matter: the host draws no more for a receiver's taps.
    at.limit = min(at.limit, SOFT_FURTHEST * distance);
    float pixel = 2.0 * distance / float(size);
    float reach = max(min(radius, 0.5 * distance), pixel);

    float own = min(nearness(depth, sight(size, to_direction(local), local, local_n, at)), 8.0);
    bool cut = own > 1.0 + bias;
    float blockers = cut ? 1.0 : 0.0, inverse_sum = cut ? own : 0.0;
    float width = reach, lit = 1.0;
    uint round = 0;
    // One loop for both: on SIMD processors its end is the one place where receivers that need no more are left out.
    for (;;) {
        vec2 way = (round == 0 ? ROUND[0] : round == 1 ? ROUND[1] : ROUND[2]) * width;
        vec3 along = t * way.x + b * way.y, across = b * way.x - t * way.y;
        float least = length(way) - pixel;
        float found = 0.0, sum = 0.0;
        [[unroll]] for (uint i = 0; i < 4; ++i) {
            vec3 e = local + (i < 2 ? 1.0 : -1.0) * ((i & 1) == 0 ? along : across);
            float near = min(nearness(depth, sight(size, to_direction(e), local, local_n, at)), 8.0);
            bool blocks = near > 1.0 + bias && (cut || radius * (near - 1.0) >= least);
            found += blocks ? 1.0 : 0.0;
            sum += blocks ? near : 0.0;
        }
        if (round == 0) {
            blockers += found;
            // Penumbra: radius (receiver - blocker) / blocker = radius (nearness - 1).
            width = clamp(radius * ((inverse_sum + sum) / max(blockers, 1.0) - 1.0), pixel, max(2.0 * radius, pixel));
        } else {
            lit -= found / float(FILTER_TAPS);
        }
        if (blockers == 0.0 || ++round == ROUNDS) break;
    }
    return lit;
}

// Orthographic map, four comparisons weighted bilinearly, each at its pixel's centre with the receiver's plane there or,
// where that is further from the light, with the receiver. Outside of the map everything is lit.
float parallel_visibility(View view, vec3 p, vec3 n, Clearance clearance, float bias) {
    Uints depth = Uints(view.depth);
    uint size = view.size;
    float half_size = 0.5 * float(size);
    float pixel = 1.0 / (half_size * length(view.x));
    float scale = inversesqrt(dot(view.z, view.z));
    float cosine = dot(n, view.z) * scale;
    float sine = sqrt(max(0.0, 1.0 - cosine * cosine));
    vec3 d = p - view.origin + n * min(pixel * (DIRECT_LIFT.x + DIRECT_LIFT.y * sine), 0.5 * clearance.room)
           + clearance.push * clamp(CLEAR * 0.5 * pixel - clearance.near, 0.0, clearance.way);
    vec2 at = vec2(dot(view.x, d), dot(view.y, d));
    float value = dot(view.z, d);
    // How the plane's value changes across the map: it is linear.
    vec2 slope = -vec2(dot(n, view.x) / dot(view.x, view.x), dot(n, view.y) / dot(view.y, view.y)) / (max(cosine, 1e-3) * scale);
    vec2 corner = floor((at + 1.0) * half_size - 0.5);
    vec2 weight = (at + 1.0) * half_size - 0.5 - corner;
    float beyond = clearance.room < COVER * 0.5 * pixel ? BEYOND * 0.5 * pixel / scale : 0.0;
    float lit = 0.0;
    for (uint i = 0; i < 4; ++i) {
        vec2 step = vec2(float(i & 1), float(i >> 1));
        vec2 pixel_at = corner + step;
        bool inside = all(greaterThanEqual(pixel_at, vec2(0.0))) && all(lessThan(pixel_at, vec2(float(size))));
        uint index = inside ? uint(pixel_at.y) * size + uint(pixel_at.x) : 0;
        float stored = inside ? uintBitsToFloat(depth.at[index]) : 0.0;
        float plane = value + dot(slope, (pixel_at + 0.5) / half_size - 1.0 - at);
        vec2 w = mix(1.0 - weight, weight, step);
        lit += stored > max(plane, value - beyond) + bias ? 0.0 : w.x * w.y;
    }
    return lit;
}
