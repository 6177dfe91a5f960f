// A volume from tracked frames: grid, splat of every pixel, mean, bridging of holes.
#include "sweep/frames.h"
#include "base/parallel.h"

#include <string.h>

typedef struct work {
  const sonde_sequence *sequence;
  sonde_reconstruct_options options;
  sonde_volume *volume;
  sonde_affine voxel_from_world;
  float *sum, *weight; // [voxels]
  uint8_t *bridged;    // [voxels] values of the holes
  int reach[13];       // longest step count along each direction
  uint64_t *filled;    // [layers]
} work;

// Half of the 26 neighbours; the other half are their opposites.
static const int DIRECTIONS[13][3] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0},
                                      {1, 0, 1},  {1, 0, -1}, {0, 1, 1}, {0, 1, -1}, {1, 1, 1},
                                      {1, 1, -1}, {1, -1, 1}, {-1, 1, 1}};

sonde_reconstruct_options sonde_reconstruct_options_default(void) {
  return (sonde_reconstruct_options){
      .spacing_m = 0.5e-3, .hole_fill_m = 3e-3, .most_voxels = (uint64_t)1 << 28};
}

static sonde_status make_grid(work *w, sonde_reconstruct_report *report, sonde_error *error) {
  const sonde_sequence *s = w->sequence;
  double low[3], high[3], room = 1, space = 1, step = w->options.spacing_m;
  // The box holds the corners of all used frames.
  for (int k = 0; k < 3; ++k) low[k] = (double)INFINITY, high[k] = -(double)INFINITY;
  for (uint32_t i = 0; i < s->count; ++i) {
    if (!s->frames[i].used) continue;
    ++report->frames;
    for (int corner = 0; corner < 4; ++corner) {
      double u = s->clip[0] + (corner & 1 ? s->clip[2] - 1 : 0);
      double v = s->clip[1] + (corner & 2 ? s->clip[3] - 1 : 0);
      sonde_vec3 p = affine_apply(&s->frames[i].world_from_pixel, vec3(u, v, 0));
      const double xyz[3] = {p.x, p.y, p.z};
      for (int k = 0; k < 3; ++k) {
        if (xyz[k] < low[k]) low[k] = xyz[k];
        if (xyz[k] > high[k]) high[k] = xyz[k];
      }
    }
  }
  if (!report->frames || !s->width || !s->height)
    return sonde_fail(error, SONDE_MISMATCH,
                      "no frame with pixels and a pose, nothing to reconstruct from");
  uint32_t size[3];
  for (int k = 0; k < 3; ++k) {
    double length = high[k] - low[k], voxels = floor(length / step + 1e-9) + 2;
    if (!(voxels <= SONDE_SIDE_MAX))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "a grid of %.3g mm has %.6g voxels along %c, where the frames reach %.4g "
                        "mm; expected at most %d voxels along an axis: try a spacing of %.2g mm or "
                        "fewer frames",
                        step * 1e3, voxels, "xyz"[k], length * 1e3, SONDE_SIDE_MAX,
                        1.1e3 * length / SONDE_SIDE_MAX);
    size[k] = (uint32_t)voxels;
    room *= voxels, space *= length + step;
  }
  if (room > (double)w->options.most_voxels)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a grid of %.3g mm has %.3g voxels and needs %.3g GB, expected at most %.3g "
                      "voxels: try a spacing of %.2g mm or fewer frames",
                      step * 1e3, room, room * 10e-9, (double)w->options.most_voxels,
                      1.1e3 * cbrt(space / (double)w->options.most_voxels));
  sonde_status status = sonde_volume_create(size, w->volume, error);
  if (status) return status;
  w->volume->world_from_voxel = affine_scale(affine_identity(), step);
  for (int k = 0; k < 3; ++k) w->volume->world_from_voxel.m[k][3] = low[k];
  report->voxels = (uint64_t)size[0] * size[1] * size[2];
  return SONDE_OK;
}

