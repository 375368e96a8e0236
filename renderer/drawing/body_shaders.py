"""Shaders of bodies: soft light from above, a lamp, reflections of a studio; in linear light.

Specular light after Walter et al. 2007 (GGX) and Karis 2013 (environment, fitted). Tone mapping after the
Khronos PBR Neutral Tone Mapper, which preserves a paint's colour (without its toe: shades of black cannot
be distinguished on a monitor in a factory hall).
"""

from renderer.drawing.shaders import COLORS, COMMON

# Towards the lamp that casts the shadows; the floor's shadow falls the other way.
KEY = (0.28, 0.36, 0.89)

# FULL: also the lamp's shadow on bodies.
_LIGHT = """
uniform vec3 eye, forward, key;       // eye: of a perspective camera; forward: of an orthographic one
uniform float orthographic, stale, floor_height, per_near_floor;

// The reflected studio: a bright ceiling with a soft box, dim walls, the floor. `up` and `lamp`: the
// reflected way's share upwards and towards the lamp.
vec3 studio(float up, float lamp, float roughness) {
    float soft = 0.10 + 0.75 * roughness;
    float ceiling = smoothstep(-soft, 0.55 + soft, up);
    float box = smoothstep(0.80 - soft * 0.5, 0.97, lamp);
    return mix(vec3(0.24, 0.245, 0.25), vec3(0.72, 0.75, 0.80), ceiling) + box * (1.4 - 1.2 * roughness);
}

vec3 toned(vec3 light) {
    float peak = max(light.r, max(light.g, light.b));
    if (peak < 0.76) return light;
    float pressed = 1.0 - 0.0576 / (peak - 0.52);
    float colored = 1.0 / (0.15 * (peak - pressed) + 1.0);
    return light * (pressed / peak * colored) + pressed * (1.0 - colored);
}

#ifdef FULL
uniform sampler2DShadow lamp;
uniform mat4 site_to_lamp;
uniform float lamp_texel_m;
// Five samples, each a mean of four texels, for a soft edge like that of a large lamp.
float lit(vec3 at, vec3 n) {
    vec3 from = (site_to_lamp * vec4(at + n * 1.5 * lamp_texel_m, 1.0)).xyz * 0.5 + 0.5;
    float step = 1.3 / float(textureSize(lamp, 0).x);
    vec2 one = vec2(step, 0.45 * step), other = vec2(-0.45 * step, step);
    float sum = texture(lamp, from) + texture(lamp, from + vec3(one, 0.0));
    sum += texture(lamp, from - vec3(one, 0.0));
    return (sum + texture(lamp, from + vec3(other, 0.0)) + texture(lamp, from - vec3(other, 0.0))) / 5.0;
}
#else
float lit(vec3 at, vec3 n) { return 1.0; }
#endif

// The colour of a surface. at.w: the share of the sky that it sees; material: roughness, metalness.
vec4 seen_color(vec4 at, vec3 facing, vec4 body_paint, vec2 material) {
    vec3 n = normalize(facing);
    vec3 to_eye = orthographic > 0.5 ? -forward : normalize(eye - at.xyz);
    float straight = dot(n, to_eye);
    // Only faces towards the camera are drawn: a smooth normal must not point away.
    float facing_eye = clamp(straight, 0.02, 1.0);
    float open = at.w, roughness = material.x, metallic = material.y;
    vec3 albedo = body_paint.rgb * (1.0 - metallic);
    vec3 mirrored = mix(vec3(0.04), body_paint.rgb, metallic);

    // Ambient light: the ceiling, the floor's reflection, a little from the camera.
    float up = n.z * 0.5 + 0.5;
    float above = clamp((at.z - floor_height) * per_near_floor, 0.0, 1.0);
    float sky = open * mix(1.0, 0.55 + 0.45 * above, 1.0 - up);
    vec3 around = mix(vec3(0.25, 0.245, 0.24), vec3(0.57, 0.595, 0.63), up) * sky;
    around += 0.20 * facing_eye * open;

    // The lamp: its light, and its gleam around h = key + to_eye, half-way between both and of the squared
    // length hh. Products with h instead of its unit vector save roots.
    float lambert = dot(n, key), key_eye = dot(key, to_eye);
    float lamp_light = max(lambert, 0.0) * lit(at.xyz, n) * mix(0.6, 1.0, open);
    float hh = 2.0 + 2.0 * key_eye, along = max(lambert + straight, 0.0);
    float a = roughness * roughness;
    float spread = along * along * (a * a - 1.0) + hh;
    float gleam = a * a * hh * hh / (spread * spread * max(hh * 0.25, 0.1) * (4.0 * roughness + 2.0));
    // Share of the surroundings that a surface reflects, by roughness and angle.
    vec4 fit = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float aside = (1.0 - facing_eye) * (1.0 - facing_eye);
    float grazing = min(fit.x * fit.x, aside * aside * (1.0 - facing_eye)) * fit.x + fit.y;
    vec3 share = mirrored * (fit.z - 1.04 * grazing) + (fit.w + 1.04 * grazing);
    // The reflected way is 2 n (n to_eye) - to_eye.
    vec3 mirror = studio(2.0 * straight * n.z - to_eye.z, 2.0 * straight * lambert - key_eye, roughness);

    vec3 light = albedo * (around + vec3(0.93, 0.90, 0.86) * lamp_light) * 1.08;
    light += mirror * share * sky + mirrored * min(gleam * lamp_light, 6.0);
    // The rim is a little darker, so that a body is visible in front of one with the same colour.
    light *= mix(0.72, 1.0, smoothstep(0.0, 0.32, facing_eye));

    vec3 seen = to_srgb(toned(light));
    float grey = dot(seen, vec3(0.2126, 0.7152, 0.0722));
    seen = mix(seen, mix(vec3(mix(0.60, grey, 0.55)), vec3(0.76, 0.78, 0.81), 0.34), stale);
    return vec4(seen, 1.0) * body_paint.a;
}
"""

