// Each frame made again from the others.
//
// mark_lit             pixels that some frame shows brighter than black
// neighbour_mean       frames before and after, pixel by pixel
// render               one way of making a frame
// add, finish          sums and means over frames
// leave_out            one frame
// sonde_sequence_leave_one_out
#include "echo/frames.h"

#include <string.h>

typedef struct work {
  const sonde_sequence *sequence;
  sonde_slicer_options options;
  size_t pixels; // of a frame
  uint8_t *lit, *known, *nearest_known, *mean;
  sonde_image bracket, nearest;
} work;

static const uint8_t *frame_of(const work *w, uint32_t frame) {
  return w->sequence->pixels + frame * w->pixels;
}

static void mark_lit(work *w) {
  for (uint32_t i = 0; i < w->sequence->count; ++i) {
    if (!w->sequence->frames[i].used) continue;
    const uint8_t *frame = frame_of(w, i);
    for (size_t p = 0; p < w->pixels; ++p) w->lit[p] |= frame[p] > 0;
  }
}

static void neighbour_mean(work *w, uint32_t before, uint32_t after) {
  const uint8_t *a = frame_of(w, before), *b = frame_of(w, after);
  for (size_t p = 0; p < w->pixels; ++p) w->mean[p] = (uint8_t)((a[p] + b[p] + 1) / 2);
}

static sonde_status render(work *w, uint32_t frame, sonde_slice_method method, sonde_image *image,
                           uint8_t *known, sonde_error *error) {
  sonde_slicer *slicer;
  sonde_slicer_options options = w->options;
  options.method = method;
  options.left_out = frame;
  sonde_status status = sonde_slicer_create(w->sequence, &options, &slicer, error);
  if (status) return status;
  sonde_slicer_render(slicer, &w->sequence->frames[frame].world_from_pixel, image, known);
  sonde_slicer_destroy(slicer);
  return SONDE_OK;
}

static void add(sonde_likeness *sum, const sonde_likeness *l) {
  sum->count += l->count;
  sum->rms_grey += l->rms_grey * l->rms_grey * (double)l->count;
  sum->mae_grey += l->mae_grey * (double)l->count;
  sum->psnr_db += l->psnr_db, sum->ncc += l->ncc, sum->ssim += l->ssim;
}

static void finish(sonde_likeness *sum, uint32_t frames) {
  SONDE_ASSERT(frames > 0 && sum->count > 0);
  sum->rms_grey = sqrt(sum->rms_grey / (double)sum->count);
  sum->mae_grey /= (double)sum->count;
  sum->psnr_db /= frames, sum->ncc /= frames, sum->ssim /= frames;
}

static sonde_status compare(const work *w, uint32_t frame, const uint8_t *made, sonde_likeness *sum,
                            sonde_error *error) {
  sonde_likeness l;
  sonde_status status = sonde_image_likeness(frame_of(w, frame), made, w->known, w->sequence->width,
                                             w->sequence->height, &l, error);
  if (!status) add(sum, &l);
  return status;
}

static sonde_status leave_out(work *w, uint32_t before, uint32_t frame, uint32_t after,
                              sonde_left_out *result, sonde_error *error) {
  sonde_status status = render(w, frame, SONDE_SLICE_BRACKET, &w->bracket, w->known, error);
  if (!status) status = render(w, frame, SONDE_SLICE_NEAREST, &w->nearest, w->nearest_known, error);
  if (status) return status;
  uint64_t left = 0;
  for (size_t p = 0; p < w->pixels; ++p) {
    w->known[p] = w->known[p] && w->nearest_known[p] && w->lit[p];
    left += w->known[p];
  }
  if (!left) return SONDE_OK; // the others do not reach this frame: not counted
  neighbour_mean(w, before, after);
  status = compare(w, frame, w->bracket.pixels, &result->bracket, error);
  if (!status) status = compare(w, frame, w->nearest.pixels, &result->nearest, error);
  if (!status) status = compare(w, frame, w->mean, &result->neighbours, error);
  ++result->frames;
  return status;
}

static sonde_status leave_each_out(work *w, sonde_left_out *result, const sonde_progress *progress,
                                   sonde_error *error) {
  uint32_t count = w->sequence->count, last[2] = {0, 0}, seen = 0;
  sonde_status status = SONDE_OK;
  for (uint32_t i = 0; i < count && !status; ++i) {
    if (!w->sequence->frames[i].used) continue;
    if (!sonde_progress_report(progress, (double)i / count, "leave one out"))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled after frame %u of %u", i, count);
    if (++seen > 2) status = leave_out(w, last[0], last[1], i, result, error);
    last[0] = last[1], last[1] = i;
  }
  if (status) return status;
  if (!result->frames)
    return sonde_fail(error, SONDE_MISMATCH,
                      "%u frames with a pose, none of which lies between others; expected at least "
                      "three in a sweep",
                      seen);
  finish(&result->bracket, result->frames);
  finish(&result->nearest, result->frames);
  finish(&result->neighbours, result->frames);
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
  sonde_status status = sonde_image_create(s->width, s->height, &w.bracket, error);
  if (!status) status = sonde_image_create(s->width, s->height, &w.nearest, error);
  w.lit = SONDE_NEW(uint8_t, w.pixels);
  w.known = SONDE_NEW(uint8_t, w.pixels);
  w.nearest_known = SONDE_NEW(uint8_t, w.pixels);
  w.mean = SONDE_NEW(uint8_t, w.pixels);
  if (!status && !(w.lit && w.known && w.nearest_known && w.mean))
    status = sonde_fail_memory(error);
  if (!status) mark_lit(&w);
  if (!status) status = leave_each_out(&w, result, progress, error);
  sonde_image_clear(&w.bracket);
  sonde_image_clear(&w.nearest);
  sonde_free(w.lit);
  sonde_free(w.known);
  sonde_free(w.nearest_known);
  sonde_free(w.mean);
  return status;
}