static void splat_frame(work *w, uint32_t frame) {
  const sonde_sequence *s = w->sequence;
  sonde_affine map = affine_mul(&w->voxel_from_world, &s->frames[frame].world_from_pixel);
  sonde_vec3 du = affine_column(&map, 0);
  const uint32_t *size = w->volume->size;
  bool linear = w->options.method == SONDE_RECONSTRUCT_LINEAR;
  for (uint32_t v = s->clip[1]; v < s->clip[1] + s->clip[3]; ++v) {
    const uint8_t *row = s->pixels + ((size_t)frame * s->height + v) * s->width;
    sonde_vec3 start = affine_apply(&map, vec3(0, v, 0));
    for (uint32_t u = s->clip[0]; u < s->clip[0] + s->clip[2]; ++u) {
      sonde_vec3 p = v_madd(start, u, du);
      if (linear) {
        const double xyz[3] = {p.x, p.y, p.z};
        size_t index[3];
        float t[3];
        for (int k = 0; k < 3; ++k) {
          double x = clamp(xyz[k], 0, size[k] - 1.0);
          index[k] = (size_t)x < size[k] - 2 ? (size_t)x : size[k] - 2;
          t[k] = (float)(x - (double)index[k]);
        }
        size_t base = (index[2] * size[1] + index[1]) * size[0] + index[0];
        for (int corner = 0; corner < 8; ++corner) {
          float share = (corner & 1 ? t[0] : 1 - t[0]) * (corner & 2 ? t[1] : 1 - t[1]) *
                        (corner & 4 ? t[2] : 1 - t[2]);
          size_t i = base + (corner & 1 ? 1 : 0) + (corner & 2 ? size[0] : 0) +
                     (corner & 4 ? (size_t)size[0] * size[1] : 0);
          w->sum[i] += share * row[u];
          w->weight[i] += share;
        }
      } else {
        size_t i = (size_t)clamp(p.x + 0.5, 0, size[0] - 1.0);
        size_t j = (size_t)clamp(p.y + 0.5, 0, size[1] - 1.0);
        size_t k = (size_t)clamp(p.z + 0.5, 0, size[2] - 1.0), at = (k * size[1] + j) * size[0] + i;
        w->sum[at] += row[u];
        w->weight[at] += 1;
      }
    }
  }
}

// Steps to the first touched voxel from (at) along sign * direction; 0 when none within reach.
static int look(const work *w, const int at[3], const int direction[3], int sign, int reach,
                size_t *found) {
  const uint32_t *size = w->volume->size;
  for (int step = 1; step <= reach; ++step) {
    size_t index[3];
    for (int k = 0; k < 3; ++k) {
      int x = at[k] + sign * step * direction[k];
      if (x < 0 || x >= (int)size[k]) return 0;
      index[k] = (size_t)x;
    }
    *found = (index[2] * size[1] + index[1]) * size[0] + index[0];
    if (w->weight[*found] > 0) return step;
  }
  return 0;
}

static sonde_status bridge_slab(void *user, uint32_t worker, uint32_t k, const atomic_bool *stop,
                                sonde_error *error) {
  work *w = user;
  (void)worker, (void)stop, (void)error;
  const uint32_t *size = w->volume->size;
  for (uint32_t j = 0; j < size[1]; ++j)
    for (uint32_t i = 0; i < size[0]; ++i) {
      size_t index = ((size_t)k * size[1] + j) * size[0] + i;
      if (w->weight[index] > 0) continue;
      const int at[3] = {(int)i, (int)j, (int)k};
      // The grey lies on the shortest line that ends in touched voxels on both sides, weighted by
      // distance; lines of one length share.
      double shortest = (double)INFINITY, sum = 0;
      int lines = 0;
      for (int d = 0; d < 13; ++d) {
        size_t a, b;
        const int *direction = DIRECTIONS[d];
        int ahead = look(w, at, direction, 1, w->reach[d] - 1, &a);
        int behind = ahead ? look(w, at, direction, -1, w->reach[d] - ahead, &b) : 0;
        if (!behind) continue;
        double step = sqrt(abs(direction[0]) + abs(direction[1]) + abs(direction[2]));
        double length = step * (ahead + behind);
        if (length > shortest + 1e-9) continue;
        if (length < shortest - 1e-9) shortest = length, sum = 0, lines = 0;
        sum += (behind * (double)w->volume->voxels[a] + ahead * (double)w->volume->voxels[b]) /
               (ahead + behind);
        ++lines;
      }
      w->bridged[index] = lines ? (uint8_t)(sum / lines + 0.5) : 0;
      w->filled[k] += lines > 0;
    }
  return SONDE_OK;
}

