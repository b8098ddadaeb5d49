#include "render/gl/program.h"

/* Position: grid integers minus the anchor as integers, the sign by comparison so that all 32 bits
 * count, and only then floats. Depth: logarithmic in w, which is exact for a splat that faces the
 * eye (render/camera.h). When blending, a splat is drawn nearer by the slab, so that the depth test
 * lets pass what is averaged. */
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
    "uniform float slab;\n"
    "flat out vec4 tint;\n" /* colour, width in pixels */
    "flat out float depth;\n"
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
    "        if (found >= 0x80000000u) return -uintBitsToFloat(found);\n"
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
    "    depth = (log2(max(w, 1e-30)) - range.x) * range.y;\n"
    "#ifdef BLEND\n"
    "    float drawn = depth < 0.0 ? depth : max(depth - slab, 0.0);\n"
    "#else\n"
    "    float drawn = depth;\n"
    "#endif\n"
    "    gl_Position = vec4(eye.xy * inverse_tan, (2.0 * drawn - 1.0) * w, w);\n"
    "#ifdef SMALLEST\n"
    "    float size = splat.y;\n"
    "#else\n"
    "    float size = clamp(splat.x * cell_at(position) / max(w, 1e-30), splat.y, splat.z);\n"
    "    gl_PointSize = size;\n"
    "#endif\n"
    "    tint = vec4(colour.rgb, size);\n"
    "#ifdef CLIP\n" /* beyond the far plane there is nothing */
    "    if (any(lessThan(position, clip_low)) || any(greaterThan(position, clip_high)))\n"
    "        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);\n"
    "#endif\n"
    "}\n";

/* Sections 1 and 2 of rgl.h. */
const char RGL_POINTS_FRAGMENT[] =
    "#ifdef GL_ARB_conservative_depth\n"
    "#extension GL_ARB_conservative_depth : enable\n"
    "#endif\n"
    "flat in vec4 tint;\n"
    "flat in float depth;\n"
    "#ifdef BLEND\n"
    "uniform sampler2D nearest;\n"
    "uniform float slab;\n"
    "layout(location = 0) out vec4 sum;\n"
    "layout(location = 1) out float depth_sum;\n"
    "#else\n"
    "out vec4 result;\n"
    "#endif\n"
    "#ifdef PARABOLOID\n"
    "uniform vec2 bend;\n" /* 1 / (2 focal_px), 1 / span */
    "#ifdef GL_ARB_conservative_depth\n"
    "layout(depth_greater) out float gl_FragDepth;\n"
    "#endif\n"
    "#endif\n"
    "float r2()\n"
    "{\n"
    "    vec2 p = 2.0 * gl_PointCoord - 1.0;\n"
    "    return tint.a < SQUARE_PX ? 0.0 : dot(p, p);\n"
    "}\n"
    "void main()\n"
    "{\n"
    "#ifdef ROUND\n"
    "    if (r2() > 1.0) discard;\n"
    "#endif\n"
    "#ifdef PARABOLOID\n"
    "    float deeper = log2(1.0 + r2() * tint.a * bend.x) * bend.y;\n"
    "    gl_FragDepth = min(gl_FragCoord.z + deeper, 0.99999994);\n"
    "#endif\n"
    "#ifdef BLEND\n"
    "    float front = texelFetch(nearest, ivec2(gl_FragCoord.xy), 0).r;\n"
    "    float behind = clamp((depth - front) / slab, -1.0, 1.0);\n"
    "    float weight = max(1.0, floor(8.5 - 8.0 * r2()));\n"
    "    sum = weight * vec4(floor(255.0 * tint.rgb + 0.5), 1.0);\n"
    "    depth_sum = weight * floor(255.0 * behind + 0.5);\n"
    "#else\n"
    "    result = vec4(tint.rgb, 1.0);\n"
    "#endif\n"
    "}\n";

/* A picture as it is, whose first row is the highest. */
const char RGL_PRESENT_FRAGMENT[] =
    "uniform sampler2D picture;\n"
    "uniform int height;\n"
    "out vec4 result;\n"
    "void main()\n"
    "{\n"
    "    ivec2 p = ivec2(gl_FragCoord.xy);\n"
    "    result = vec4(texelFetch(picture, ivec2(p.x, height - 1 - p.y), 0).rgb, 1.0);\n"
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
