#include "shim.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

struct lo_accel {
  RTCScene scene; /* first: the only member that queries read */
  RTCDevice device;
  lo_error error; /* first error since the device was made; see on_error */
};

/* threads=1: Embree builds in the calling thread alone, so the tree, and with it every tie
 * between coincident triangles, does not depend on how many threads the program has.
 * ignore_config_files: ~/.embree3 must not change a result. */
#define LO_CONFIG "threads=1,set_affinity=0,ignore_config_files=1"

#if defined(__x86_64__)
/* AVX-512 is left out on purpose: the same tree and the same arithmetic on more machines. */
static bool has_avx2(void) {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
         __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
}

const char *lo_isa(void) { return has_avx2() ? "avx2" : "sse4.2"; }
const char *lo_default_config(void) {
  return has_avx2() ? LO_CONFIG ",isa=avx2" : LO_CONFIG ",isa=sse4.2";
}
#else
const char *lo_isa(void) { return "default"; }
const char *lo_default_config(void) { return LO_CONFIG; }
#endif

static const char *error_name(enum RTCError code) {
  switch (code) {
  case RTC_ERROR_NONE: return "no error";
  case RTC_ERROR_INVALID_ARGUMENT: return "invalid argument";
  case RTC_ERROR_INVALID_OPERATION: return "invalid operation";
  case RTC_ERROR_OUT_OF_MEMORY: return "out of memory";
  case RTC_ERROR_UNSUPPORTED_CPU: return "unsupported CPU";
  case RTC_ERROR_CANCELLED: return "cancelled";
  default: return "unknown error";
  }
}

static void set_error(lo_error *error, enum RTCError code, const char *text) {
  error->code = (int32_t)code;
  strncpy(error->message, text && *text ? text : error_name(code), sizeof error->message - 1);
  error->message[sizeof error->message - 1] = '\0';
}

/* Only Embree's callback gets its wording, so keep it until the next poll. */
static void on_error(void *user, enum RTCError code, const char *text) {
  lo_accel *accel = user;
  if (accel->error.code == RTC_ERROR_NONE)
    set_error(&accel->error, code, text);
}

/* Moves a pending device error, if any, to *error; 0 when there is none. */
static int poll_error(lo_accel *accel, lo_error *error) {
  enum RTCError code = rtcGetDeviceError(accel->device);
  if (code == RTC_ERROR_NONE && accel->error.code == RTC_ERROR_NONE)
    return 0;
  if (accel->error.code == RTC_ERROR_NONE)
    set_error(&accel->error, code, NULL);
  *error = accel->error;
  accel->error.code = RTC_ERROR_NONE;
  return 1;
}

lo_accel *lo_accel_new(const char *config, lo_error *error) {
  lo_accel *accel = calloc(1, sizeof *accel);
  if (!accel) {
    set_error(error, RTC_ERROR_OUT_OF_MEMORY, NULL);
    return NULL;
  }
  accel->device = rtcNewDevice(config);
  if (!accel->device) {
    set_error(error, rtcGetDeviceError(NULL), NULL);
    free(accel);
    return NULL;
  }
  rtcSetDeviceErrorFunction(accel->device, on_error, accel);
  accel->scene = rtcNewScene(accel->device);
  if (accel->scene) {
    rtcSetSceneFlags(accel->scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(accel->scene, RTC_BUILD_QUALITY_HIGH);
  }
  if (poll_error(accel, error)) {
    lo_accel_free(accel);
    return NULL;
  }
  return accel;
}

void lo_accel_free(lo_accel *accel) {
  if (!accel)
    return;
  if (accel->scene)
    rtcReleaseScene(accel->scene);
  rtcReleaseDevice(accel->device);
  free(accel);
}

int lo_accel_add_triangles(lo_accel *accel, uint32_t geom, const float *positions,
                           size_t n_vertices, const uint32_t *indices, size_t n_triangles,
                           lo_error *error) {
  const size_t vertex = 3 * sizeof(float), triangle = 3 * sizeof(uint32_t);
  RTCGeometry geometry = rtcNewGeometry(accel->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  if (geometry) {
    float *xyz = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                         vertex, n_vertices);
    uint32_t *ijk = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            triangle, n_triangles);
    if (xyz && ijk) {
      memcpy(xyz, positions, vertex * n_vertices);
      memcpy(ijk, indices, triangle * n_triangles);
      rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
      rtcCommitGeometry(geometry);
      rtcAttachGeometryByID(accel->scene, geometry, geom);
    }
    rtcReleaseGeometry(geometry);
  }
  return poll_error(accel, error);
}

