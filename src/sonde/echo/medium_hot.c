// Second stage of a frame: a march along the scan lines through the deformed tissue gives
// backscatter, attenuation, interfaces, the shadow of the bone, and air. Constants and sources:
// docs/echo.md.
#include "base/base.h"
#include "base/random.h"
#include "echo/gates.h"
#include "echo/sound.h"
#include "sonde/tissue_anatomy.h"

#include <string.h>

static const float air_gap_m = 2e-3f;
// Clutter: late echoes, which went back and forth between the layers above, and side lobes. Its
// power over that of the tissue above, and the depth over which it fades.
static const float clutter_power = 0.015f, clutter_m = 5e-3f;

// Echo of an interface at normal incidence over the rms of muscle speckle, and what the passage
// costs beyond, dB. At other angles the beam decides what comes back.
typedef struct interface {
  float db, loss_db;
} interface;
enum { FASCIA = 2, CORTEX = 3, SUPERFICIAL = 4 };
static const interface interfaces[LAYER_LEVELS] = {
    {18, 0},  // skin
    {10, 0},  // dermis and fat
    {21, 0},  // deep fascia
    {36, 55}, // cortex
    {14, 0},  // superficial fascia
};
static const interface vessel_wall[2] = {{14, 0}, {17, 0}}; // vein, artery
// Of the deeper sheets of a fascia and of the outer face of an artery's wall, over the first one.
static const float next_sheet_db = -3;
// Unevenness of interfaces along themselves.
static const float rough_per_m = 750, patch_per_m = 250, spread_per_m = 180, patch_db = 8;
static const interface lesion_edges[SONDE_LESION_KINDS] = {
    {9, 0},  // capsule of a node
    {15, 0}, // cyst
    {3, 0},  // haematoma
};
// Scatterers of the cortex's facets: their echo where it is level over the smooth cortex's, and how
// thick they lie on it.
static const float rough_share = 0.3f, rough_m = 0.4e-3f;
static const float septum_db = 15;    // of the fat's septa
static const float case_db = 10;      // of a clot's level, either way
static const float thigh_lean = 0.1f; // of fibres where no map tells it
static const float periosteum_db = 10;
static const float wall_m[2] = {0.6e-3f, 0.9e-3f}, thin_wall = 0.25f; // of a branch's radius

// Fat around a vessel between muscles, of its radius and at most.
static const float sheath_share = 0.5f, most_sheath_m = 2e-3f;

static const uint32_t lesion_salt = 22; // of the first lesion; far branches have the same ones
enum { CELL_SALT = 97 };
static const float most_cell_db = 1.8f; // between muscles

// Random number in [-1, 1) of a lattice point.
static float knot(int32_t a, int32_t b, uint32_t salt) {
  uint32_t h = (uint32_t)a * 0x9e3779b1u ^ (uint32_t)b * 0x85ebca77u ^ salt * 0xc2b2ae3du;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return (float)((h ^ (h >> 15)) >> 8) * (2.0f / 16777216.0f) - 1;
}

// A field of the plane in this row of the march.
static float field_of(const sonde_echo *echo, uint32_t field, uint32_t l) {
  const float *top = echo->wide[0] + field * echo->padded + l;
  const float *low = echo->wide[1] + field * echo->padded + l;
  return *top + echo->wide_share * (*low - *top);
}

// Value noise in [-1, 1] along a surface, so many cells per metre.
static float roughness(const sonde_echo *echo, uint32_t l, uint32_t salt, float per_m) {
  float r = hypotf(field_of(echo, PLANE_ACROSS, l), field_of(echo, PLANE_UP, l));
  float round = field_of(echo, PLANE_THETA, l) * r;
  float u = round * per_m, v = field_of(echo, PLANE_S, l) * per_m;
  float fu = floorf(u), fv = floorf(v), a = u - fu, b = v - fv;
  int32_t i = (int32_t)fu, j = (int32_t)fv;
  float top = knot(i, j, salt) + a * (knot(i + 1, j, salt) - knot(i, j, salt));
  float low = knot(i, j + 1, salt) + a * (knot(i + 1, j + 1, salt) - knot(i, j + 1, salt));
  return top + b * (low - top);
}

