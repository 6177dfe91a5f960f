// Creating a slicer and rendering with it.
#include "sweep/slice.h"

#include "base/vector.h"
#include "base/parallel.h"

#include <string.h>

sonde_slicer_options sonde_slicer_options_default(void) {
  return (sonde_slicer_options){.gap_m = 10e-3, .reach_m = 1e-3, .left_out = SONDE_WHOLE_FILE};
}

bool sonde_slice_is_left_out(const sonde_sequence *s, const sonde_slicer_options *o,
                             uint32_t frame) {
  if (o->left_out >= s->count || frame == o->left_out) return frame == o->left_out;
  if (!o->left_out_beside) return false;
  uint32_t low = frame < o->left_out ? frame : o->left_out;
  uint32_t high = frame < o->left_out ? o->left_out : frame;
  // The used frames between the two are counted, the second one included.
  uint32_t count = 0;
  for (uint32_t i = low + 1; i <= high; ++i) count += s->frames[i].used;
  return count <= o->left_out_beside;
}

sonde_status sonde_slicer_check(const sonde_sequence *s, const sonde_slicer_options *o,
                                sonde_error *error) {
  if (s->clip[2] < 2 || s->clip[3] < 2)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "frames of %u x %u used pixels, expected at least 2 x 2", s->clip[2],
                      s->clip[3]);
  if (!(o->gap_m > 0) || !(o->reach_m >= 0))
    return sonde_fail(error, SONDE_ARGUMENT, "gap %g m and reach %g m: expected > 0 and >= 0",
                      o->gap_m, o->reach_m);
  return SONDE_OK;
}

// Scratch of the workers; false without memory.
static bool make_scratch(sonde_slicer *slicer, uint32_t count) {
  const size_t padded = count + (size_t)SLICE_STRIPS;
  slicer->every = SONDE_NEW(const slice_plane *, count);
  slicer->forms = SONDE_NEW(double, 3 * (size_t)count);
  slicer->rooms = SONDE_NEW(slice_room, slicer->workers);
  if (!slicer->every || !slicer->forms || !slicer->rooms) return false;
  for (uint32_t i = 0; i < count; ++i) slicer->every[i] = &slicer->planes[i];
  for (slice_room *room = slicer->rooms; room < slicer->rooms + slicer->workers; ++room) {
    room->candidates = SONDE_NEW(slice_candidate, count);
    room->block = SONDE_NEW(const slice_plane *, count);
    room->tile = SONDE_NEW(const slice_plane *, count);
    double *numbers = room->spans.form[0] = SONDE_NEW(double, 5 * (size_t)count);
    // The strips' numbers, one array for each type of them.
    slice_strips *strips = &room->strips;
    double *wide = strips->forms[0][0] = SONDE_NEW(double, (3 * SLICE_FORMS + 2) * padded);
    float *narrow = strips->steps[0][0] = SONDE_NEW(float, 2 * SLICE_FORMS * padded);
    int32_t *offsets = strips->offset[0] = SONDE_NEW(int32_t, 2 * padded);
    if (!room->candidates || !room->block || !room->tile || !numbers || !wide || !narrow ||
        !offsets)
      return false;
    for (uint32_t k = 0; k < 3; ++k) room->spans.form[k] = numbers + k * count;
    room->spans.low = numbers + 3 * (size_t)count;
    room->spans.high = numbers + 4 * (size_t)count;
    for (size_t f = 0; f < SLICE_FORMS; ++f) {
      for (size_t k = 0; k < 3; ++k) strips->forms[f][k] = wide + (3 * f + k) * padded;
      for (size_t k = 0; k < 2; ++k) strips->steps[f][k] = narrow + (2 * f + k) * padded;
    }
    for (size_t k = 0; k < 2; ++k) {
      strips->offset[k] = offsets + k * padded;
      strips->lean[k] = wide + (3 * SLICE_FORMS + k) * padded;
    }
  }
  return true;
}

