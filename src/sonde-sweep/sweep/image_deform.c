// A picture taken at rest, deformed with the thigh.
//
// The rest point of a place of the pressed probe's plane is found at nodes every NODE pixels and is
// bilinear between them: a lumen is tens of pixels wide. Only its part in the rest picture's plane
// counts; what moves through the plane is seen as if the tissue went on alike.
#include "sweep/frames.h"
#include "interior/interior.h"

enum { NODE = 2, NODES = 64 }; // pixels between nodes; nodes held at once along a row

typedef struct job {
  const sonde_image *rest;
  const sonde_image_press *press;
  sonde_image *out;
  uint8_t *known;
} job;

// Middle of pixel 0 to middle of the last one spans the size less one pixel.
static void locate_nodes(const job *j, uint32_t column, uint32_t row, uint32_t count,
                         double positions[][2]) {
  const sonde_image *out = j->out, *rest = j->rest;
  double dx = out->width_m / out->width, dz = out->height_m / out->height;
  for (uint32_t k = 0; k < count; ++k) {
    double x = (column + k * (double)NODE + 0.5) * dx - 0.5 * out->width_m;
    double z = (row + 0.5) * dz;
    sonde_vec3 p =
        sonde_interior_rest_point(j->press->interior, pose_apply(j->press->pose, vec3(x, 0, z)));
    sonde_vec3 q = pose_apply_inverse(j->press->rest_pose, p);
    positions[k][0] =
        (q.x + j->press->shift_m[0] + 0.5 * rest->width_m) / rest->width_m * rest->width;
    positions[k][1] = (q.z + j->press->shift_m[1]) / rest->height_m * rest->height;
    positions[k][0] -= 0.5, positions[k][1] -= 0.5;
  }
}

// Rows of pixels between two rows of nodes; returns the pixels that lie in the rest picture.
static uint64_t fill_rows(const job *j, uint32_t column, uint32_t row, uint32_t wide,
                          double (*above)[2], double (*below)[2]) {
  const sonde_image *rest = j->rest;
  uint64_t reached = 0;
  for (uint32_t y = 0; y < NODE && row + y < j->out->height; ++y)
    for (uint32_t x = 0; x < wide; ++x) {
      double t = (double)y / NODE, s = (double)(x % NODE) / NODE, at[2];
      for (int k = 0; k < 2; ++k) {
        double top = above[x / NODE][k] + s * (above[x / NODE + 1][k] - above[x / NODE][k]);
        double low = below[x / NODE][k] + s * (below[x / NODE + 1][k] - below[x / NODE][k]);
        at[k] = top + t * (low - top);
      }
      bool known = at[0] >= -0.5 && at[1] >= -0.5 && at[0] <= rest->width - 0.5 &&
                   at[1] <= rest->height - 0.5;
      uint8_t grey = 0;
      if (known) {
        double u = clamp(at[0], 0, rest->width - 1.0), v = clamp(at[1], 0, rest->height - 1.0);
        size_t column_at = (size_t)u, row_at = (size_t)v;
        size_t right = column_at + 1 < rest->width;
        const uint8_t *p = rest->pixels + row_at * rest->width + column_at;
        const uint8_t *q = p + (row_at + 1 < rest->height ? rest->width : 0);
        double a = u - (double)column_at, b = v - (double)row_at;
        double top = p[0] + a * (p[right] - p[0]), low = q[0] + a * (q[right] - q[0]);
        grey = (uint8_t)(top + b * (low - top) + 0.5);
      }
      size_t i = (size_t)(row + y) * j->out->width + column + x;
      j->out->pixels[i] = grey;
      if (j->known) j->known[i] = known;
      reached += known;
    }
  return reached;
}

uint64_t sonde_image_pressed(const sonde_image *rest, const sonde_image_press *press,
                             sonde_image *out, uint8_t *known) {
  SONDE_ASSERT(rest != NULL && press != NULL && press->interior != NULL && out != NULL);
  SONDE_ASSERT(rest->pixels != out->pixels && rest->width_m > 0 && out->width_m > 0);
  job j = {rest, press, out, known};
  uint64_t reached = 0;
  for (uint32_t left = 0; left < out->width; left += NODE * (NODES - 1)) {
    double positions[2][NODES][2];
    uint32_t wide = out->width - left, k = 0;
    if (wide > NODE * (NODES - 1)) wide = NODE * (NODES - 1);
    uint32_t count = (wide + NODE - 1) / NODE + 1;
    locate_nodes(&j, left, 0, count, positions[0]);
    for (uint32_t row = 0; row < out->height; row += NODE, k ^= 1) {
      locate_nodes(&j, left, row + NODE, count, positions[k ^ 1]);
      reached += fill_rows(&j, left, row, wide, positions[k], positions[k ^ 1]);
    }
  }
  return reached;
}
