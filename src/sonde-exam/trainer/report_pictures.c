// The learner's own images: which presses to show, and their pixels as PNG data in base64.
#include "files/png.h"
#include "trainer/report.h"

// Distance along the vein of a press from those of its result that are chosen; -1: chosen itself.
static double distance_from_chosen(const sonde_compression *presses, const uint32_t *chosen,
                                   uint32_t used, uint32_t index) {
  double least = INFINITY;
  for (uint32_t i = 0; i < used; ++i) {
    const sonde_compression *a = &presses[chosen[i]], *b = &presses[index];
    if (chosen[i] == index) return -1;
    if (a->result != b->result) continue;
    double apart = fabs(a->along_m - b->along_m);
    if (!isfinite(apart)) apart = fabs(a->z_m - b->z_m); // other veins
    least = isfinite(apart) ? fmin(least, apart) : 0;
  }
  return least;
}

uint32_t sonde_exam_report_choose(const sonde_compression *presses, uint32_t count, uint32_t most,
                                  uint32_t *chosen) {
  SONDE_ASSERT((count == 0 || presses) && (most == 0 || chosen));
  static const sonde_press_result ORDER[] = {SONDE_PRESS_OPEN, SONDE_PRESS_COMPLETE,
                                             SONDE_PRESS_TOO_HARD, SONDE_PRESS_OFF_AXIS,
                                             SONDE_PRESS_INSUFFICIENT};
  uint32_t used = 0, before = UINT32_MAX;
  // A round takes one press of each result: the one that lies farthest from those chosen so far.
  while (used < most && used != before) {
    before = used;
    for (size_t k = 0; k < SONDE_COUNT_OF(ORDER) && used < most; ++k) {
      uint32_t best = UINT32_MAX;
      double farthest = -1;
      for (uint32_t i = 0; i < count; ++i) {
        if (presses[i].result != ORDER[k]) continue;
        double apart = distance_from_chosen(presses, chosen, used, i);
        if (apart > farthest) farthest = apart, best = i;
      }
      if (best != UINT32_MAX) chosen[used++] = best;
    }
  }
  SONDE_ASSERT(used <= most);
  // In the order of time.
  for (uint32_t i = 1; i < used; ++i) {
    uint32_t value = chosen[i], j = i;
    for (; j > 0 && chosen[j - 1] > value; --j) chosen[j] = chosen[j - 1];
    chosen[j] = value;
  }
  return used;
}

// An image as PNG, after means over square blocks: they keep the speckle's look at a quarter of the
// bytes.
static sonde_status put_image(sonde_json_out *out, const char *key, const sonde_image *image,
                              sonde_error *error) {
  if (!image->pixels || !image->width || !image->height) {
    sonde_json_put_real(out, key, (double)NAN, 0); // null
    return SONDE_OK;
  }
  sonde_image small = {0};
  uint8_t *bytes = NULL;
  size_t count = 0;
  enum { SIDE = 320 };
  uint32_t longest = image->width > image->height ? image->width : image->height;
  uint32_t block = longest > SIDE ? (longest + SIDE - 1) / SIDE : 1;
  sonde_status status =
      sonde_image_create(image->width / block, image->height / block, &small, error);
  for (uint32_t y = 0; y < small.height; ++y)
    for (uint32_t x = 0; x < small.width; ++x) {
      uint32_t sum = 0;
      for (uint32_t k = 0; k < block * block; ++k)
        sum +=
            image->pixels[(size_t)(y * block + k / block) * image->width + x * block + k % block];
      small.pixels[(size_t)y * small.width + x] =
          (uint8_t)((sum + block * block / 2) / (block * block));
    }
  if (!status) status = sonde_png_encode(&small, &bytes, &count, error);
  char *text = status ? NULL : sonde_base64_encode(bytes, count);
  if (!status && !text) status = sonde_fail_memory(error);
  if (!status) sonde_json_put_text(out, key, text);
  sonde_free(text);
  sonde_free(bytes);
  sonde_image_clear(&small);
  return status;
}

sonde_status sonde_put_pictures(sonde_json_out *out, const sonde_exam_report *exam,
                                sonde_error *error) {
  uint32_t shown =
      exam->picture_count < SONDE_EXAM_PICTURES ? exam->picture_count : SONDE_EXAM_PICTURES;
  sonde_status status = SONDE_OK;
  sonde_json_begin_list(out, "pictures");
  for (uint32_t i = 0; i < shown && !status; ++i) {
    const sonde_exam_picture *picture = &exam->pictures[i];
    SONDE_ASSERT(picture->press < exam->press_count);
    sonde_json_begin_object(out, NULL);
    sonde_json_put_integer(out, "press", picture->press + 1);
    status = put_image(out, "before", &picture->before, error);
    if (!status) status = put_image(out, "peak", &picture->peak, error);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  return status;
}
