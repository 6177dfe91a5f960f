// The learner's own images: which presses to show, and each as a pair.
//
// distance         of a press from those of the same result that are chosen already
// pick             the press of a result that lies farthest from them
// sort             indices in the order of time
// shrink           averages square blocks until an image is small enough
// put_base64       bytes as text
// put_image        one side of a pair
// put_pair         both sides and what the press was
#include "files/png.h"
#include "trainer/report.h"

// ---- which --------------------------------------------------------------------------------------

static double distance(const sonde_compression *presses, const uint32_t *chosen, uint32_t used,
                       uint32_t index) {
  double least = INFINITY;
  for (uint32_t i = 0; i < used; ++i) {
    const sonde_compression *a = &presses[chosen[i]], *b = &presses[index];
    if (chosen[i] == index) return -1;
    if (a->result != b->result) continue;
    double apart = fabs(a->along_m - b->along_m);
    least = isfinite(apart) ? fmin(least, apart) : 0;
  }
  return least;
}

// UINT32_MAX when all of that result are chosen.
static uint32_t pick(const sonde_compression *presses, uint32_t count, sonde_press_result result,
                     const uint32_t *chosen, uint32_t used) {
  uint32_t best = UINT32_MAX;
  double farthest = -1;
  for (uint32_t i = 0; i < count; ++i) {
    if (presses[i].result != result) continue;
    double apart = distance(presses, chosen, used, i);
    if (apart > farthest) farthest = apart, best = i;
  }
  return best;
}

static void sort(uint32_t *values, uint32_t count) {
  for (uint32_t i = 1; i < count; ++i) {
    uint32_t value = values[i], j = i;
    for (; j > 0 && values[j - 1] > value; --j) values[j] = values[j - 1];
    values[j] = value;
  }
}

uint32_t sonde_exam_report_choose(const sonde_compression *presses, uint32_t count, uint32_t most,
                                  uint32_t *chosen) {
  SONDE_ASSERT((count == 0 || presses) && (most == 0 || chosen));
  static const sonde_press_result ORDER[] = {SONDE_PRESS_OPEN, SONDE_PRESS_COMPLETE,
                                             SONDE_PRESS_TOO_HARD, SONDE_PRESS_OFF_AXIS,
                                             SONDE_PRESS_INSUFFICIENT};
  uint32_t used = 0, before = UINT32_MAX;
  while (used < most && used != before) { // rounds, one of each result
    before = used;
    for (size_t k = 0; k < SONDE_COUNT_OF(ORDER) && used < most; ++k) {
      uint32_t next = pick(presses, count, ORDER[k], chosen, used);
      if (next != UINT32_MAX) chosen[used++] = next;
    }
  }
  sort(chosen, used);
  return used;
}

// ---- pixels -------------------------------------------------------------------------------------

// Means over blocks that keep the speckle's look at a quarter of the bytes.
static sonde_status shrink(const sonde_image *from, sonde_image *to, sonde_error *error) {
  enum { SIDE = 320 };
  uint32_t longest = from->width > from->height ? from->width : from->height;
  uint32_t block = (longest + SIDE - 1) / SIDE;
  if (block < 1) block = 1;
  sonde_status status = sonde_image_create(from->width / block, from->height / block, to, error);
  if (status) return status;
  for (uint32_t y = 0; y < to->height; ++y)
    for (uint32_t x = 0; x < to->width; ++x) {
      uint32_t sum = 0;
      for (uint32_t v = 0; v < block; ++v)
        for (uint32_t u = 0; u < block; ++u)
          sum += from->pixels[(size_t)(y * block + v) * from->width + x * block + u];
      to->pixels[(size_t)y * to->width + x] =
          (uint8_t)((sum + block * block / 2) / (block * block));
    }
  return SONDE_OK;
}