int lo_accel_commit(lo_accel *accel, lo_error *error) {
  rtcCommitScene(accel->scene);
  return poll_error(accel, error);
}

uint32_t lo_version(const lo_accel *accel) {
  return (uint32_t)rtcGetDeviceProperty(accel->device, RTC_DEVICE_PROPERTY_VERSION);
}

/* False for NaN too. Embree may read out of bounds, or walk the whole tree, otherwise. */
static inline bool usable(const lo_ray *r) {
  const float m = LO_MAX_COORDINATE;
  return (fabsf(r->org[0]) <= m) & (fabsf(r->org[1]) <= m) & (fabsf(r->org[2]) <= m) &
         (fabsf(r->dir[0]) <= m) & (fabsf(r->dir[1]) <= m) & (fabsf(r->dir[2]) <= m) &
         (r->t_near <= r->t_far) & (r->t_far >= 0.0f);
}

static inline struct RTCRay to_embree(const lo_ray *r) {
  struct RTCRay ray;
  ray.org_x = r->org[0], ray.org_y = r->org[1], ray.org_z = r->org[2];
  ray.dir_x = r->dir[0], ray.dir_y = r->dir[1], ray.dir_z = r->dir[2];
  ray.tnear = r->t_near > 0.0f ? r->t_near : 0.0f;
  ray.tfar = r->t_far;
  ray.time = 0.0f;
  ray.mask = ~0u;
  ray.id = 0;
  ray.flags = 0;
  return ray;
}

/* Embree wants denormals flushed (it is otherwise slow, and imprecise in rcp), Rust wants
 * them kept. MXCSR bits 15 and 6: flush-to-zero and denormals-are-zero. */
#if defined(__x86_64__)
static inline unsigned flush_denormals(void) {
  unsigned saved = _mm_getcsr();
  _mm_setcsr(saved | 0x8040u);
  return saved;
}
static inline void restore_denormals(unsigned saved) { _mm_setcsr(saved); }
#else
static inline unsigned flush_denormals(void) { return 0; }
static inline void restore_denormals(unsigned saved) { (void)saved; }
#endif

static inline void intersect(RTCScene scene, struct RTCRayHit *rh) {
#if RTC_VERSION_MAJOR >= 4
  rtcIntersect1(scene, rh, NULL);
#else
  struct RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, rh);
#endif
}

static inline void occluded(RTCScene scene, struct RTCRay *ray) {
#if RTC_VERSION_MAJOR >= 4
  rtcOccluded1(scene, ray, NULL);
#else
  struct RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, ray);
#endif
}

bool lo_accel_intersect1(const lo_accel *accel, const lo_ray *ray, lo_hit *hit) {
  if (!usable(ray))
    return false;
  struct RTCRayHit rh;
  rh.ray = to_embree(ray);
  rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;

  unsigned saved = flush_denormals();
  intersect(accel->scene, &rh);
  restore_denormals(saved);

  if (rh.hit.geomID == RTC_INVALID_GEOMETRY_ID)
    return false;
  hit->t = rh.ray.tfar;
  hit->u = rh.hit.u;
  hit->v = rh.hit.v;
  hit->geom = rh.hit.geomID;
  hit->prim = rh.hit.primID;
  return true;
}

bool lo_accel_occluded1(const lo_accel *accel, const lo_ray *ray) {
  if (!usable(ray))
    return false;
  struct RTCRay r = to_embree(ray);

  unsigned saved = flush_denormals();
  occluded(accel->scene, &r);
  restore_denormals(saved);

  return r.tfar < 0.0f; /* Embree marks a blocked ray with -inf */
}

size_t lo_accel_replay(const lo_accel *accel, const lo_query *queries, size_t n) {
  size_t hits = 0;
  unsigned saved = flush_denormals();
  for (size_t i = 0; i < n; ++i) {
    const lo_query *q = &queries[i];
    if (!usable(&q->ray))
      continue;
    struct RTCRayHit rh;
    rh.ray = to_embree(&q->ray);
    if (q->any_hit) {
      occluded(accel->scene, &rh.ray);
      hits += rh.ray.tfar < 0.0f;
    } else {
      rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      intersect(accel->scene, &rh);
      hits += rh.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
  }
  restore_denormals(saved);
  return hits;
}