// Layers end at vessels and lesions, lesions at vessels, and branches open into their parents.
static bool is_hidden(const sonde_echo *echo, const float *now, uint32_t l, uint32_t level) {
  if (level == SUPERFICIAL && !(now[FASCIA * echo->padded + l] < 0)) return true;
  const uint32_t n = echo->padded, walls = LAYER_LEVELS, edges = walls + echo->shown_count;
  if (level == 0 || level == CORTEX) return false;
  for (uint32_t k = walls; k < edges; ++k) {
    if (k == level || !(now[k * n + l] < 0)) continue;
    bool femoral = k < walls + 2 && level >= walls && level < walls + 2;
    if (!femoral) return true;
  }
  for (uint32_t k = edges; k < echo->levels && level < walls; ++k)
    if (now[k * n + l] < 0) return true;
  return false;
}

// A sheet that a line crosses a share of the way from the last row to this one, and so much deeper
// on each column to the right.
static void lay(sonde_echo *echo, uint32_t line, uint32_t row, float share, float rise_m,
                float amplitude) {
  float depth_m = ((float)row - 1 + share) * (float)(echo->frame.reach_m / (SONDE_MEDIUM_ROWS - 1));
  if (sonde_sound_on(echo)) {
    depth_m = sonde_sound_depth(echo, line, share, &rise_m);
    amplitude *= sqrtf(echo->sound->spread[line]);
  }
  sonde_sheet_add(echo, line, depth_m, rise_m, amplitude);
}

// A level that changes sign between the last row and this one is an interface, which reflects.
static void add_interfaces(sonde_echo *echo, uint32_t row, const uint16_t *crossed) {
  const uint32_t n = echo->padded, edges = LAYER_LEVELS + echo->shown_count;
  const sonde_lesion *lesion = echo->interior->findings.lesion;
  const float *now = echo->level[row % 2], *before = echo->level[(row + 1) % 2];
  const float dz = (float)(echo->frame.reach_m / (SONDE_MEDIUM_ROWS - 1));
  // The sheets: which level they lie at, and how far beyond its change of sign.
  struct {
    uint32_t level, sheet;
    float beyond_m;
  } sheet[MOST_LEVELS + FASCIA_SHEETS + MOST_VESSELS];
  uint32_t sheets = 0;
  for (uint32_t which = 0; which < echo->levels; ++which) {
    uint32_t count = which == FASCIA && !echo->plain ? FASCIA_SHEETS : 1;
    const bool wall = which >= LAYER_LEVELS && which < edges;
    if (wall && !(echo->gates->vessels >> (which - LAYER_LEVELS) & 1)) continue;
    const sonde_interior *in = echo->interior;
    if (wall && !echo->plain &&
        in->course[echo->shown[which - LAYER_LEVELS]].kind == SONDE_VESSEL_ARTERY)
      count = 2;
    for (uint32_t k = 0; k < count; ++k) {
      sheet[sheets].level = which, sheet[sheets].sheet = k;
      sheet[sheets].beyond_m =
          wall ? (float)k * echo->wall_m[which - LAYER_LEVELS] : fascia_sheet_m[k];
      ++sheets;
    }
  }
  for (uint32_t l = 0; l < echo->lines; ++l) {
    if (!(crossed[l / ECHO_ALIGN] >> l % ECHO_ALIGN & 1) || echo->air[l]) continue;
    for (uint32_t i = 0; i < sheets; ++i) {
      const uint32_t which = sheet[i].level;
      const float *level = now + which * n;
      float beyond = sheet[i].beyond_m;
      // The sheets of a fascia come nearer to each other and go apart.
      if (which == FASCIA && beyond > 0) {
        if (level[l] < 0 || before[which * n + l] > 2 * beyond) continue;
        beyond *= 1 + 0.5f * roughness(echo, l, 64 * (FASCIA_SHEETS + i), spread_per_m);
      }
      const float last = before[which * n + l] - beyond, here = level[l] - beyond;
      if ((last < 0) == (here < 0) || is_hidden(echo, now, l, which)) continue;
      // What reflects, and the salt of its roughness: it stays whatever else is in view.
      const interface *kind = &interfaces[which % LAYER_LEVELS];
      uint32_t salt = which;
      if (which >= edges) {
        const uint32_t number = echo->lesion[which - edges];
        kind = &lesion_edges[lesion[number].kind], salt = lesion_salt + number;
      } else if (which >= LAYER_LEVELS) {
        const uint32_t number = echo->shown[which - LAYER_LEVELS];
        kind = &vessel_wall[echo->interior->course[number].kind], salt = LAYER_LEVELS + number;
      }
      // Where between the rows, and how much deeper from column to column.
      uint32_t left = l > 0 ? l - 1 : l, right = l + 1 < echo->lines ? l + 1 : l;
      float t = last / (last - here), slope = (here - last) / dz;
      float across = (level[right] - level[left]) / (float)(right - left);
      float rise = -across / (SONDE_FINE * (fabsf(slope) > 1e-6f ? slope : 1e-6f));
      float rough = 0;
      if (!echo->plain) {
        // Patches of some millimetres in which a sheet is missing or strong, and finer ones.
        salt += 64 * sheet[i].sheet;
        rough = 4 * roughness(echo, l, salt, rough_per_m);
        if (which != 0 && which != CORTEX)
          rough += patch_db * (roughness(echo, l, salt + 32, patch_per_m) - 0.33f);
        rough += (float)sheet[i].sheet * next_sheet_db;
      }
      float amplitude = echo->coupling[l] * amplitude_of_db(kind->db + rough - echo->loss_db[l]);
      lay(echo, l, row, t, rise, amplitude);
      echo->loss_db[l] += kind->loss_db;
      if (sonde_sound_on(echo))
        echo->loss_db[l] += sonde_sound_passage_db(echo, which, fabsf(slope));
      if (which == CORTEX)
        echo->rough[l] *= amplitude_of_db(kind->loss_db); // facets lie above the loss
    }
  }
}

