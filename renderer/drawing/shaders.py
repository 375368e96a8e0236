"""Shaders of the static background: a gradient, the floor with its grid, the shadow on it."""

VERSION = "#version 330\n"

COLORS = """
// A polynomial in place of a power, within 0.002 of sRGB.
vec3 to_linear(vec3 c) { return c * (c * (c * 0.305306 + 0.682171) + 0.012523); }
// Two roots in place of a power: within 0.011 of sRGB, and much faster in software.
vec3 to_srgb(vec3 c) {
    c = clamp(c, 0.0, 1.0);
    vec3 root = sqrt(c);
    return 1.371364 * root - 0.117600 * sqrt(root) - 0.253764 * c;
}
vec3 backdrop(float height) {
    // Neutral grey-blue, lighter towards the floor: operators look at it for hours.
    return mix(vec3(0.805, 0.825, 0.845), vec3(0.665, 0.700, 0.740), smoothstep(0.0, 1.0, height));
}
"""
COMMON = VERSION + COLORS

FULL_PICTURE_VERTEX = (
    COMMON
    + """
out vec2 place;                       // 0 to 1, upwards
void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    place = vec2(corner.x, 1.0 - corner.y);
    gl_Position = vec4(corner * 2.0 - 1.0, 0.9999, 1.0);
}
"""
)

BACKDROP_FRAGMENT = (
    COMMON
    + """
in vec2 place;
out vec4 color;
uniform float level;                  // 1: seen from the side; 0: from above
void main() { color = vec4(backdrop(mix(0.35, place.y, level)), 1.0); }
"""
)

# Blends a layer with several samples per pixel over the picture.
COMPOSE_FRAGMENT = """
uniform sampler2DMS layer;
out vec4 color;
void main() {
    vec4 sum = vec4(0.0);
    for (int each = 0; each < SAMPLES; ++each) sum += texelFetch(layer, ivec2(gl_FragCoord.xy), each);
    color = sum / float(SAMPLES);
}
"""

# A rectangle of the picture, in clip coordinates.
RECTANGLE_VERTEX = """#version 330
uniform vec4 rectangle;
void main() {
    vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1);
    gl_Position = vec4(mix(rectangle.xy, rectangle.zw, corner), 0.0, 1.0);
}
"""

# A plane through `origin`, spanned by `u` and `v`, with lines every `fine` and `coarse` metres.
PLANE_VERTEX = (
    COMMON
    + """
uniform mat4 site_to_clip;
uniform vec3 origin, u, v;
uniform float extent;
uniform vec4 drawn;                   // part of it that is drawn, -1 to 1
out vec2 place;                       // on the plane [m]
void main() {
    vec2 corner = mix(drawn.xy, drawn.zw, vec2(gl_VertexID & 1, gl_VertexID >> 1)) * extent;
    place = corner;
    gl_Position = site_to_clip * vec4(origin + u * corner.x + v * corner.y, 1.0);
}
"""
)

PLANE_FRAGMENT = (
    COMMON
    + """
uniform float fine, coarse, extent, strength, floor_light;
in vec2 place;
out vec4 color;
float line(float step_m, float width_px) {
    vec2 wide = fwidth(place) / step_m;
    vec2 off = abs(fract(place / step_m + 0.5) - 0.5);
    vec2 on = 1.0 - smoothstep(wide * (width_px - 0.5), wide * (width_px + 0.5), off);
    // Lines closer together than a few pixels become an even tone, then fade out.
    on *= 1.0 - smoothstep(vec2(0.12), vec2(0.4), wide);
    return max(on.x, on.y);
}
void main() {
    float out_there = length(place) / extent;
    float far = 1.0 - smoothstep(0.30, 1.0, out_there);
    float lines = max(0.15 * line(fine, 0.5), 0.40 * line(coarse, 0.65)) * strength * far;
    // Light around the arm, so that the plane looks like a floor.
    float pool = 0.55 * floor_light * (1.0 - smoothstep(0.05, 0.75, out_there));
    vec3 shade = mix(vec3(0.90, 0.91, 0.92), vec3(0.40, 0.45, 0.51), lines / max(lines + pool, 1e-4));
    color = vec4(shade, lines + pool - lines * pool);
}
"""
)

SHADE_FRAGMENT = """#version 330
uniform sampler2D shadow;
uniform float extent;
in vec2 place;
out vec4 color;
void main() { color = vec4(0.10, 0.12, 0.15, texture(shadow, place / (2.0 * extent) + 0.5).r); }
"""

# Seen from below against the light: the height of the lowest body above each position of the floor.
SHADOW_VERTEX = """#version 330
uniform mat4 part_to_site;
uniform vec2 center;
uniform float extent, floor_height, tallest;
uniform vec3 key;                     // towards the lamp
in vec3 position;
out float height;
void main() {
    vec3 at = (part_to_site * vec4(position, 1.0)).xyz;
    height = max(at.z - floor_height, 0.0);
    // Steeper than the lamp: a shadow close to its body shows the body's position.
    vec2 falls = at.xy - key.xy / key.z * 0.75 * height - center;
    gl_Position = vec4(falls / extent, clamp(height / tallest, 0.0, 1.0) * 2.0 - 1.0, 1.0);
}
"""

SHADOW_FRAGMENT = """#version 330
in float height;
out float lowest;
void main() { lowest = height; }
"""
