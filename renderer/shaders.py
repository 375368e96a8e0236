"""The shaders: a calm backdrop, a floor with its grid, and bodies under a soft box of light.

Colours are computed in linear light and written as sRGB.
"""

_COMMON = """#version 330
vec3 to_linear(vec3 c) { return pow(c, vec3(2.2)); }
vec3 to_srgb(vec3 c) { return pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.2)); }
vec3 backdrop(float height) {
    // Neutral grey-blue, lighter towards the floor: eyes rest on it for hours.
    return mix(vec3(0.80, 0.825, 0.85), vec3(0.585, 0.630, 0.680), smoothstep(0.0, 1.0, height));
}
"""

FULL_PICTURE_VERTEX = (
    _COMMON
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
    _COMMON
    + """
in vec2 place;
out vec4 color;
uniform float level;                  // 1: seen from the side; 0: from above
void main() { color = vec4(backdrop(mix(0.35, place.y, level)), 1.0); }
"""
)

# One texture as it is, or several samples a pixel laid over what is there.
COMPOSE_FRAGMENT = """
uniform float opacity;
out vec4 color;
#if SAMPLES > 0
uniform sampler2DMS layer;
#else
uniform sampler2D layer;
#endif
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
#if SAMPLES > 0
    vec4 sum = vec4(0.0);
    for (int each = 0; each < SAMPLES; ++each) sum += texelFetch(layer, at, each);
    color = sum * (opacity / float(SAMPLES));
#else
    color = texelFetch(layer, at, 0) * opacity;
#endif
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

# A plane through `origin`, spanned by `u` and `v`, with lines each `fine` and `coarse` metres.
PLANE_VERTEX = (
    _COMMON
    + """
uniform mat4 site_to_clip;
uniform vec3 origin, u, v;
uniform float extent;
out vec2 place;                       // on the plane [m]
void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID >> 1) * 2 - 1) * extent;
    place = corner;
    gl_Position = site_to_clip * vec4(origin + u * corner.x + v * corner.y, 1.0);
}
"""
)

PLANE_FRAGMENT = (
    _COMMON
    + """
uniform float fine, coarse, extent, strength;
in vec2 place;
out vec4 color;
float line(float step_m, float width_px) {
    vec2 wide = fwidth(place) / step_m;
    vec2 off = abs(fract(place / step_m + 0.5) - 0.5);
    vec2 on = 1.0 - smoothstep(wide * (width_px - 0.5), wide * (width_px + 0.5), off);
    // Lines nearer to each other than a few pixels become an even tone, then nothing.
    on *= 1.0 - smoothstep(vec2(0.12), vec2(0.4), wide);
    return max(on.x, on.y);
}
void main() {
    float far = 1.0 - smoothstep(0.35, 1.0, length(place) / extent);
    float lines = max(0.20 * line(fine, 0.55), 0.42 * line(coarse, 0.7)) * strength;
    color = vec4(vec3(0.42, 0.47, 0.53), lines * far);
}
"""
)

SHADE_FRAGMENT = """#version 330
uniform sampler2D shadow;
uniform float extent, strength;
in vec2 place;
out vec4 color;
void main() {
    // Nothing at the map's edge, whatever lies there: a shadow has no corners.
    float inside = 1.0 - smoothstep(0.8, 1.0, length(place) / extent);
    color = vec4(0.13, 0.15, 0.18, texture(shadow, place / (2.0 * extent) + 0.5).r * strength * inside);
}
"""

BODY_VERTEX = (
    _COMMON
    + """
uniform mat4 site_to_clip, part_to_site;
in vec3 position, normal;
in vec4 paint, surface;
out vec3 at, facing;
out vec4 body_paint, body_surface;
void main() {
    vec4 place = part_to_site * vec4(position, 1.0);
    at = place.xyz;
    facing = mat3(part_to_site) * normal;
    body_paint = vec4(to_linear(paint.rgb), paint.a);
    body_surface = surface;
    gl_Position = site_to_clip * place;
}
"""
)

BODY_FRAGMENT = (
    _COMMON
    + """
uniform vec3 eye, forward;            // eye: of a perspective camera; forward: of an orthographic one
uniform float orthographic, stale, floor_height;
in vec3 at, facing;
in vec4 body_paint, body_surface;
out vec4 color;

