// The inner loops without vectors and with the library's functions: what the others are tested
// against. The tissue's row comes from the base set.
#include "base/base.h"
#include "echo/kernel.h"
#include "interior/clot.h"
#include "interior/vessels.h"

#include <math.h>

static double form_at(const float form[4], double x, double y, double z) {
  return (double)form[0] + (double)form[1] * x + (double)form[2] * y + (double)form[3] * z;
}

static void splat(const splat_job *job) {
  for (const splat_map *map = job->map; map < job->map + job->maps; ++map)
    for (uint32_t i = map->from; i < map->from + map->count; ++i) {
      double x = (double)job->x[i], y = (double)job->y[i], z = (double)job->z[i], at[3];
      for (int c = 0; c < 3; ++c)
        at[c] = (double)map->m[0][c] + (double)map->m[1][c] * x + (double)map->m[2][c] * y +
                (double)map->m[3][c] * z;
      // Within the slab and the grid.
      const double height = 1 - at[1] * at[1], nearest = floor(at[2] + 0.5), line = floor(at[0]);
      if (!(height > 0 && at[0] >= 0 && at[0] < (double)job->right &&
            nearest >= (double)job->rows.first && nearest < (double)job->rows.last))
        continue;
      // Lumina show less of the tissue's scatterers.
      double shown = 1;
      for (uint32_t k = map->lumen; k < map->lumen + map->lumens; ++k) {
        const splat_lumen *l = &job->lumen[k];
        double a = form_at(l->along, x, y, z), b = form_at(l->across, x, y, z);
        const double along_m = form_at(l->axial, x, y, z), solid = (double)l->solid;
        if (a * a + b * b < 1 && !sonde_clot_holds(l->form, solid, l->vessel, along_m, a, b))
          shown = (double)l->amplitude;
      }
      const double weight = (double)job->sign[i] * (double)map->m[0][3] * shown * height;
      // Two columns, three rows.
      const double turn = 6.283185307179586 * at[2] * (double)job->turns, b = at[2] - nearest;
      const double deep[3] = {0.5 * (0.5 - b) * (0.5 - b), 0.75 - b * b,
                              0.5 * (0.5 + b) * (0.5 + b)};
      for (size_t corner = 0; corner < 6; ++corner) {
        double a = corner & 1 ? at[0] - line : 1 - (at[0] - line);
        double size = a * deep[corner / 2] * weight;
        size_t row = ((size_t)nearest & job->mask) + corner / 2;
        float *g = job->grid + row * job->stride + 2 * ((size_t)line + (corner & 1));
        g[0] += (float)(size * cos(turn)), g[1] -= (float)(size * sin(turn));
      }
    }
}

static sonde_vec3 vector_of(const float (*wall)[WALL_ROOM], int field, uint32_t group) {
  return vec3((double)wall[field][group], (double)wall[field + 1][group],
              (double)wall[field + 2][group]);
}

static uint32_t vessels_near(const wall_job *job, uint32_t group,
                             sonde_vessel_state near[MOST_VESSELS]) {
  uint32_t count = 0;
  for (uint32_t k = 0; k < job->walls; ++k) {
    const float(*wall)[WALL_ROOM] = job->wall[k];
    if (!(wall[WALL_COUPLING][group] > 0)) continue;
    sonde_vessel_state *v = &near[count++];
    *v = (sonde_vessel_state){.rest_centre_m = vector_of(wall, WALL_REST, group),
                              .axis = vector_of(wall, WALL_AXIS, group),
                              .flat_axis = vector_of(wall, WALL_FLAT, group),
                              .rest_radius_m = (double)wall[WALL_RADIUS][group],
                              .coupling = (double)wall[WALL_COUPLING][group],
                              .half_short_m = (double)wall[WALL_SHORT][group],
                              .half_long_m = (double)wall[WALL_LONG][group],
                              .tissue_rotation = (double)wall[WALL_ROTATION][group],
                              .tissue_short = (double)wall[WALL_TISSUE_SHORT][group],
                              .tissue_shear = (double)wall[WALL_SHEAR][group],
                              .tissue_long = (double)wall[WALL_TISSUE_LONG][group],
                              .tissue_smoothing = (double)wall[WALL_SMOOTHING][group]};
    v->centre_m = v_add(v->rest_centre_m, vector_of(wall, WALL_SHIFT, group));
  }
  return count;
}

