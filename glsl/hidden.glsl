// Tests against the blocks of a hemicube (depth_blocks.comp): conservative, so that what is left out changes no bit.

// The most blocks that are looked at; what spreads over more is taken as seen.
const uint MOST_BLOCKS = 64;

// Whether a box (centre and half size in a face's axes) lies behind the farthest thing in every block that it touches, of
// those that are asked for (View.asked, whole blocks), even if it were nearer by the factor `slack`. `whole`: all of it must lie
// inside the face.
bool covered(Uints depth, uint size, uint face, uint asked, vec3 center, vec3 half_size, float slack, bool whole) {
    float near = center.z - half_size.z, far = center.z + half_size.z;
    if (near <= 1e-4 * far) return false;
    vec2 low = center.xy - half_size.xy, high = center.xy + half_size.xy;
    low /= mix(vec2(near), vec2(far), greaterThan(low, vec2(0.0)));
    high /= mix(vec2(far), vec2(near), greaterThan(high, vec2(0.0)));
    float shift = face == 0 ? 1.0 : 0.0;
    const float scale = 0.5 * float(BLOCKS);
    const float margin = 0.01; // blocks: for rounding
    uvec2 last = uvec2(BLOCKS, face == 0 ? BLOCKS : BLOCKS / 2) - 1;
    vec2 origin = vec2(1.0, shift);
    if (whole && (any(lessThan(low, -origin)) || any(greaterThan(high, vec2(1.0))))) return false;
    uvec2 from = min(uvec2(max((low + origin) * scale - margin, vec2(0.0))), last);
    uvec2 to = min(uvec2(max((high + origin) * scale + margin, vec2(0.0))), last);
    const uint across = 256 / BLOCKS;
    uint down = face == 0 ? across : 2 * across;
    from = max(from, uvec2((asked & 255) / across, (asked >> 8 & 255) / down));
    to = min(to, uvec2((asked >> 16 & 255) / across, (asked >> 24) / down));
    if (any(greaterThan(from, to))) return true;
    uvec2 span = to - from + 1;
    uint left = span.x * span.y;
    if (left > MOST_BLOCKS) return false;
    uint start = first_block(size) + (face == 0 ? 0 : BLOCKS * BLOCKS + (face - 1) * (BLOCKS * BLOCKS / 2));
    uint block = start + from.y * BLOCKS + from.x;
    float farthest = 1e30;
    uint column = 0;
    for (;;) {
        farthest = min(farthest, uintBitsToFloat(depth.at[block + column]));
        if (--left == 0) break;
        bool wrap = ++column == span.x;
        column = wrap ? 0 : column;
        block += wrap ? BLOCKS : 0;
    }
    return farthest * near > slack;
}