// The septa of the fat are sheets, too. Half-way between two the distance jumps.
static void add_septa(sonde_echo *echo, uint32_t row, const uint16_t *parted) {
  const float *now = echo->septum[row % 2], *before = echo->septum[(row + 1) % 2];
  const float *size = echo->septum[2];
  const float dz = (float)(echo->frame.reach_m / (SONDE_MEDIUM_ROWS - 1));
  const uint32_t n = echo->padded, edges = LAYER_LEVELS + echo->shown_count;
  for (uint32_t l = 0; l < echo->lines; ++l) {
    const float last = before[l], here = now[l], step = here - last;
    if (!(parted[l / ECHO_ALIGN] >> l % ECHO_ALIGN & 1) || fabsf(step) > 0.8e-3f || echo->air[l])
      continue;
    bool hidden = false;
    for (uint32_t k = LAYER_LEVELS; k < edges; ++k)
      hidden = hidden || echo->level[row % 2][k * n + l] < 0;
    if (hidden) continue;
    const uint32_t left = l > 0 ? l - 1 : l, right = l + 1 < echo->lines ? l + 1 : l;
    float across = (now[right] - now[left]) / (float)(right - left);
    if (fabsf(across) > 0.4e-3f) continue; // jumps
    const float slope = step / dz;
    const float rise = -across / (SONDE_FINE * (fabsf(slope) > 1e-6f ? slope : 1e-6f));
    const float amplitude =
        echo->coupling[l] * size[l] * amplitude_of_db(septum_db - echo->loss_db[l]);
    lay(echo, l, row, last / (last - here), rise, amplitude);
  }
}

// The aperture looks past small obstacles: what a line has lost, and what reverberates in it, mixes
// with its neighbours'. Lines in air send nothing and take no part.
static void blur(const sonde_echo *echo, float *value) {
  const uint8_t *air = echo->air;
  float out[SONDE_MOST_LINES];
  uint32_t last = echo->lines - 1;
  SONDE_ASSERT(value != NULL && last >= 1 && last < SONDE_MOST_LINES);
  if (!echo->some_air) {
    for (uint32_t l = 1; l < last; ++l)
      out[l] = value[l] + 0.15f * (value[l - 1] - 2 * value[l] + value[l + 1]);
  } else {
    for (uint32_t l = 1; l < last; ++l) {
      float here = value[l], left = air[l - 1] ? here : value[l - 1];
      float right = air[l + 1] ? here : value[l + 1];
      out[l] = here + 0.15f * (left - 2 * here + right);
    }
  }
  memcpy(value + 1, out + 1, (last - 1) * sizeof *value);
}