static sonde_vec3 point_of(const float (*from)[WALL_POINTS], uint32_t i) {
  return vec3((double)from[0][i], (double)from[1][i], (double)from[2][i]);
}

static void warp(const wall_job *job) {
  for (uint32_t i = 0; i < 4 * job->groups; ++i) {
    sonde_vessel_state near[MOST_VESSELS];
    uint32_t count = vessels_near(job, i / 4, near);
    sonde_vec3 at = sonde_vessels_warp(near, count, point_of(job->rest, i));
    for (int c = 0; c < 3; ++c) job->warped[c][i] = (float)v_coordinate(at, c);
  }
}

static void smooth(const wall_job *job) {
  for (uint32_t i = 0; i < 4 * job->groups; ++i) {
    sonde_vessel_state near[MOST_VESSELS];
    uint32_t count = vessels_near(job, i / 4, near);
    sonde_vec3 warped = point_of((const float(*)[WALL_POINTS])job->warped, i);
    sonde_vec3 place = point_of((const float(*)[WALL_POINTS])job->place, i);
    sonde_vec3 at = sonde_vessels_smooth(near, count, point_of(job->rest, i), warped, place);
    for (int c = 0; c < 3; ++c) job->place[c][i] = (float)v_coordinate(at, c);
  }
}

static void stream(const stream_job *job) {
  for (uint32_t i = 0; i < job->count; ++i) {
    double at = (double)job->z[i] + job->flowed * (double)job->speed[i], whole = floor(at);
    uint32_t train = (uint32_t)(job->segment - (int32_t)whole);
    const uint32_t salt = job->salt * 0xc2b2ae3du;
    uint32_t hash[2] = {train * 0x9e3779b1u ^ (job->first + i) * 0x85ebca77u ^ salt,
                        train * 0x9e3779b1u ^ job->bundle[i] * 0xb5297a4du ^ salt};
    for (int k = 0; k < 2; ++k) {
      hash[k] = (hash[k] ^ (hash[k] >> 15)) * 0x2c1b3c6du;
      hash[k] = (hash[k] ^ (hash[k] >> 12)) * 0x297a2d39u;
      hash[k] ^= hash[k] >> 15;
    }
    const double streaks = job->streaks, share = (double)(hash[1] >> 8) * 0x1p-23 - 1;
    const double size = (1 + streaks * share) / sqrt(1 + streaks * streaks / 3);
    job->at[i] = (float)(at - whole - 0.5);
    job->sign[i] = (float)(hash[0] & 1 ? size : -size);
  }
}

// Column t of line l.
static double column(const float *const parts[SONDE_FINE], int l, int t) {
  return (double)parts[t & 1][l + (t - (t & 1)) / 2];
}

static void lateral(const lateral_job *job) {
  for (uint32_t l = 0; l < job->lines; ++l)
    for (uint32_t k = 0; k < SONDE_RANK; ++k) {
      double re = 0, im = 0;
      for (int t = -job->half; t <= job->half; ++t) {
        const float *u = job->tap[t < 0 ? -t : t][k];
        double x = column(job->re, (int)l, t), y = column(job->im, (int)l, t);
        double tap_im = (double)u[1] + (double)u[0];
        re += (double)u[0] * x - tap_im * y, im += (double)u[0] * y + tap_im * x;
      }
      job->out[2 * k * job->lines + l] = (float)re;
      job->out[(2 * k + 1) * job->lines + l] = (float)im;
    }
}

static void axial(const axial_job *job) {
  SONDE_ASSERT(job->samples > 0 && job->samples <= AXIAL_MOST);
  for (int sample = 0; sample < job->samples; ++sample)
    for (uint32_t l = 0; l < job->lines; ++l) {
      const float *noise = job->noise[sample] + l;
      double re = (double)(job->noise_size * noise[0]);
      double im = (double)(job->noise_size * noise[job->lines]);
      for (int t = 0; t < job->count; ++t)
        for (uint32_t k = 0; k < SONDE_RANK; ++k) {
          const float *row = job->rows[t + sample] + 2 * k * job->lines + l;
          re += (double)job->tap[t][k] * (double)row[0];
          im += (double)job->tap[t][k] * (double)row[job->lines];
        }
      double size = (double)job->compensation[sample] * sqrt(re * re + im * im);
      double db = 20 * log10(fmax(size, 1e-20));
      double grey = (db + (double)job->offset_db) * (double)job->grey_per_db;
      job->envelope[sample][l] = (float)size;
      if (job->grey[sample]) job->grey[sample][l] = (float)fmin(fmax(grey, 0), 255);
    }
}

