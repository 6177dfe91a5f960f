// Each frame made again from the others.
#include "sweep/slice.h"

#include <string.h>

typedef struct work {
  const sonde_sequence *sequence;
  sonde_slicer_options options;
  size_t pixels; // of a frame
  uint8_t *lit, *known, *other_known, *mean;
  slice_bank *bank;
  uint32_t *used, count; // frames with a pose
  sonde_image images[4];
} work;

static const uint8_t *frame_of(const work *w, uint32_t frame) {
  return w->sequence->pixels + frame * w->pixels;
}

enum { AT_PLACE, KRIGED, BRACKETED, NEAREST, MAKERS };

static void intersect_known(work *w) {
  for (size_t p = 0; p < w->pixels; ++p) w->known[p] = w->known[p] && w->other_known[p];
}

static sonde_status render(work *w, uint32_t frame, sonde_slice_method method, int maker,
                           bool *along_sweep, sonde_error *error) {
  sonde_slicer *slicer;
  sonde_slicer_options options = w->options;
  const sonde_affine *pose = &w->sequence->frames[frame].world_from_pixel;
  options.method = method;
  options.left_out = frame;
  options.once = true;
  sonde_status status = sonde_slicer_create_with(w->sequence, &options, w->bank, &slicer, error);
  if (status) return status;
  if (method == SONDE_SLICE_KRIGE) {
    *along_sweep = slicer->model.along_sweep;
    sonde_slicer_render_place(slicer, frame, pose, (const uint32_t[2]){0, 0}, &w->images[AT_PLACE],
                              w->other_known);
    intersect_known(w);
  }
  sonde_slicer_render(slicer, pose, &w->images[maker], w->other_known);
  intersect_known(w);
  sonde_slicer_destroy(slicer);
  return SONDE_OK;
}

static sonde_status leave_each_out(work *w, sonde_left_out *result, const sonde_progress *progress,
                                   sonde_error *error) {
  sonde_likeness *sums[MAKERS + 1] = {&result->place, &result->krige, &result->bracket,
                                      &result->nearest, &result->neighbours};
  const sonde_sequence *s = w->sequence;
  uint32_t step = 1 + w->options.left_out_beside;
  for (uint32_t k = step; k + step < w->count; ++k) {
    uint32_t frame = w->used[k];
    if (!sonde_progress_report(progress, (double)k / w->count, "leave one out"))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled after frame %u of %u", frame, s->count);
    // The pixels that count are those that every maker of the frame reaches.
    uint64_t left = 0;
    bool along_sweep = false;
    memcpy(w->known, w->lit, w->pixels);
    sonde_status status = render(w, frame, SONDE_SLICE_KRIGE, KRIGED, &along_sweep, error);
    if (!status) status = render(w, frame, SONDE_SLICE_BRACKET, BRACKETED, NULL, error);
    if (!status) status = render(w, frame, SONDE_SLICE_NEAREST, NEAREST, NULL, error);
    if (status) return status;
    for (size_t p = 0; p < w->pixels; ++p) left += w->known[p];
    if (!left) continue; // the others do not reach this frame: not counted
    // The mean of the frames before and after is taken pixel by pixel.
    const uint8_t *a = frame_of(w, w->used[k - step]), *b = frame_of(w, w->used[k + step]);
    for (size_t p = 0; p < w->pixels; ++p) w->mean[p] = (uint8_t)((a[p] + b[p] + 1) / 2);
    for (int i = 0; i <= MAKERS; ++i) {
      sonde_likeness l, *sum = sums[i];
      status = sonde_image_likeness(frame_of(w, frame), i < MAKERS ? w->images[i].pixels : w->mean,
                                    w->known, s->width, s->height, &l, error);
      if (status) return status;
      sum->count += l.count;
      sum->rms_grey += l.rms_grey * l.rms_grey * (double)l.count;
      sum->mae_grey += l.mae_grey * (double)l.count;
      sum->psnr_db += l.psnr_db, sum->ncc += l.ncc, sum->ssim += l.ssim;
    }
    result->along_sweep += along_sweep;
    ++result->frames;
  }
  if (!result->frames)
    return sonde_fail(error, SONDE_MISMATCH,
                      "%u frames with a pose, none of which lies between others; expected at least "
                      "%u in a sweep",
                      w->count, 2 * step + 1);
  for (size_t i = 0; i < SONDE_COUNT_OF(sums); ++i) {
    sonde_likeness *sum = sums[i];
    SONDE_ASSERT(sum->count > 0);
    sum->rms_grey = sqrt(sum->rms_grey / (double)sum->count);
    sum->mae_grey /= (double)sum->count;
    sum->psnr_db /= result->frames, sum->ncc /= result->frames, sum->ssim /= result->frames;
  }
  return SONDE_OK;
}

sonde_status sonde_sequence_leave_one_out(const sonde_sequence *s,
                                          const sonde_slicer_options *options,
                                          sonde_left_out *result, const sonde_progress *progress,
                                          sonde_error *error) {
  SONDE_ASSERT(s != NULL && result != NULL && s->frames != NULL);
  *result = (sonde_left_out){0};
  work w = {.sequence = s, .pixels = (size_t)s->width * s->height};
  w.options = options ? *options : sonde_slicer_options_default();
  sonde_status status = sonde_slicer_check(s, &w.options, error);
  for (int k = 0; k < MAKERS && !status; ++k)
    status = sonde_image_create(s->width, s->height, &w.images[k], error);
  w.lit = SONDE_NEW(uint8_t, w.pixels);
  w.known = SONDE_NEW(uint8_t, w.pixels);
  w.other_known = SONDE_NEW(uint8_t, w.pixels);
  w.mean = SONDE_NEW(uint8_t, w.pixels);
  w.used = SONDE_NEW(uint32_t, s->count);
  if (!status && !(w.lit && w.known && w.other_known && w.mean && w.used))
    status = sonde_fail_memory(error);
  // A pixel counts where some frame shows it brighter than black.
  for (uint32_t i = 0; i < s->count && !status; ++i) {
    if (!s->frames[i].used) continue;
    w.used[w.count++] = i;
    for (size_t p = 0; p < w.pixels; ++p) w.lit[p] |= frame_of(&w, i)[p] > 0;
  }
  if (!status) status = sonde_slice_bank_create(s, &w.bank, error);
  if (!status) status = leave_each_out(&w, result, progress, error);
  for (int k = 0; k < MAKERS; ++k) sonde_image_clear(&w.images[k]);
  sonde_slice_bank_destroy(w.bank);
  sonde_free(w.lit);
  sonde_free(w.known);
  sonde_free(w.other_known);
  sonde_free(w.mean);
  sonde_free(w.used);
  return status;
}
