// The force with which a footprint drags the skin along itself. Tangential displacements t are
// linear in the depth and do not see the indentations (docs/tissue.md): they cost
// g_t A t^2/2 + K A |grad t|^2/2, the footprint's own are given, and the free ones follow.
#include "fit/shear.h"

#include "base/maths.h"

static const double ACCURACY = 1e-5; // of the residual; the energy errs by its square
enum { MOST_ITERATIONS = 500 };

typedef struct slide {
  const sonde_patch *patch;
  const sonde_surface_law *law;
  const sonde_vec3 *normal;      // [places]
  double *diagonal;              // [places]
  sonde_vec3 *t, *product;       // [places]
  sonde_vec3 *r, *z, *direction; // [places] of the conjugate gradients
} slide;

static sonde_vec3 across(sonde_vec3 n, sonde_vec3 a) { return v_madd(a, -v_dot(n, a), n); }

// y = A x; x is tangential at every place, and so is y.
static void multiply(const slide *s, const sonde_vec3 *x, sonde_vec3 *y) {
  const sonde_patch *p = s->patch;
  double foundation = s->law->tangential_stiffness_n_m3;
  SONDE_ASSERT(foundation >= 0);
  for (uint32_t k = 0; k < p->place_count; ++k) y[k] = v_scale(x[k], foundation * p->area_m2[k]);
  for (uint32_t f = 0; f < p->face_count; ++f) {
    const sonde_patch_face *face = &p->face[f];
    for (int k = 0; k < 3; ++k) {
      uint32_t a = face->place[(k + 1) % 3], b = face->place[(k + 2) % 3];
      double stiffness = s->law->inplane_stiffness_n_m * face->half_cotangent[k];
      sonde_vec3 apart = v_sub(x[b], x[a]);
      y[a] = v_madd(y[a], -stiffness, apart);
      y[b] = v_madd(y[b], stiffness, apart);
    }
  }
  for (uint32_t k = 0; k < p->place_count; ++k) y[k] = across(s->normal[k], y[k]);
}

static void multiply_free(const void *user, const double *x, double *y) {
  multiply(user, (const sonde_vec3 *)x, (sonde_vec3 *)y);
}

static double precondition(const void *user, const double *r, double *z) {
  const slide *s = user;
  double sum = 0;
  for (uint32_t k = 0; k < s->patch->free_count; ++k, r += 3, z += 3) {
    double compliance = s->diagonal[k] > 0 ? 1 / s->diagonal[k] : 0;
    for (int axis = 0; axis < 3; ++axis) z[axis] = r[axis] * compliance;
    sum += r[0] * z[0] + r[1] * z[1] + r[2] * z[2];
  }
  return sum;
}

sonde_status sonde_patch_drag(sonde_patch *patch, const sonde_surface_law *law,
                              const sonde_vec3 *normal, sonde_vec3 site_normal,
                              sonde_error *error) {
  size_t places = patch->place_count;
  slide s = {.patch = patch, .law = law, .normal = normal, .diagonal = SONDE_NEW(double, places)};
  sonde_vec3 **array[] = {&s.t, &s.product, &s.r, &s.z, &s.direction};
  bool ok = s.diagonal != NULL;
  for (size_t k = 0; k < SONDE_COUNT_OF(array); ++k)
    ok = (*array[k] = SONDE_NEW(sonde_vec3, places)) != NULL && ok;
  if (ok) {
    for (uint32_t k = 0; k < places; ++k)
      s.diagonal[k] = law->tangential_stiffness_n_m3 * patch->area_m2[k];
    for (uint32_t f = 0; f < patch->face_count; ++f)
      for (int k = 0; k < 3; ++k) {
        double stiffness = law->inplane_stiffness_n_m * patch->face[f].half_cotangent[k];
        s.diagonal[patch->face[f].place[(k + 1) % 3]] += stiffness;
        s.diagonal[patch->face[f].place[(k + 2) % 3]] += stiffness;
      }
    // The footprint's places move with it, here by a depth of one.
    for (uint32_t k = patch->free_count; k < places; ++k)
      s.t[k] = v_scale(across(normal[k], site_normal), -1);
    // The free places come to rest while the others stay as they are.
    const sonde_operator matrix = {.count = patch->free_count,
                                   .width = 3,
                                   .multiply = multiply_free,
                                   .precondition = precondition,
                                   .user = &s};
    const sonde_pcg_vectors vectors = {&s.r->x, &s.z->x, &s.direction->x, &s.product->x};
    const sonde_pcg_goal goal = {.relative = ACCURACY, .max_iterations = MOST_ITERATIONS};
    (void)sonde_pcg(&matrix, NULL, &s.t->x, &vectors, &goal);
    multiply(&s, s.t, s.product);
    patch->drag_n_m = 0;
    for (uint32_t k = 0; k < places; ++k) patch->drag_n_m += v_dot(s.t[k], s.product[k]);
  }
  for (size_t k = 0; k < SONDE_COUNT_OF(array); ++k) sonde_free(*array[k]);
  sonde_free(s.diagonal);
  return ok ? SONDE_OK : sonde_fail_memory(error);
}