static void tissue(const tissue_job *job) { sonde_echo_kernels_base.tissue(job); }

static void merge(const merge_job *job) {
  for (uint32_t i = 0; i < SONDE_FINE * job->count; ++i) {
    float *here = job->grid + 2 * (size_t)i, gain = 1;
    uint32_t l = i / 2;
    if (job->top) {
      float even = job->top[l] + job->share * (job->low[l] - job->top[l]);
      float next = job->top[l + 1] + job->share * (job->low[l + 1] - job->top[l + 1]);
      gain = i % 2 ? 0.5f * (even + next) : even;
    }
    job->re[i % 2][l] = gain * here[0];
    job->im[i % 2][l] = gain * here[1];
    here[0] = here[1] = 0;
  }
}

static void widen(const widen_job *job) {
  for (uint32_t l = 0; l < job->lines; ++l) {
    const float *at = job->in + job->column[l];
    job->out[l] = at[0] + job->share[l] * (at[1] - at[0]);
  }
}

static void fade(const fade_job *job) {
  for (uint32_t l = 0; l < job->lines; ++l) {
    double left = pow(10, -fmin((double)job->loss_db[l], 600) / 20);
    double own = (double)job->scatter[l] * left, facets = (double)job->rough[l] * left;
    double power = own * own, tail = (double)job->tail[l];
    job->gain[l] = (float)sqrt(power + facets * facets + (double)job->clutter * tail);
    job->tail[l] = (float)((double)job->kept * (tail + (double)job->fresh * (power - tail)));
  }
}

// Adds a column after some quarter turns.
static void add_turned(double re, double im, int turns, double *x, double *y) {
  const double c = cos(turns * 0.5 * SONDE_PI), s = sin(turns * 0.5 * SONDE_PI);
  *x += re * c - im * s, *y += re * s + im * c;
}

static void look(const look_job *job) {
  for (uint32_t i = 0; i < SONDE_FINE * job->count; ++i) {
    const uint32_t part = i % SONDE_FINE, l = i / SONDE_FINE;
    double re = (double)job->re[part][l], im = (double)job->im[part][l];
    if (job->kept) {
      const double top = (double)job->kept[l], low = (double)job->kept_low[l];
      const double kept = top + (double)job->share * (low - top), lost = sqrt(1 - kept * kept);
      double a = 0, b = 0;
      for (int t = 0; t < HALO_TAPS; ++t) {
        const int64_t at = (int64_t)l + job->halo->offset[t];
        add_turned((double)job->re[part][at], (double)job->im[part][at], halo_turns[t], &a, &b);
      }
      re = kept * re + (double)halo_size * lost * a, im = kept * im + (double)halo_size * lost * b;
    }
    for (int t = 0; job->haze && t < HAZE_TAPS; ++t) {
      const int64_t at = (int64_t)l + job->haze->offset[t];
      const double size = (double)job->haze->size;
      add_turned(size * (double)job->re[part][at], size * (double)job->im[part][at], haze_turns[t],
                 &re, &im);
    }
    const double c = (double)job->ramp_re[part][l], s = (double)job->ramp_im[part][l];
    job->out_re[part][l] = (float)(re * c - im * s);
    job->out_im[part][l] = (float)(im * c + re * s);
  }
}

static void compress(const compress_job *job) {
  for (uint32_t l = 0; l < job->lines; ++l) {
    double mean = 0;
    for (uint32_t k = 0; k < job->looks; ++k) mean += (double)job->look[k][l] / job->looks;
    double db = 20 * log10(fmax(mean, 1e-20));
    job->envelope[l] = (float)mean;
    job->grey[l] =
        (float)fmin(fmax((db + (double)job->offset_db) * (double)job->grey_per_db, 0), 255);
  }
}