# Shared by both programs of bodies: their triangles meet without gaps.
_PLACED = """
invariant gl_Position;
uniform mat4 site_to_clip, part_to_site;
uniform vec4 tint;                    // its share in .a
uniform float opacity;
in vec3 position, normal;
in vec4 paint, surface;
vec4 painted() { return vec4(mix(to_linear(paint.rgb), tint.rgb, tint.a), paint.a * opacity); }
vec2 material_of() { return vec2(clamp(surface.g, 0.15, 1.0), surface.b); }
"""

# Light for each pixel.
BODY_VERTEX = (
    COMMON
    + _PLACED
    + """
out vec4 at;
out vec3 facing;
out vec4 body_paint;
flat out vec2 material;               // the same at a triangle's corners
void main() {
    vec4 place = part_to_site * vec4(position, 1.0);
    at = vec4(place.xyz, surface.r);
    facing = mat3(part_to_site) * normal;
    body_paint = painted();
    material = material_of();
    gl_Position = site_to_clip * place;
}
"""
)

BODY_FRAGMENT = (
    COLORS
    + _LIGHT
    + """
in vec4 at;
in vec3 facing;
in vec4 body_paint;
flat in vec2 material;
out vec4 color;
void main() { color = seen_color(at, facing, body_paint, material); }
"""
)

# Light for each vertex, for triangles on which it differs little from that of each pixel.
LIT_VERTEX = (
    COMMON
    + _LIGHT
    + _PLACED
    + """
centroid out vec4 shade;
void main() {
    vec4 place = part_to_site * vec4(position, 1.0);
    shade = seen_color(vec4(place.xyz, surface.r), mat3(part_to_site) * normal, painted(), material_of());
    gl_Position = site_to_clip * place;
}
"""
)

LIT_FRAGMENT = """#version 330
centroid in vec4 shade;
out vec4 color;
void main() { color = shade; }
"""

EDGE_VERTEX = """#version 330
uniform mat4 site_to_clip, part_to_site;
in vec3 position;
void main() {
    gl_Position = site_to_clip * part_to_site * vec4(position, 1.0);
}
"""

EDGE_FRAGMENT = """#version 330
uniform vec4 tone;
out vec4 color;
void main() { color = vec4(tone.rgb, 1.0) * tone.a; }
"""

# Vertices are already in clip coordinates: lines with a width in pixels, see `renderer.drawing.ribbons`.
RIBBON_VERTEX = """#version 330
in vec4 place, tone;
out vec4 shade;
void main() {
    shade = tone;
    gl_Position = place;
}
"""

RIBBON_FRAGMENT = """#version 330
in vec4 shade;
out vec4 color;
void main() { color = vec4(shade.rgb, 1.0) * shade.a; }
"""

# Depth only, seen from the lamp.
LAMP_VERTEX = """#version 330
uniform mat4 site_to_lamp, part_to_site;
in vec3 position;
void main() { gl_Position = site_to_lamp * part_to_site * vec4(position, 1.0); }
"""

LAMP_FRAGMENT = """#version 330
void main() {}
"""
