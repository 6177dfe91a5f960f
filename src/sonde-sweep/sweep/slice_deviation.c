// How sure a picture between frames is. The likeness of frames falls with their distance, for each
// scale as slice_krige.c has fitted it. From likeness and from the weights that a picture gives to
// the frames on both sides of a pixel follows the expected square error of the pixel, as a share of
// the square by which these two frames should differ. The square by which they do differ about the
// pixel, times that share, is the square of the deviation.
#include "sweep/slice.h"

enum { REACH = 4 };                    // pixels from a window's middle to its end
static const double ROUNDED = 1.0 / 6; // mean square difference of two grey levels, rounded
static const double QUARTERS = 4;      // of a grey level

typedef struct foot {
  const slice_plane *plane; // NULL: none
  double u, v, far_m;
} foot;

// Mean square difference of two frames in the part of a window about a pixel's feet that both have.
static double difference_at(const sonde_slicer *s, const foot *a, const foot *b) {
  const int wide = (int)s->width, ua = (int)lround(a->u), va = (int)lround(a->v);
  const int ub = (int)lround(b->u), vb = (int)lround(b->v);
  const int left = (int)fmax(-REACH, (double)s->low[0] - fmin(ua, ub));
  const int right = (int)fmin(REACH, (double)s->high[0] - fmax(ua, ub));
  const int top = (int)fmax(-REACH, (double)s->low[1] - fmin(va, vb));
  const int bottom = (int)fmin(REACH, (double)s->high[1] - fmax(va, vb));
  double square = 0, count = 0;
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const int off =
          a->plane->pixels[(va + y) * wide + ua + x] - b->plane->pixels[(vb + y) * wide + ub + x];
      square += off * off, count += 1;
    }
  return fmax(square / count, ROUNDED); // the feet themselves are inside
}

// Expected square error of a pixel at 0 on a line, made from n frames that it meets at `at`.
static double expected_square(const sonde_slicer *s, int n, const double *at) {
  double square = 0, w[2] = {1, 0};
  if (n == 2) w[0] = fabs(at[1]) / (at[1] - at[0]), w[1] = 1 - w[0];
  for (int k = 0; k < SLICE_LEVELS; ++k) {
    const slice_decay *d = &s->pose_model.decays[k];
    if (s->options.method == SONDE_SLICE_KRIGE && n == 2)
      slice_krige_scale(d, n, at, 0, k + 1 == SLICE_LEVELS, w);
    double unlike = 1;
    for (int i = 0; i < n; ++i) {
      unlike -= 2 * w[i] * slice_likeness_at(d, fabs(at[i]));
      for (int j = 0; j < n; ++j) unlike += w[i] * w[j] * slice_likeness_at(d, fabs(at[i] - at[j]));
    }
    square += d->variance * fmax(unlike, 0);
  }
  return square;
}

uint64_t sonde_slicer_deviate(const sonde_slicer *s, sonde_image *image, uint8_t *known) {
  SONDE_ASSERT(s->bank);
  uint64_t reached = 0;
  for (uint32_t row = 0; row < image->height; ++row)
    for (uint32_t column = 0; column < image->width; ++column) {
      // The nearest frames whose used part has the pixel's foot: in front and behind.
      foot side[2] = {{.far_m = INFINITY}, {.far_m = INFINITY}};
      for (const slice_plane *p = s->planes; p < s->planes + s->count; ++p) {
        const double d = p->forms.d[0] + column * p->forms.d[1] + row * p->forms.d[2];
        foot *to = &side[d >= 0];
        if (!(fabs(d) < to->far_m)) continue;
        const double u = p->forms.u[0] + column * p->forms.u[1] + row * p->forms.u[2];
        const double v = p->forms.v[0] + column * p->forms.v[1] + row * p->forms.v[2];
        if (u >= (double)s->low[0] && u <= (double)s->high[0] && v >= (double)s->low[1] &&
            v <= (double)s->high[1])
          *to = (foot){p, u, v, fabs(d)};
      }
      const bool both =
          side[0].plane && side[1].plane && side[0].far_m + side[1].far_m <= s->options.gap_m;
      const bool nearest = s->options.method == SONDE_SLICE_NEAREST;
      const double far_m = fmin(side[0].far_m, side[1].far_m);
      const bool alone = far_m <= (nearest ? s->options.gap_m : s->options.reach_m);
      const size_t to = (size_t)row * image->width + column;
      image->pixels[to] = 0;
      if (known) known[to] = both || alone;
      if (!both && !alone) continue;
      ++reached;
      const double at[2] = {-side[0].far_m, side[1].far_m};
      double square = nearest || !both ? expected_square(s, 1, &far_m) : expected_square(s, 2, at);
      if (both) {
        // Two frames that were to foretell each other would err by their difference.
        const double gap_m = at[1] - at[0], expected = expected_square(s, 1, &gap_m);
        square *= expected > 0 ? difference_at(s, &side[0], &side[1]) / expected : 0;
      }
      image->pixels[to] = (uint8_t)fmin(QUARTERS * sqrt(square) + 0.5, 255);
    }
  return reached;
}
