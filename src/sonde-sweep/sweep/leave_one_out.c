// Each frame made again from the others.
#include "sonde/sweep_poses.h"
#include "sweep/slice.h"

#include <string.h>

// Poses are corrected once for a group of frames that are left out, this many apart (times one more
// than are left out beside each).
enum { GROUPS = 10 };

typedef struct work {
  const sonde_sequence *sequence; // as it was given, or with the poses of the group
  sonde_slicer_options options;
  size_t pixels; // of a frame
  uint8_t *lit, *known, *other_known, *mean;
  slice_bank *bank;
  uint32_t *used, count; // frames with a pose
  sonde_image images[4];
  sonde_sequence moved; // shares all but the list of frames with the given one
  uint32_t group;       // that `moved` is for
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

// Compares used frame k with what the others make of it.
static sonde_status leave_out(work *w, uint32_t k, sonde_likeness *const sums[MAKERS + 1],
                              sonde_left_out *result, sonde_error *error) {
  const sonde_sequence *s = w->sequence;
  const uint32_t step = 1 + w->options.left_out_beside, frame = w->used[k];
  // The pixels that count are those that every maker of the frame reaches.
  uint64_t left = 0;
  bool along_sweep = false;
  memcpy(w->known, w->lit, w->pixels);
  sonde_status status = render(w, frame, SONDE_SLICE_KRIGE, KRIGED, &along_sweep, error);
  if (!status) status = render(w, frame, SONDE_SLICE_BRACKET, BRACKETED, NULL, error);
  if (!status) status = render(w, frame, SONDE_SLICE_NEAREST, NEAREST, NULL, error);
  if (status) return status;
  for (size_t p = 0; p < w->pixels; ++p) left += w->known[p];
  if (!left) return SONDE_OK; // the others do not reach this frame: not counted
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
  return SONDE_OK;
}

// The poses corrected without the content of a group's frames and those left out beside them.
static sonde_status correct_poses(work *w, uint32_t group, uint32_t groups,
                                  const sonde_sequence *given, sonde_error *error) {
  const uint32_t beside = w->options.left_out_beside;
  bool *hidden = SONDE_NEW(bool, given->count);
  if (!hidden) return sonde_fail_memory(error);
  memcpy(w->moved.frames, given->frames, given->count * sizeof *given->frames);
  for (uint32_t k = 0; k < w->count; ++k)
    hidden[w->used[k]] = (k + groups + beside - group) % groups <= 2 * beside;
  sonde_pose_findings findings;
  sonde_status status = sonde_sequence_refine_poses(&w->moved, hidden, &findings, NULL, error);
  sonde_free(hidden);
  sonde_slice_bank_destroy(w->bank);
  w->bank = NULL;
  return status ? status : sonde_slice_bank_create(&w->moved, &w->bank, error);
}

static sonde_status leave_each_out(work *w, bool refine, sonde_left_out *result,
                                   const sonde_progress *progress, sonde_error *error) {
  sonde_likeness *const sums[MAKERS + 1] = {&result->place, &result->krige, &result->bracket,
                                            &result->nearest, &result->neighbours};
  const sonde_sequence *given = w->sequence;
  const uint32_t step = 1 + w->options.left_out_beside, groups = refine ? GROUPS * step : 1;
  uint32_t done = 0;
  if (refine) w->sequence = &w->moved;
  for (uint32_t group = 0; group < groups; ++group)
    for (uint32_t k = group; k + step < w->count; k += groups) {
      if (k < step) continue;
      if (!sonde_progress_report(progress, (double)done++ / w->count, "leave one out"))
        return sonde_fail(error, SONDE_CANCELLED, "cancelled after %u of %u frames", done,
                          given->count);
      sonde_status status = SONDE_OK;
      if (refine && w->group != group) status = correct_poses(w, group, groups, given, error);
      w->group = group;
      if (!status) status = leave_out(w, k, sums, result, error);
      if (status) return status;
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
                                          const sonde_slicer_options *options, bool refine_poses,
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
  w.group = UINT32_MAX;
  w.moved = *s;
  w.moved.frames = SONDE_NEW(sonde_tracked_frame, s->count);
  if (!status && !w.moved.frames) status = sonde_fail_memory(error);
  if (!status) status = leave_each_out(&w, refine_poses, result, progress, error);
  sonde_free(w.moved.frames);
  for (int k = 0; k < MAKERS; ++k) sonde_image_clear(&w.images[k]);
  sonde_slice_bank_destroy(w.bank);
  sonde_free(w.lit);
  sonde_free(w.known);
  sonde_free(w.other_known);
  sonde_free(w.mean);
  sonde_free(w.used);
  return status;
}