static void smooth_lines(const smooth_job *job) {
  for (uint32_t n = job->first; n < job->end; ++n)
    for (int l = 0; l < SMOOTH_LINES; ++l) {
      const double value = (double)job->log[(size_t)n * job->stride + (size_t)l];
      double smooth = 0;
      for (int t = 0; t < SMOOTH_TAPS && job->weight > 0; ++t) {
        const double at = fmin(fmax((double)n + job->row[t], 0), job->samples - 1.0);
        const float *p = job->log + (ptrdiff_t)at * job->stride + job->line[t] + l;
        smooth += (double)smooth_bell[t] *
                  ((double)p[0] + (double)job->next[t] * ((double)p[1] - (double)p[0]));
      }
      job->out[(size_t)(n - job->first) * job->out_stride + (size_t)l] =
          (float)(value + (double)job->weight * (smooth - value));
    }
}

static void show(const show_job *job) {
  for (uint32_t l = 0; l < job->lines; ++l) {
    double value = (double)job->grey[l];
    if (job->sharp > 0) {
      const double top = (double)job->top[l], low = (double)job->low[l];
      value += (double)job->sharp * (value - (top + (double)job->share * (low - top)));
    }
    if (job->keep > 0) {
      const double change = value - (double)job->held[l];
      const double still = fmin(fmax(2 - fabs(change) / 20, 0), 1);
      value = (double)job->held[l] + (1 - (double)job->keep * still) * change;
    }
    if (job->held) job->held[l] = (float)value;
    const double shown = fmin(fmax(value, 0), 255);
    job->grey[l] = job->map[(int)(shown * (double)job->steps / 255 + 0.5)];
  }
}

// Weights of four values at -1, 0, 1 and 2 that make a Catmull-Rom spline at t in [0, 1].
static void cubic_weights(double t, double w[4]) {
  w[0] = 0.5 * t * (-1 + t * (2 - t)), w[1] = 0.5 * (2 + t * t * (-5 + 3 * t));
  w[2] = 0.5 * t * (1 + t * (4 - 3 * t)), w[3] = 0.5 * t * t * (t - 1);
}

static void convert(const convert_job *job) {
  SONDE_ASSERT(job->lines_per_m > 0);
  for (uint32_t c = 0; c < job->width; ++c) {
    double v = (double)job->x + (double)job->dx * c, z = (double)job->z;
    if (job->radius_m > 0) {
      double x = v, from = z + (double)job->radius_m;
      v = (double)job->radius_m * atan2(x, from), z = hypot(x, from) - (double)job->radius_m;
    }
    const double line = v * (double)job->lines_per_m + (double)job->first_line;
    const double sample = z * (double)job->samples_per_m;
    job->out[c] = 0;
    if (!(line >= 0 && line < job->lines - 1.0 && sample >= 0 && sample < job->samples - 1.0))
      continue;
    // Grey value between four samples.
    const size_t l = (size_t)line, n = (size_t)sample;
    const float *p = job->grey + n * job->stride + l, *q = p + job->stride;
    const double a = line - (double)l, b = sample - (double)n;
    if (job->cubic) {
      // Between lines; between samples, below a flat face. Outer lines and samples are repeated.
      double across[4], down[4] = {0, 1 - b, b, 0}, row = 0;
      cubic_weights(a, across);
      if (!(job->radius_m > 0)) cubic_weights(b, down);
      for (int i = 0; i < 4; ++i) {
        int64_t x = (int64_t)l + i - 1;
        double value = 0;
        x = x < 0 ? 0 : x < job->lines ? x : job->lines - 1;
        for (int k = 0; k < 4; ++k) {
          int64_t y = (int64_t)n + k - 1;
          y = y < 0 ? 0 : y < job->samples ? y : job->samples - 1;
          value += down[k] * (double)job->grey[y * job->stride + x];
        }
        row += across[i] * fmin(fmax(value, 0), 255);
      }
      job->out[c] = (uint8_t)(fmin(fmax(row, 0), 255) + 0.5);
      continue;
    }
    job->out[c] = (uint8_t)((1 - b) * ((1 - a) * (double)p[0] + a * (double)p[1]) +
                            b * ((1 - a) * (double)q[0] + a * (double)q[1]) + 0.5);
  }
}

const echo_kernels sonde_echo_kernels_plain = {
    "plain", splat, warp, smooth,  stream, lateral,  axial,        tissue,
    merge,   widen, fade, convert, look,   compress, smooth_lines, show};
