// Making plain triangles and sound normals of what a file gives.
#include "scene/geometry.h"

uint32_t lx_triangle_count(lx_topology topology, uint32_t index_count)
{
    if (topology == LX_TRIANGLES) return index_count / 3;
    return index_count < 3 ? 0 : index_count - 2;
}

// glTF 2.0, section 3.7.2.1: the strip's triangle i is (i, i + 1 + i mod 2, i + 2 - i mod 2), the fan's (i + 1, i + 2,
// 0).
void lx_triangulate(lx_topology topology, const uint32_t *indices, uint32_t index_count, uint32_t *out)
{
    const uint32_t count = lx_triangle_count(topology, index_count);
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t a = 3 * i, b = 3 * i + 1, c = 3 * i + 2;
        if (topology == LX_TRIANGLE_STRIP) {
            a = i;
            b = i + 1 + i % 2;
            c = i + 2 - i % 2;
        } else if (topology == LX_TRIANGLE_FAN) {
            a = i + 1;
            b = i + 2;
            c = 0;
        }
        out[3 * i] = indices[a];
        out[3 * i + 1] = indices[b];
        out[3 * i + 2] = indices[c];
    }
}

typedef struct vec3d {
    double x, y, z;
} vec3d;

static vec3d subtract(lx_vec3 a, lx_vec3 b) { return (vec3d){(double)a.x - b.x, (double)a.y - b.y, (double)a.z - b.z}; }

static vec3d cross(vec3d a, vec3d b)
{
    return (vec3d){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static double dot(vec3d a, vec3d b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Twice the area along the face normal. In double: the squares of micrometres and of thousand kilometres both fit.
static vec3d face_vector(const lx_primitive *p, uint32_t triangle)
{
    const uint32_t *v = &p->indices[3 * (size_t)triangle];
    return cross(subtract(p->positions[v[1]], p->positions[v[0]]), subtract(p->positions[v[2]], p->positions[v[0]]));
}

static lx_vec3 unit(vec3d v)
{
    const double length = sqrt(dot(v, v));
    if (!(length > 0)) return (lx_vec3){0, 0, 1}; // only triangles without area at this vertex: never lit, never seen
    return (lx_vec3){(float)(v.x / length), (float)(v.y / length), (float)(v.z / length)};
}

uint32_t lx_repair_normals(lx_primitive *p)
{
    uint32_t missing = 0;
    for (uint32_t i = 0; i < p->vertex_count; ++i) {
        p->normals[i] = lx_normalize_or(p->normals[i], (lx_vec3){0, 0, 0});
        missing += lx_max_abs(p->normals[i]) == 0;
    }
    if (missing == 0) return 0;
    vec3d *sums = lx_calloc_array(p->vertex_count, sizeof *sums);
    for (uint32_t t = 0; sums && t < p->triangle_count; ++t) {
        const vec3d face = face_vector(p, t);
        for (int corner = 0; corner < 3; ++corner) {
            vec3d *sum = &sums[p->indices[3 * (size_t)t + corner]];
            *sum = (vec3d){sum->x + face.x, sum->y + face.y, sum->z + face.z};
        }
    }
    for (uint32_t i = 0; i < p->vertex_count; ++i)
        if (lx_max_abs(p->normals[i]) == 0) p->normals[i] = unit(sums ? sums[i] : (vec3d){0, 0, 0});
    lx_free(sums);
    return missing;
}

uint32_t lx_count_degenerate_triangles(const lx_primitive *p)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < p->triangle_count; ++t) {
        const uint32_t *v = &p->indices[3 * (size_t)t];
        const vec3d face = face_vector(p, t);
        const vec3d ab = subtract(p->positions[v[1]], p->positions[v[0]]),
                    ac = subtract(p->positions[v[2]], p->positions[v[0]]);
        // Sine of the angle at the first corner below 1e-9: far below what float positions resolve.
        count += dot(face, face) <= 1e-18 * dot(ab, ab) * dot(ac, ac);
    }
    return count;
}

void lx_primitive_release(lx_primitive *p)
{
    lx_free(p->positions);
    lx_free(p->normals);
    for (int set = 0; set < lx_texcoord_sets; ++set) lx_free(p->texcoords[set]);
    lx_free(p->colors);
    lx_free(p->indices);
    *p = (lx_primitive){0};
}