// Where the strips read the frames: in lines for many pictures, else where they are. None when the
// places do not fit into 32 bits.
static sonde_status lay_out(const sonde_sequence *s, sonde_slicer *slicer, sonde_error *error) {
  const sonde_slicer_options *o = &slicer->options;
  slice_layout *layout = &slicer->layout;
  uint64_t columns = (s->clip[2] + SLICE_LINE_WIDE - 3) / (SLICE_LINE_WIDE - 1);
  uint64_t rows = (s->clip[3] + SLICE_LINE_HIGH - 3) / (SLICE_LINE_HIGH - 1);
  uint64_t frame = columns * rows * SLICE_LINE, all = frame * slicer->count + SLICE_LINE;
  bool lines = !o->once && all < INT32_MAX;
  slicer->has_strips = o->method == SONDE_SLICE_BRACKET && !o->along_sweep &&
                       (lines || (uint64_t)s->width * s->height * s->count < INT32_MAX);
  *layout = (slice_layout){.pixels = s->pixels, .row = (int32_t)s->width};
  if (!slicer->has_strips) return SONDE_OK;
  size_t first = (size_t)s->clip[1] * s->width + s->clip[0];
  for (uint32_t i = 0; i < slicer->count; ++i)
    slicer->planes[i].offset =
        lines ? (int32_t)(i * frame) : (int32_t)(slicer->planes[i].pixels + first - s->pixels);
  if (!lines) return SONDE_OK;
  layout->pixels = layout->lines = SONDE_NEW(uint8_t, all);
  if (!layout->lines) return sonde_fail_memory(error);
  layout->row = SLICE_LINE_WIDE;
  layout->column_line = (int32_t)(rows * SLICE_LINE) - (SLICE_LINE_WIDE - 1);
  layout->row_line = SLICE_LINE - (SLICE_LINE_HIGH - 1) * SLICE_LINE_WIDE;
  // The used part of each frame, line by line down its columns.
  const uint32_t wide = s->clip[2], high = s->clip[3];
  for (const slice_plane *p = slicer->planes; p < slicer->planes + slicer->count; ++p) {
    uint8_t *line = layout->lines + p->offset;
    for (uint32_t u = 0; u < wide - 1; u += SLICE_LINE_WIDE - 1)
      for (uint32_t v = 0; v < high - 1; v += SLICE_LINE_HIGH - 1, line += SLICE_LINE)
        for (uint32_t j = 0; j < SLICE_LINE_HIGH && v + j < high; ++j) {
          const uint8_t *row = p->pixels + first + (size_t)(v + j) * s->width + u;
          if (wide - u >= SLICE_LINE_WIDE) // a size that the compiler knows
            memcpy(line + j * SLICE_LINE_WIDE, row, SLICE_LINE_WIDE);
          else
            memcpy(line + j * SLICE_LINE_WIDE, row, wide - u);
        }
  }
  return SONDE_OK;
}

sonde_status sonde_slicer_create(const sonde_sequence *s, const sonde_slicer_options *options,
                                 sonde_slicer **out, sonde_error *error) {
  return sonde_slicer_create_with(s, options, NULL, out, error);
}