// Beside the outer lines those go on.
static void store_gain(sonde_echo *echo, uint32_t row) {
  const bool own_speeds = sonde_sound_on(echo);
  const uint32_t first = echo->pad_lines / SONDE_FINE, last = first + echo->lines - 1;
  float *gain = echo->gain + (size_t)row * echo->gain_stride;
  SONDE_ASSERT(first + echo->padded <= echo->gain_stride);
  const float dz = (float)(echo->frame.reach_m / (SONDE_MEDIUM_ROWS - 1));
  const fade_job job = {
      .scatter = echo->scatter,
      .rough = echo->rough,
      .loss_db = echo->loss_db,
      .tail = echo->tail,
      .gain = own_speeds ? echo->sound->gain[row % 2] : gain + first,
      .clutter = echo->plain ? 0 : clutter_power,
      .fresh = 1 - expf(-dz / clutter_m),
      .kept =
          expf(-0.2302585f * dz * (float)sonde_echo_default_tgc_db_per_m(echo->frame.frequency_hz)),
      .lines = echo->padded};
  echo->kernels->fade(&job);
  const bool drawn = row + 1 == SONDE_MEDIUM_ROWS;
  if (own_speeds) sonde_sound_draw_gain(echo, row);
  for (uint32_t k = own_speeds ? 0 : row; k <= row && (drawn || !own_speeds); ++k) {
    gain = echo->gain + (size_t)k * echo->gain_stride;
    for (uint32_t l = 0; l < first; ++l) gain[l] = gain[first];
    for (uint32_t l = last + 1; l < echo->gain_stride; ++l) gain[l] = gain[last];
  }
}

// What a model's tissue map has in view: bodies and muscles.
static void describe_map(const sonde_echo *echo, tissue_job *job) {
  const struct sonde_tissue_map *map = echo->interior->model->map;
  SONDE_ASSERT(echo->cell_count <= MOST_CELLS && echo->body_count <= MOST_BODIES);
  const sonde_vec3 look = sonde_echo_middle(&echo->frame);
  const sonde_vec3 beam = q_rotate(echo->frame.probe.rotation, vec3(0, 0, 1));
  job->bodies = map != NULL ? echo->body_count : 0;
  for (uint32_t k = 0; k < job->bodies; ++k) {
    const sonde_map_body body = map->body(map->self, echo->body[k], look);
    const double along = v_dot(body.axis, beam), length = body.half_m.z > 0 ? body.half_m.z : 1;
    job->body[k] = (tissue_body){body.tissue,
                                 {(float)body.half_m.x, (float)body.half_m.y, (float)length},
                                 (float)sqrt(fmax(1 - along * along, 0))};
  }
  // Muscles: their fibres lean against the skin, and each has a brightness of its own.
  memset(job->fact, 0, sizeof job->fact);
  job->fact[CELL_LEAN][0] = thigh_lean;
  job->cells = map != NULL ? echo->cell_count : 0;
  if (job->cells > 0) {
    const double flat = fmax(hypot(beam.x, beam.y), 0.1);
    double power[MOST_CELLS];
    sonde_vec3 at[MOST_CELLS];
    map->powers(map->self, look, job->cells, echo->cell, power, at);
    job->beam_x = (float)(beam.x / flat), job->beam_y = (float)(beam.y / flat);
    for (uint32_t k = 0; k < job->cells; ++k) {
      const sonde_map_seed seed = map->seed(map->self, echo->cell[k], look);
      const float own = knot((int32_t)seed.cell, 0, CELL_SALT);
      job->cell[k] = (tissue_cell){.x_mm = (float)(1e3 * at[k].x),
                                   .y_mm = (float)(1e3 * at[k].y),
                                   .cell = (float)seed.cell,
                                   .section = (float)seed.section};
      // Each cell starts elsewhere in the tile.
      for (int c = 0; c < 3; ++c)
        job->fact[CELL_SHIFT + c][k] = 32 * (1 + knot((int32_t)seed.cell, c + 1, CELL_SALT));
      job->fact[CELL_MUSCLE][k] = seed.muscle ? 1 : 0;
      job->fact[CELL_GAIN][k] = amplitude_of_db(most_cell_db * own);
      job->fact[CELL_LEAN][k] = (float)seed.lean;
    }
  }
}

