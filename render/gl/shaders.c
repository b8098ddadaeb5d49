#include "render/gl/program.h"

/* Position: grid integers minus the anchor as integers, the sign by comparison so that all 32 bits
 * count, and only then floats. Depth: logarithmic in w, which is exact for a splat that faces the
 * eye (render/camera.h). */
const char RGL_POINTS_VERTEX[] =
    "layout(location = 0) in uvec3 position;\n"
    "layout(location = 1) in vec4 colour;\n" /* r, g, b; intensity, which is not drawn */
    "uniform uvec3 anchor;\n"
    "uniform vec3 offset;\n"
    "uniform mat3 rotation;\n"
    "uniform vec2 inverse_tan;\n"
    "uniform vec2 range;\n" /* log2 of near, 1 / log2(far / near) */
    "uniform vec3 splat;\n" /* pixels at a distance of one step (of a cell of one step), least and
                               largest on screen */
    "flat out vec3 tint;\n"
    "#ifdef OCTANTS\n"
    "uniform usampler2D octants;\n"
    "uniform int grid_bits;\n"
    /* Walks down from the root to the finest node drawn around a place: its cell there, steps. */
    "float cell_at(uvec3 place)\n"
    "{\n"
    "    uint node = 0u;\n"
    "    for (int bit = grid_bits - 1; bit >= 0; bit--) {\n"
    "        uvec3 side = place >> uint(bit) & 1u;\n"
    "        uint entry = 8u * node + (side.x | side.y << 1 | side.z << 2);\n"
    "        uint found = texelFetch(octants, ivec2(entry & 1023u, entry >> 10), 0).r;\n"
    "        if (found >= 0x80000000u) return exp2(float(found & 63u));\n"
    "        node = found;\n"
    "    }\n"
    "    return 1.0;\n"
    "}\n"
    "#else\n"
    "float cell_at(uvec3 place) { return 1.0; }\n"
    "#endif\n"
    "#ifdef CLIP\n"
    "uniform uvec3 clip_low, clip_high;\n"
    "#endif\n"
    "void main()\n"
    "{\n"
    "    bvec3 ahead = greaterThanEqual(position, anchor);\n"
    "    vec3 away = vec3(ahead.x ? position.x - anchor.x : anchor.x - position.x,\n"
    "                     ahead.y ? position.y - anchor.y : anchor.y - position.y,\n"
    "                     ahead.z ? position.z - anchor.z : anchor.z - position.z);\n"
    "    vec3 eye = rotation * (mix(-away, away, ahead) + offset);\n"
    "    float w = -eye.z;\n"
    "    float depth = (log2(max(w, 1e-30)) - range.x) * range.y;\n"
    "    gl_Position = vec4(eye.xy * inverse_tan, (2.0 * depth - 1.0) * w, w);\n"
    "    gl_PointSize = clamp(splat.x * cell_at(position) / max(w, 1e-30), splat.y, splat.z);\n"
    "    tint = colour.rgb;\n"
    "#ifdef CLIP\n" /* beyond the far plane there is nothing */
    "    if (any(lessThan(position, clip_low)) || any(greaterThan(position, clip_high)))\n"
    "        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);\n"
    "#endif\n"
    "}\n";

const char RGL_POINTS_FRAGMENT[] = "flat in vec3 tint;\n"
                                   "out vec4 result;\n"
                                   "void main()\n"
                                   "{\n"
                                   "#ifdef ROUND\n"
                                   "    vec2 p = 2.0 * gl_PointCoord - 1.0;\n"
                                   "    if (dot(p, p) > 1.0) discard;\n"
                                   "#endif\n"
                                   "    result = vec4(tint, 1.0);\n"
                                   "}\n";

/* One triangle that covers the screen, made of nothing. */
const char RGL_SCREEN_VERTEX[] = "void main()\n"
                                 "{\n"
                                 "    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, "
                                 "gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);\n"
                                 "}\n";

/* Eye-dome lighting (Boucheny 2009): a pixel is darkened by how much nearer its neighbours are, in
 * log2 of the distance, so that the same shape looks the same at every range. Opposite neighbours
 * are taken together, which cancels the slope of a surface seen at a grazing angle: ground that
 * runs to the horizon stays bright, edges and creases do not. */
const char RGL_SHADE_FRAGMENT[] =
    "uniform sampler2D colours;\n"
    "uniform sampler2D depths;\n"
    "uniform vec2 range;\n" /* log2 of near, log2(far / near) */
    "uniform vec2 edl;\n"   /* strength, radius in pixels */
    "uniform vec3 top, bottom;\n"
    "uniform float height;\n"
    "out vec4 result;\n"
    "float depth_at(ivec2 p)\n"
    "{\n"
    "    return texelFetch(depths, clamp(p, ivec2(0), textureSize(depths, 0) - 1), 0).r;\n"
    "}\n"
    "float nearer(float here, ivec2 p, ivec2 step)\n"
    "{\n"
    "    float a = depth_at(p + step), b = depth_at(p - step);\n"
    /* The sky is no neighbour: an edge against it would say nothing about shape. */
    "    float da = a < 1.0 ? (here - a) * range.y : 0.0, db = b < 1.0 ? (here - b) * range.y : "
    "0.0;\n"
    "    float bend = max(da + db, 0.0), slope = max(da, 0.0) + max(db, 0.0);\n"
    "    float sum = mix(bend, slope, 0.25);\n"
    "    return sum / (1.0 + 60.0 * sum);\n" /* an edge is an edge, however far behind it the next
                                                surface stands */
    "}\n"
    "void main()\n"
    "{\n"
    "    ivec2 p = ivec2(gl_FragCoord.xy);\n"
    "    float here = depth_at(p);\n"
    "    if (here >= 1.0) {\n"
    "        result = vec4(mix(bottom, top, gl_FragCoord.y / height), 1.0);\n"
    "        return;\n"
    "    }\n"
    "    vec3 colour = texelFetch(colours, p, 0).rgb;\n"
    "    if (edl.x > 0.0) {\n"
    "        int r = int(edl.y + 0.5), q = int(0.7071 * edl.y + 0.5);\n"
    "        float sum = nearer(here, p, ivec2(r, 0)) + nearer(here, p, ivec2(0, r)) +\n"
    "                    nearer(here, p, ivec2(q, q)) + nearer(here, p, ivec2(q, -q));\n"
    "        colour *= exp(-edl.x * sum);\n"
    "    }\n"
    "    result = vec4(colour, 1.0);\n"
    "}\n";

const char RGL_TEXT_VERTEX[] =
    "layout(location = 0) in vec4 corner;\n" /* x, y in pixels from the top left; u, v in texels */
    "layout(location = 1) in vec4 colour;\n"
    "uniform vec2 screen;\n"
    "out vec2 texel;\n"
    "out vec4 tint;\n"
    "void main()\n"
    "{\n"
    "    gl_Position = vec4(corner.x / screen.x * 2.0 - 1.0, 1.0 - corner.y / screen.y * 2.0, 0.0, "
    "1.0);\n"
    "    texel = corner.zw;\n"
    "    tint = colour;\n"
    "}\n";

/* Texels left of the atlas stand for a plain panel. */
const char RGL_TEXT_FRAGMENT[] =
    "uniform sampler2D atlas;\n"
    "in vec2 texel;\n"
    "in vec4 tint;\n"
    "out vec4 result;\n"
    "void main()\n"
    "{\n"
    "    float cover = texel.x < 0.0 ? 1.0 : texelFetch(atlas, ivec2(texel), 0).r;\n"
    "    result = vec4(tint.rgb, tint.a * cover);\n"
    "}\n";
