#include "render/gl/program.h"

/* One triangle that covers the screen, made of nothing, where the farthest depth is. */
const char RGL_SCREEN_VERTEX[] = "void main()\n"
                                 "{\n"
                                 "    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, "
                                 "gl_VertexID == 2 ? 3.0 : -1.0, 1.0, 1.0);\n"
                                 "}\n";

/* Section 2 of rgl.h: from sums to colours and depths. */
const char RGL_RESOLVE_FRAGMENT[] =
    "uniform sampler2D colours, depths, nearest;\n"
    "uniform float slab;\n"
    "layout(location = 0) out vec4 colour;\n"
    "layout(location = 1) out float depth;\n"
    "void main()\n"
    "{\n"
    "    ivec2 p = ivec2(gl_FragCoord.xy);\n"
    "    vec4 sum = texelFetch(colours, p, 0);\n"
    "    float front = texelFetch(nearest, p, 0).r, behind = texelFetch(depths, p, 0).r;\n"
    "    bool any = sum.a > 0.0;\n"
    "    colour = vec4(any ? floor(sum.rgb / sum.a + 0.5) / 255.0 : vec3(0.0), 1.0);\n"
    "    depth = any ? front + slab * behind / (255.0 * sum.a) : 1.0;\n"
    "}\n";

/* Section 3 of rgl.h. */
const char RGL_FILL_FRAGMENT[] =
    "uniform sampler2D colours, depths;\n"
    "uniform int radius;\n"
    "uniform vec2 tolerance;\n" /* depths: how far behind a hole is, how far apart what fills it */
    "layout(location = 0) out vec4 colour;\n"
    "layout(location = 1) out float depth;\n"
    "bool is_neighbour(ivec2 p, ivec2 o, ivec2 size)\n"
    "{\n"
    "    int rr = o.x * o.x + o.y * o.y;\n"
    "    ivec2 q = p + o;\n"
    "    return rr > 0 && rr <= radius * (radius + 1) && all(greaterThanEqual(q, ivec2(0))) &&\n"
    "           all(lessThan(q, size));\n"
    "}\n"
    "int sector(ivec2 o)\n"
    "{\n"
    "    if (o.x > 0 && o.y >= 0) return o.y < o.x ? 1 : 2;\n"
    "    if (o.x <= 0 && o.y > 0) return -o.x < o.y ? 4 : 8;\n"
    "    if (o.x < 0 && o.y <= 0) return -o.y < -o.x ? 16 : 32;\n"
    "    return o.x < -o.y ? 64 : 128;\n"
    "}\n"
    "void main()\n"
    "{\n"
    "    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(depths, 0);\n"
    "    colour = vec4(texelFetch(colours, p, 0).rgb, 1.0);\n"
    "    depth = texelFetch(depths, p, 0).r;\n"
    "    float front = depth - tolerance.x, nearest = 1.0;\n"
    "    for (int j = -radius; j <= radius; j++)\n"
    "        for (int i = -radius; i <= radius; i++)\n"
    "            if (is_neighbour(p, ivec2(i, j), size))\n"
    "                nearest = min(nearest, texelFetch(depths, p + ivec2(i, j), 0).r);\n"
    "    if (nearest > front) return;\n"
    "    float limit = min(front, nearest + tolerance.y);\n"
    "    int found = 0;\n"
    "    vec4 sum = vec4(0.0);\n"
    "    float weights = 0.0;\n"
    "    for (int j = -radius; j <= radius; j++)\n"
    "        for (int i = -radius; i <= radius; i++) {\n"
    "            ivec2 o = ivec2(i, j);\n"
    "            if (!is_neighbour(p, o, size)) continue;\n"
    "            float d = texelFetch(depths, p + o, 0).r;\n"
    "            if (d > limit) continue;\n"
    "            float weight = 1.0 / float(i * i + j * j);\n"
    "            found |= sector(o);\n"
    "            sum += weight * vec4(texelFetch(colours, p + o, 0).rgb, d);\n"
    "            weights += weight;\n"
    "        }\n"
    "    int turned = found >> 1 | (found & 1) << 7;\n"
    "    if ((found | turned) != 255) return;\n"
    "    colour.rgb = sum.rgb / weights;\n"
    "    depth = sum.a / weights;\n"
    "}\n";

/* Section 5 of rgl.h, for pictures that need nothing else. */
const char RGL_BACKGROUND_FRAGMENT[] =
    "uniform vec3 top, bottom;\n"
    "uniform float height;\n"
    "out vec4 result;\n"
    "void main() { result = vec4(mix(bottom, top, gl_FragCoord.y / height), 1.0); }\n";

/* Eye-dome lighting (Boucheny 2009): a pixel is darkened by how much nearer its neighbours are, in
 * log2 of the distance, so that the same shape looks the same at every range. Opposite neighbours
 * are taken together, which cancels the slope of a surface seen at a grazing angle: ground that
 * runs to the horizon stays bright, edges and creases do not. */
const char RGL_SHADE_FRAGMENT[] =
    "uniform sampler2D colours;\n"
    "uniform sampler2D depths;\n"
    "uniform float span;\n"
    "uniform vec2 edl;\n" /* strength, radius in pixels */
    "uniform vec3 top, bottom;\n"
    "uniform float height;\n"
    "uniform vec2 texel;\n" /* 1 / size: a lookup that ends at the border by itself costs less */
    "out vec4 result;\n"
    "float depth_at(ivec2 p)\n"
    "{\n"
    "    return texture(depths, (vec2(p) + 0.5) * texel).r;\n"
    "}\n"
    "float nearer(float here, ivec2 p, ivec2 step)\n"
    "{\n"
    "    float a = depth_at(p + step), b = depth_at(p - step);\n"
    /* The sky is no neighbour: an edge against it would say nothing about shape. */
    "    float da = a < 1.0 ? (here - a) * span : 0.0, db = b < 1.0 ? (here - b) * span : "
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
    "    int r = int(edl.y + 0.5), q = int(0.7071 * edl.y + 0.5);\n"
    "    float sum = nearer(here, p, ivec2(r, 0)) + nearer(here, p, ivec2(0, r)) +\n"
    "                nearer(here, p, ivec2(q, q)) + nearer(here, p, ivec2(q, -q));\n"
    "    colour *= exp(-edl.x * sum);\n"
    "    result = vec4(colour, 1.0);\n"
    "}\n";
