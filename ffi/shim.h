/* C interface over Embree 3.13 or 4.x: static triangle scenes, single-ray queries.
 *
 * Nothing of Embree shows here: sizeof(RTCRayHit) differs between its versions, so Rust
 * reads this header only. Functions return 0 for success unless stated otherwise; on
 * failure the message is in the caller's lo_error. */
#ifndef LO_SHIM_H
#define LO_SHIM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A device and the one scene in it. Immutable, hence shareable, once committed. */
typedef struct lo_accel lo_accel;

/* The parameters are in units of |dir|: hits with t_near <= t <= t_far count,
 * one at t = 0 too: a ray must start clear of its own surface. */
typedef struct lo_ray {
  float org[3];
  float dir[3];
  float t_near;
  float t_far;
} lo_ray;

typedef struct lo_hit {
  float t;
  float u, v;      /* barycentric: p = (1-u-v) p0 + u p1 + v p2 */
  uint32_t geom;   /* the id given to lo_accel_add_triangles */
  uint32_t prim;   /* the triangle's index in it */
} lo_hit;

typedef struct lo_error {
  int32_t code;    /* an RTCError */
  char message[244];
} lo_error;

/* Embree's coordinates are limited to this magnitude; it silently drops triangles beyond. */
static const float LO_MAX_COORDINATE = 1.844e18f;

/* The device configuration in use, e.g. "threads=1,...,isa=avx2". */
const char *lo_default_config(void);
/* The instruction set pinned in it: the best of avx2 and sse4.2 that this CPU has. */
const char *lo_isa(void);
/* Version of the Embree library at run time, as 10000 major + 100 minor + patch. */
uint32_t lo_version(const lo_accel *accel);

/* NULL on failure. `config` is Embree's rtcNewDevice string. */
lo_accel *lo_accel_new(const char *config, lo_error *error);
void lo_accel_free(lo_accel *accel);

/* Copies a mesh into buffers that Embree owns and pads. Every index must be below
 * n_vertices, and n_triangles > 0: neither is checked here. */
int lo_accel_add_triangles(lo_accel *accel, uint32_t geom, const float *positions,
                           size_t n_vertices, const uint32_t *indices, size_t n_triangles,
                           lo_error *error);
int lo_accel_commit(lo_accel *accel, lo_error *error);

/* Closest hit: true, and *hit filled in, when there is one. Rays with a coordinate that is
 * not finite, or beyond LO_MAX_COORDINATE, hit nothing; a negative t_near counts as 0. */
bool lo_accel_intersect1(const lo_accel *accel, const lo_ray *ray, lo_hit *hit);
/* Any hit, under the same rules. */
bool lo_accel_occluded1(const lo_accel *accel, const lo_ray *ray);

/* A query as it was made: for the closest hit, or for any. */
typedef struct lo_query {
  lo_ray ray;
  bool any_hit;
} lo_query;

/* Makes queries again, one after another, and returns how many of them hit: what Embree alone takes for
 * them, with nothing done about a hit and the denormals set once. */
size_t lo_accel_replay(const lo_accel *accel, const lo_query *queries, size_t n);

#endif