static void put_base64(sonde_text *out, const uint8_t *bytes, size_t count) {
  static const char DIGITS[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  enum { LINE = 768 }; // a multiple of three
  char text[LINE / 3 * 4 + 1];
  for (size_t from = 0; from < count; from += LINE) {
    size_t used = 0, end = from + LINE < count ? from + LINE : count;
    for (size_t i = from; i < end; i += 3) {
      uint32_t group = (uint32_t)bytes[i] << 16;
      if (i + 1 < end) group |= (uint32_t)bytes[i + 1] << 8;
      if (i + 2 < end) group |= bytes[i + 2];
      text[used++] = DIGITS[group >> 18];
      text[used++] = DIGITS[group >> 12 & 63];
      text[used++] = i + 1 < end ? DIGITS[group >> 6 & 63] : '=';
      text[used++] = i + 2 < end ? DIGITS[group & 63] : '=';
    }
    SONDE_ASSERT(used < sizeof text);
    text[used] = 0;
    sonde_text_put(out, text);
  }
}

static sonde_status put_image(sonde_text *out, const sonde_image *image, const char *label,
                              uint32_t press, sonde_error *error) {
  sonde_text_put(out, "<div>");
  if (!image->pixels || !image->width || !image->height) {
    sonde_text_format(out, "<em>no image</em><span>%s</span></div>\n", label);
    return SONDE_OK;
  }
  sonde_image small = {0};
  uint8_t *bytes = NULL;
  size_t count = 0;
  sonde_status status = shrink(image, &small, error);
  if (!status) status = sonde_png_encode(&small, &bytes, &count, error);
  if (!status) {
    sonde_text_format(out,
                      "<img alt=\"Ultrasound image of press %u, %s\" src=\"data:image/png;base64,",
                      press + 1, label);
    put_base64(out, bytes, count);
    sonde_text_format(out, "\" width=\"%u\" height=\"%u\"/><span>%s</span></div>\n", small.width,
                      small.height, label);
  }
  sonde_free(bytes);
  sonde_image_clear(&small);
  return status;
}

// ---- pairs --------------------------------------------------------------------------------------

static sonde_status put_pair(sonde_debrief *page, const sonde_exam_picture *picture,
                             sonde_error *error) {
  const sonde_compression *p = &page->in->presses[picture->press];
  sonde_text *out = &page->out;
  sonde_text_put(out, "<figure><div class=\"pair\">\n");
  sonde_status status = put_image(out, &picture->before, "before", picture->press, error);
  if (!status) status = put_image(out, &picture->peak, "at the peak", picture->press, error);
  if (status) return status;
  sonde_text_format(out, "</div><figcaption><b style=\"color:%s\">Press %u: %s</b><br/>",
                    sonde_press_colour(p->result), picture->press + 1,
                    sonde_press_words(p->result));
  sonde_debrief_place(page, p);
  sonde_text_format(out, "<br/>%s N", sonde_fixed(p->force_peak_n, 1).s);
  if (isfinite(p->vein_ratio))
    sonde_text_format(out, ", %s %% of the vein left", sonde_fixed(100 * p->vein_ratio, 0).s);
  sonde_text_put(out, "</figcaption></figure>\n");
  return SONDE_OK;
}

sonde_status sonde_debrief_pictures(sonde_debrief *page, sonde_error *error) {
  const sonde_exam_report *r = page->in;
  sonde_status status = SONDE_OK;
  if (!r->press_count) return SONDE_OK;
  sonde_debrief_section(page, "pictures", "Your compressions");
  if (!r->picture_count) {
    sonde_text_put(&page->out, "<p>No images were kept of this exam.</p>\n</section>\n");
    return SONDE_OK;
  }
  uint32_t shown = r->picture_count < SONDE_EXAM_PICTURES ? r->picture_count : SONDE_EXAM_PICTURES;
  sonde_text_format(
      &page->out,
      "<p class=\"quiet\">%s%u of your %u presses: the image before and at the peak. "
      "In a complete press the vein's walls touch. In this simulator the artery beside it gives "
      "way "
      "too and keeps four to six tenths of its area; in a patient it keeps its shape.</p>"
      "\n<div class=\"pictures\">\n",
      shown < r->press_count ? "" : "All ", shown, r->press_count);
  for (uint32_t i = 0; i < shown && !status; ++i) status = put_pair(page, &r->pictures[i], error);
  sonde_text_put(&page->out, "</div>\n</section>\n");
  return status;
}