sonde_status sonde_slicer_create_with(const sonde_sequence *s, const sonde_slicer_options *options,
                                      slice_bank *bank, sonde_slicer **out, sonde_error *error) {
  SONDE_ASSERT(s != NULL && out != NULL && s->frames != NULL);
  *out = NULL;
  sonde_slicer_options o = options ? *options : sonde_slicer_options_default();
  sonde_status status = sonde_slicer_check(s, &o, error);
  if (status) return status;
  sonde_slicer *slicer = SONDE_NEW(sonde_slicer, 1);
  if (!slicer) return sonde_fail_memory(error);
  slicer->options = o;
  slicer->width = s->width;
  slicer->kernels = sonde_slice_kernels_find(NULL);
  slicer->workers = sonde_parallel_workers(o.threads, 64);
  for (int k = 0; k < 2; ++k) {
    slicer->low[k] = (float)s->clip[k];
    slicer->high[k] = (float)(s->clip[k] + s->clip[2 + k] - 1);
  }
  slicer->planes = SONDE_NEW(slice_plane, s->count);
  slicer->reached = SONDE_NEW(uint64_t, slicer->workers);
  bool enough = slicer->planes && slicer->reached && make_scratch(slicer, s->count);
  if (!enough) status = sonde_fail_memory(error);
  slicer->bank = bank;
  const bool likened = o.method == SONDE_SLICE_KRIGE || o.deviation;
  slicer->owns_bank = !bank && likened;
  if (!status && slicer->owns_bank) status = sonde_slice_bank_create(s, &slicer->bank, error);
  // Planes of the frames in use, their normals to one side for the whole sweep.
  sonde_vec3 previous = vec3(0, 0, 0);
  for (uint32_t i = 0; i < s->count && !status; ++i) {
    if (!s->frames[i].used || sonde_slice_is_left_out(s, &slicer->options, i)) continue;
    slice_plane *plane = &slicer->planes[slicer->count];
    const sonde_affine *a = &s->frames[i].world_from_pixel;
    sonde_vec3 u = affine_column(a, 0), v = affine_column(a, 1);
    sonde_vec3 n = v_unit(v_cross(u, v), vec3(0, 0, 0));
    if (v_dot(n, previous) < 0) n = v_neg(n);
    sonde_affine world_from_local = affine_columns(u, v, n, affine_column(a, 3));
    if (!affine_inverse(&world_from_local, &plane->local_from_world))
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "frame %u: its columns and rows run the same way, expected a plane", i);
    previous = plane->normal = n;
    plane->world_from_pixel = *a;
    plane->pixel_m[0] = v_norm(u), plane->pixel_m[1] = v_norm(v);
    plane->pixels = s->pixels + (size_t)i * s->width * s->height;
    plane->frame = i;
    plane->pyramid = slicer->bank ? &slicer->bank->pyramids[i] : NULL;
    ++slicer->count;
  }
  if (!status && !slicer->count)
    status = sonde_fail(error, SONDE_MISMATCH, "no frame with a pose is left to slice");
  for (uint32_t i = 0; i + 1 < slicer->count; ++i) {
    slice_plane *p = &slicer->planes[i];
    slice_shift(p, p + 1, p->next_shift);
    slice_shift(p + 1, p, p[1].last_shift);
  }
  if (!status) status = lay_out(s, slicer, error);
  if (!status && likened) status = sonde_slicer_krige(slicer, error);
  if (status) sonde_slicer_destroy(slicer);
  *out = status ? NULL : slicer;
  return status;
}

void sonde_slicer_destroy(sonde_slicer *slicer) {
  if (!slicer) return;
  sonde_free(slicer->planes);
  for (uint32_t k = 0; slicer->rooms && k < slicer->workers; ++k) {
    slice_room *room = &slicer->rooms[k];
    sonde_free(room->candidates);
    sonde_free(room->block);
    sonde_free(room->tile);
    sonde_free(room->spans.form[0]);
    sonde_free(room->strips.forms[0][0]);
    sonde_free(room->strips.steps[0][0]);
    sonde_free(room->strips.offset[0]);
  }
  sonde_free(slicer->rooms);
  sonde_free(slicer->every);
  sonde_free(slicer->forms);
  sonde_free(slicer->layout.lines);
  sonde_free(slicer->reached);
  sonde_free(slicer->joins);
  sonde_free(slicer->far);
  if (slicer->owns_bank) sonde_slice_bank_destroy(slicer->bank);
  sonde_free(slicer);
}

static sonde_status block_row(void *user, uint32_t worker, uint32_t item, const atomic_bool *stop,
                              sonde_error *error) {
  sonde_slicer *slicer = user;
  (void)stop, (void)error;
  for (uint32_t column = 0; column < slicer->image->width; column += SLICE_BLOCK)
    slicer->reached[worker] +=
        slicer->kernels->block(slicer, column, item * SLICE_BLOCK, &slicer->rooms[worker]);
  return SONDE_OK;
}