const vec3 KEY = normalize(vec3(0.35, 0.45, 0.95));

// The studio as a mirror sees it: a bright ceiling with a soft box, dim walls, the floor.
vec3 studio(vec3 way, float roughness) {
    float soft = 0.12 + 0.75 * roughness;
    float ceiling = smoothstep(-soft, 0.55 + soft, way.z);
    vec3 walls = mix(vec3(0.20, 0.21, 0.22), vec3(0.62, 0.65, 0.70), ceiling);
    float box = smoothstep(0.80 - soft * 0.5, 0.97, dot(way, KEY));
    return walls + vec3(1.00, 0.98, 0.94) * box * (1.5 - 1.1 * roughness);
}

void main() {
    vec3 n = normalize(facing);
    vec3 to_eye = orthographic > 0.5 ? -forward : normalize(eye - at);
    vec3 albedo = body_paint.rgb;
    float open = body_surface.r, roughness = clamp(body_surface.g, 0.12, 1.0), metallic = body_surface.b;

    // Light from the whole ceiling, what the floor gives back, and a weaker light from the side.
    float up = n.z * 0.5 + 0.5;
    float near_floor = clamp((at.z - floor_height) * 6.0, 0.0, 1.0);
    float sky = open * mix(1.0, 0.55 + 0.45 * near_floor, 1.0 - up);
    vec3 diffuse = mix(vec3(0.21, 0.205, 0.20), vec3(0.50, 0.525, 0.56), up * up) * sky;
    diffuse += vec3(0.60, 0.575, 0.535) * max(dot(n, KEY), 0.0) * mix(0.55, 1.0, open);
    float facing_eye = max(dot(n, to_eye), 0.0);
    diffuse += vec3(0.27, 0.275, 0.285) * facing_eye * open;
    vec3 base = mix(vec3(0.04), albedo, metallic);
    float grazing = (1.0 - facing_eye) * (1.0 - facing_eye);
    grazing *= grazing * (1.0 - facing_eye);
    vec3 fresnel = base + (max(vec3(1.0 - roughness), base) - base) * grazing;
    vec3 mirror = studio(reflect(-to_eye, n), roughness) * fresnel * mix(0.4, 1.0, open) * sky;
    vec3 light = albedo * diffuse * (1.0 - metallic) * (1.0 - fresnel) + mirror;

    // The rim darkens a little, so that a body stands out against one of its own colour.
    light *= mix(0.62, 1.0, smoothstep(0.0, 0.38, facing_eye));
    light = light * 1.16 / (1.0 + 0.22 * light);

    vec3 seen = to_srgb(light);
    float grey = dot(seen, vec3(0.2126, 0.7152, 0.0722));
    seen = mix(seen, vec3(mix(0.60, grey, 0.55)), stale);
    color = vec4(seen, 1.0) * body_paint.a;
}
"""
)

EDGE_VERTEX = (
    _COMMON
    + """
uniform mat4 site_to_clip, part_to_site;
in vec3 position;
void main() {
    gl_Position = site_to_clip * part_to_site * vec4(position, 1.0);
}
"""
)

EDGE_FRAGMENT = """#version 330
uniform vec4 tone;
out vec4 color;
void main() { color = vec4(tone.rgb, 1.0) * tone.a; }
"""

# Seen from below against the light: the height of the lowest thing above each place of the floor.
SHADOW_VERTEX = """#version 330
uniform mat4 part_to_site;
uniform vec2 center;
uniform float extent, floor_height, tallest;
in vec3 position;
out float height;
const vec2 SLANT = vec2(0.35, 0.45) / 0.95;
void main() {
    vec3 at = (part_to_site * vec4(position, 1.0)).xyz;
    height = max(at.z - floor_height, 0.0);
    vec2 falls = at.xy - SLANT * 0.45 * height - center;
    gl_Position = vec4(falls / extent, clamp(height / tallest, 0.0, 1.0) * 2.0 - 1.0, 1.0);
}
"""

SHADOW_FRAGMENT = """#version 330
in float height;
out float lowest;
void main() { lowest = height; }
"""