// Materials of what is in view.
static void describe_tissue(sonde_echo *echo, tissue_job *job) {
  const sonde_interior *in = echo->interior;
  job->vessels = echo->shown_count, job->lesions = echo->lesion_count;
  job->webs = (float)in->findings.webs, job->oedema = (float)in->findings.oedema;
  // A fresh clot (echogenicity 0.25) scatters as blood does, with faint lines of Zahn; old ones are
  // brighter in the mean, with lumps and layers, but each case draws its own level, so that the
  // brightness does not tell the age.
  const float fresh = 0.25f, fresh_db = -24.4f, db_per_echogenicity = 20;
  for (uint32_t k = 0; k < job->vessels; ++k) {
    const uint32_t which = echo->shown[k];
    const sonde_pathology *p = sonde_echo_pathology(echo, which);
    float wall = wall_m[in->course[which].kind];
    const float radius = (float)in->section[which][0].radius_m;
    if (which >= 2) wall = fminf(wall, thin_wall * radius);
    echo->wall_m[k] = wall;
    float more = (float)p->echogenicity - fresh, age = fminf(fmaxf(more / 0.7f, 0), 1);
    const float drawn = case_db * sqrtf(age) * knot((int32_t)echo->seed, (int32_t)which, CELL_SALT);
    bool vein = in->course[which].kind == SONDE_VESSEL_VEIN;
    job->vessel[k] = (tissue_vessel){
        .wall_m = wall,
        .sheath_m = echo->plain ? 0 : fminf(sheath_share * radius, most_sheath_m),
        .clot_fraction = vein ? (float)p->thrombus_fraction : 0,
        .clot_scatter = amplitude_of_db(fresh_db + db_per_echogenicity * more + drawn),
        .clot_loss = 18 + 40 * age,
        .lumps_db = 1.5f + 4 * age,
        .layers_db = 2.5f + 5.5f * age,
        .number = which,
        .form = p->form,
        .cusp_bend = (float)echo->moves[k].shut};
  }
  for (uint32_t k = 0; k < job->lesions; ++k) {
    const sonde_lesion *l = &in->findings.lesion[echo->lesion[k]];
    job->lesion[k] = (tissue_lesion){
        (tissue_lesion_kind)l->kind,
        {(float)(1 / l->half_m.x), (float)(1 / l->half_m.y), (float)(1 / l->half_m.z)},
        (float)l->echogenicity};
  }
  describe_map(echo, job);
  // Facets of the cortex lie thinner than the pulse is long, which they fill only in part. The
  // energy of a tent is two thirds of its height's over its half width; that of the pulse is 0.83
  // wavelengths of its peak's.
  const float row_m = (float)(echo->frame.reach_m / (SONDE_MEDIUM_ROWS - 1));
  job->rough_m = fmaxf(rough_m, row_m);
  float filled = 0.83f * (float)echo->frame.wavelength_m / (job->rough_m * 2 / 3);
  job->rough_bone = echo->plain ? 0 : rough_share * amplitude_of_db(interfaces[CORTEX].db);
  job->rough_bone *= sqrtf(1 + filled);
  job->periosteum = echo->plain ? 0 : amplitude_of_db(periosteum_db);
}

// Fields of a row of the march, per line: between two coarse rows, which are widened to the lines
// when the march reaches them; to rays that bend as they are there, on to where they lead. Of
// vessels, cells and bodies only what can matter there.
static void find_fields(sonde_echo *echo, const tissue_job *job, uint32_t row) {
  const uint32_t last = echo->plane_rows - 2;
  const float y = (float)(row * (last + 1)) / (SONDE_MEDIUM_ROWS - 1);
  const uint32_t j = (uint32_t)y < last ? (uint32_t)y : last;
  sonde_gates *g = echo->gates;
  echo->wide_share = y - (float)j;
  if (row > 0 && j == g->row) return;
  g->row = j;
  for (uint32_t k = 0; k < 2 && (row == 0 || sonde_sound_on(echo)); ++k)
    sonde_sound_aim(echo, k, ((float)(j + k) - y) * (SONDE_MEDIUM_ROWS - 1) / (float)(last + 1));
  sonde_gates_find(echo, job, j);
  const uint32_t cells = map_field_at(job->vessels, job->lesions, 1), bodies = cells + job->cells;
  for (uint32_t field = 0; field < echo->fields; ++field) {
    bool wanted = true;
    if (field >= bodies && job->cells > 0)
      wanted = g->bodies >> ((field - bodies) / BODY_FIELDS) & 1;
    else if (field >= cells && job->cells > 0)
      wanted = g->cells >> (field - cells) & 1;
    else if (field >= PLANE_LAYERS && field < lesion_field_at(job->vessels, 0, 0))
      wanted = g->vessels >> ((field - PLANE_LAYERS) / VESSEL_FIELDS) & 1;
    for (uint32_t k = 0; k < 2 && wanted; ++k) {
      const widen_job widen = {.in = echo->plane + field * SONDE_PLANE_NODES +
                                     (j + k) * SONDE_PLANE_COLUMNS,
                               .column = g->column[k],
                               .share = g->share[k],
                               .out = echo->wide[k] + field * echo->padded,
                               .lines = echo->padded};
      echo->kernels->widen(&widen);
    }
  }
}