uint64_t sonde_slicer_render(sonde_slicer *slicer, const sonde_affine *world_from_pixel,
                             sonde_image *image, uint8_t *known) {
  SONDE_ASSERT(slicer != NULL && world_from_pixel != NULL && image != NULL && image->pixels);
  slicer->image = image;
  slicer->known = known;
  memset(slicer->reached, 0, slicer->workers * sizeof *slicer->reached);
  // The forms of every plane are linear in the pixels of this picture.
  for (uint32_t i = 0; i < slicer->count; ++i) {
    slice_plane *plane = &slicer->planes[i];
    sonde_affine local = affine_mul(&plane->local_from_world, world_from_pixel);
    double *forms[3] = {plane->forms.u, plane->forms.v, plane->forms.d};
    for (int k = 0; k < 3; ++k) {
      forms[k][0] = local.m[k][3];
      forms[k][1] = local.m[k][0];
      forms[k][2] = local.m[k][1];
    }
    for (uint32_t k = 0; k < 3; ++k) slicer->forms[k * slicer->count + i] = plane->forms.d[k];
  }
  if (slicer->options.deviation) return sonde_slicer_deviate(slicer, image, known);
  uint32_t rows = (image->height + SLICE_BLOCK - 1) / SLICE_BLOCK;
  uint32_t workers = slicer->workers < rows ? slicer->workers : rows;
  if (workers > 1)
    (void)sonde_parallel_run(rows, workers, block_row, slicer, NULL, "slice", NULL);
  else
    for (uint32_t row = 0; row < rows; ++row) (void)block_row(slicer, 0, row, NULL, NULL);
  uint64_t reached = 0;
  for (uint32_t k = 0; k < slicer->workers; ++k) reached += slicer->reached[k];
  SONDE_ASSERT(reached <= (uint64_t)image->width * image->height);
  return reached;
}

sonde_affine sonde_slice_plane(sonde_pose probe, const sonde_image *image) {
  SONDE_ASSERT(image != NULL && image->width > 0 && image->height > 0);
  double dx = image->width_m / image->width, dz = image->height_m / image->height;
  sonde_vec3 x = q_rotate(probe.rotation, vec3(1, 0, 0));
  sonde_vec3 y = q_rotate(probe.rotation, vec3(0, 1, 0));
  sonde_vec3 z = q_rotate(probe.rotation, vec3(0, 0, 1));
  sonde_vec3 corner =
      v_madd(v_madd(probe.position, 0.5 * (dx - image->width_m), x), image->top_m + 0.5 * dz, z);
  return affine_columns(v_scale(x, dx), v_scale(z, dz), v_neg(y), corner);
}

sonde_status sonde_sequence_set_picture(sonde_sequence *s, uint32_t frame, sonde_pose probe,
                                        const sonde_image *image, sonde_error *error) {
  SONDE_ASSERT(s && frame < s->count && image && image->pixels);
  if (image->width != s->width || image->height != s->height)
    return sonde_fail(error, SONDE_ARGUMENT, "a picture of %u x %u pixels, expected %u x %u",
                      image->width, image->height, s->width, s->height);
  const size_t pixels = (size_t)s->width * s->height;
  memcpy(s->pixels + frame * pixels, image->pixels, pixels);
  sonde_affine to_probe = sonde_slice_plane((sonde_pose){{0, 0, 0}, {1, 0, 0, 0}}, image);
  const sonde_vec3 axis[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  sonde_affine to_reference =
      affine_columns(q_rotate(probe.rotation, axis[0]), q_rotate(probe.rotation, axis[1]),
                     q_rotate(probe.rotation, axis[2]), v_scale(probe.position, 1e3));
  // In mm; across the picture a voxel is as thick as a pixel is wide.
  const double thick = image->width_m / image->width;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 4; ++k)
      to_probe.m[i][k] = 1e3 * (k == 2 ? thick : 1) * to_probe.m[i][k] + 0.0;
  sonde_status status = sonde_sequence_set_transform(s, frame, "ImageToProbe", &to_probe, error);
  if (!status)
    status = sonde_sequence_set_transform(s, frame, "ProbeToReference", &to_reference, error);
  return status ? status : sonde_sequence_set(s, frame, "ImageStatus", "OK", error);
}

const slice_kernels *sonde_slice_kernels_find(const char *name) {
  const slice_kernels *known[] = {
#ifdef __x86_64__
      &sonde_slice_kernels_avx512, &sonde_slice_kernels_avx2,
#endif
      &sonde_slice_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}