static sonde_status fill_grid(work *w, sonde_reconstruct_report *report,
                              const sonde_progress *progress, sonde_error *error) {
  w->sum = SONDE_NEW(float, report->voxels);
  w->weight = SONDE_NEW(float, report->voxels);
  w->bridged = SONDE_NEW(uint8_t, report->voxels);
  w->filled = SONDE_NEW(uint64_t, w->volume->size[2]);
  if (!w->sum || !w->weight || !w->bridged || !w->filled) return sonde_fail_memory(error);
  bool sound = affine_inverse(&w->volume->world_from_voxel, &w->voxel_from_world);
  SONDE_ASSERT(sound); // a cube of voxels
  (void)sound;
  uint32_t done = 0;
  for (uint32_t i = 0; i < w->sequence->count; ++i) {
    if (!w->sequence->frames[i].used) continue;
    if (!sonde_progress_report(progress, (double)done++ / report->frames, "splat"))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled after %u of %u frames", done,
                        report->frames);
    splat_frame(w, i);
  }
  // A voxel that got less than a thousandth of a pixel counts as empty.
  for (uint64_t i = 0; i < report->voxels; ++i) {
    bool enough = w->weight[i] > 1e-3f;
    w->volume->voxels[i] = enough ? (uint8_t)(w->sum[i] / w->weight[i] + 0.5f) : 0;
    if (!enough) w->weight[i] = 0;
    report->touched += enough;
  }
  if (!(w->options.hole_fill_m > 0)) return SONDE_OK;
  uint32_t layers = w->volume->size[2];
  for (int d = 0; d < 13; ++d) {
    const int *n = DIRECTIONS[d];
    double step = w->options.spacing_m * sqrt(abs(n[0]) + abs(n[1]) + abs(n[2]));
    w->reach[d] = (int)floor(w->options.hole_fill_m / step + 1e-9);
  }
  sonde_status status = sonde_parallel_run(layers, sonde_parallel_workers(0, layers), bridge_slab,
                                           w, progress, "bridge holes", error);
  if (status) return status;
  for (uint64_t i = 0; i < report->voxels; ++i)
    if (w->weight[i] <= 0) w->volume->voxels[i] = w->bridged[i];
  for (uint32_t k = 0; k < layers; ++k) report->bridged += w->filled[k];
  return SONDE_OK;
}

sonde_status sonde_reconstruct(const sonde_sequence *sequence,
                               const sonde_reconstruct_options *options, sonde_volume *volume,
                               sonde_reconstruct_report *out, const sonde_progress *progress,
                               sonde_error *error) {
  SONDE_ASSERT(sequence != NULL && volume != NULL && sequence->frames != NULL);
  *volume = (sonde_volume){0};
  sonde_reconstruct_report report = {0};
  work w = {.sequence = sequence, .volume = volume};
  w.options = options ? *options : sonde_reconstruct_options_default();
  if (!(w.options.spacing_m >= 1e-5 && w.options.spacing_m <= 1) ||
      !(w.options.hole_fill_m >= 0 && w.options.hole_fill_m <= 100 * w.options.spacing_m))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "spacing %g mm, holes up to %g mm: expected a spacing from 0.01 to 1000 and "
                      "holes from 0 to 100 spacings",
                      w.options.spacing_m * 1e3, w.options.hole_fill_m * 1e3);
  sonde_status status = make_grid(&w, &report, error);
  if (!status) status = fill_grid(&w, &report, progress, error);
  sonde_free(w.sum);
  sonde_free(w.weight);
  sonde_free(w.bridged);
  sonde_free(w.filled);
  if (status) sonde_volume_clear(volume);
  if (out) *out = report;
  return status;
}