void sonde_echo_medium(sonde_echo *echo) {
  const frame *f = &echo->frame;
  SONDE_ASSERT(f->pathology != NULL && echo->padded % ECHO_ALIGN == 0);
  uint32_t lines = echo->padded;
  float step = (float)(2 * f->reach_m / (SONDE_MEDIUM_ROWS - 1) * f->frequency_hz * 1e-6);
  uint16_t crossed[SONDE_MOST_LINES / ECHO_ALIGN], parted[SONDE_MOST_LINES / ECHO_ALIGN];
  tissue_job job = {.top = echo->wide[0],
                    .low = echo->wide[1],
                    .gate = echo->gates->block,
                    .lines = lines,
                    .bone_radius_m = (float)echo->interior->bone_radius_m,
                    .plain = echo->plain,
                    .memory = echo->knots,
                    .tile = {echo->tile[0], echo->tile[1]},
                    .scatter = echo->scatter,
                    .loss = echo->loss,
                    .rough = echo->rough,
                    .septum_size = echo->septum[2],
                    .crossed = crossed,
                    .parted = parted};
  describe_tissue(echo, &job);
  memset(echo->loss_db, 0, lines * sizeof *echo->loss_db);
  memset(echo->tail, 0, lines * sizeof *echo->tail);
  sonde_sheet_begin(echo);
  echo->some_air = false;
  sonde_sound_begin(echo);
  for (uint32_t row = 0; row < SONDE_MEDIUM_ROWS; ++row) {
    find_fields(echo, &job, row);
    job.share = echo->wide_share;
    job.septum = echo->septum[row % 2], job.septum_before = echo->septum[(row + 1) % 2];
    job.level = echo->level[row % 2], job.before = echo->level[(row + 1) % 2];
    echo->kernels->tissue(&job);
    job.rows_per_m = (float)((SONDE_MEDIUM_ROWS - 1) / f->reach_m);
    // Lines whose face does not touch the skin. A face reverberates: bands at multiples of its own
    // thickness, fading, as loud as what does not couple in.
    for (uint32_t l = 0; row == 0 && l < lines; ++l) {
      echo->air[l] = field_of(echo, PLANE_DEPTH, l) < -air_gap_m;
      echo->some_air = echo->some_air || echo->air[l];
      const float loudness = echo->air[l] ? 1 : 1 - echo->coupling[l];
      for (int k = 0; k < 6 && l < echo->lines; ++k)
        sonde_sheet_add(echo, l, 0.4e-3f + 1.3e-3f * (float)k, 0,
                        loudness * 6.0f * exp2f(-1.4f * (float)k));
    }
    blur(echo, echo->loss_db);
    blur(echo, echo->tail);
    if (sonde_sound_on(echo)) sonde_sound_step(echo, row);
    if (row > 0) add_interfaces(echo, row, crossed);
    if (row > 0 && !echo->plain) add_septa(echo, row, parted);
    for (uint32_t l = 0; l < lines && echo->some_air; ++l)
      if (echo->air[l]) echo->scatter[l] = echo->rough[l] = 0;
    for (uint32_t l = 0; l < lines; ++l) {
      const float passed = echo->coupling[l] * echo->sound->spread[l];
      echo->scatter[l] *= passed, echo->rough[l] *= passed;
    }
    store_gain(echo, row);
    for (uint32_t l = 0; l < lines; ++l) echo->loss_db[l] += echo->loss[l] * step;
  }
  if (!sonde_sound_on(echo)) return;
  sonde_sound_end(echo);
  if (!echo->bare) sonde_aberration_find(echo);
}
