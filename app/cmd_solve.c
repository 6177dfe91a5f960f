// sonde solve: the converged press of a probe on the hyperelastic solid of a model, or of a block.
#include "options.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

static const char VERB[] = "solve";
static const double RAD_PER_DEGREE = 3.14159265358979323846 / 180;
enum { DEPTHS_MOST = 64, POINTS_MOST = 64 };

typedef struct options {
  const char *model, *probe, *csv, *moduli, *deck;
  long site;
  double block[3]; // m below, NaN: a model
  double depth_m[DEPTHS_MOST];
  uint32_t depth_count;
  sonde_vec3 point_m[POINTS_MOST];
  uint32_t point_count;
  double layer[SONDE_SOLID_LAYERS][2]; // shear modulus, kPa, and exponent
  double bulk_ratio;
  double tilt_rad, roll_rad, offset_mm[2];
  uint32_t through[3];
  double through_layers[3];
  int contact;
  sonde_strain_energy energy;
  sonde_equilibrium_def def;
  sonde_hexes_def mesh;
  bool json;
} options;

static void prepare(void *to) {
  options *o = to;
  o->probe = "linear";
  o->site = -1;
  o->block[0] = o->block[1] = o->block[2] = NAN;
  o->bulk_ratio = 24;
  o->def = sonde_equilibrium_def_default();
  o->mesh = sonde_hexes_def_default();
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    o->layer[k][0] = 1e-3 * o->def.layer[k].shear_pa;
    o->layer[k][1] = o->def.layer[k].exponent;
  }
  o->through_layers[0] = o->mesh.muscle, o->through_layers[1] = o->mesh.fat;
  o->through_layers[2] = o->mesh.skin;
}

// Numbers between commas; false after saying what is wrong.
static bool read_list(const char *option, const char *text, double low, double high, double *list,
                      uint32_t most, uint32_t *count) {
  *count = app_read_numbers(text, low, high, list, most);
  if (*count > 0) return true;
  app_usage_error(VERB, "%s \"%s\": expected at most %u numbers from %g to %g with commas between",
                  option, text, most, low, high);
  return false;
}

static bool read_depths(void *to, const char *text) {
  options *o = to;
  if (!read_list("--depths", text, -10, 60, o->depth_m, DEPTHS_MOST, &o->depth_count)) return false;
  for (uint32_t k = 0; k < o->depth_count; ++k) o->depth_m[k] *= 1e-3;
  return true;
}

static bool read_point(void *to, const char *text) {
  options *o = to;
  assert(o->point_count <= POINTS_MOST);
  double x[3];
  uint32_t count;
  if (!read_list("--point", text, -2000, 2000, x, 3, &count)) return false;
  if (count != 3 || o->point_count == POINTS_MOST) {
    app_usage_error(VERB, "--point \"%s\": expected X,Y,Z, at most %d times", text, POINTS_MOST);
    return false;
  }
  o->point_m[o->point_count++] = (sonde_vec3){1e-3 * x[0], 1e-3 * x[1], 1e-3 * x[2]};
  return true;
}

static const char *const CONTACTS[] = {"slip", "bonded", NULL};
static const char *const ENERGIES[] = {SONDE_STRAIN_ENERGY_NAMES, NULL};

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_INTEGER(site, "site", "K", 0, 1000000, "number of the site of the model to press at"),
    OPT_NUMBERS(block, "block", "D:S:F", 0, 1000,
                "no model: a block of D mm with S mm of skin over F mm of fat over muscle"),
    OPT_TEXT(probe, "probe", "NAME|FILE",
             "point, linear, square, sphere, rect:AxB, ball:R, or a mesh file in mm; default "
             "linear"),
    OPT_REAL(def.rounding_m, "rounding-mm", "R", 0, 50, 1e-3,
             "round the probe by R: its tip stays where it is, its sides grow by R"),
    OPT_WORD(contact, "contact", "KIND", CONTACTS,
             "slip: the skin slides on the probe; bonded: the skin under the footprint moves with "
             "it"),
    OPT_REAL(def.friction, "friction", "MU", 0, 10, 1,
             "coefficient of Coulomb's friction of skin that slides; default 0"),
    OPT_CALL(read_depths, "depths", "LIST",
             "depths in mm with commas between, in their order: with friction it counts"),
    OPT_REAL(tilt_rad, "tilt-deg", "T", -60, 60, RAD_PER_DEGREE, "turn the probe about its y axis"),
    OPT_REAL(roll_rad, "roll-deg", "T", -60, 60, RAD_PER_DEGREE, "turn the probe about its x axis"),
    OPT_NUMBERS(offset_mm, "offset-mm", "U:V", -100, 100, "shift the probe along the site's axes"),
    OPT_CALL(read_point, "point", "X,Y,Z",
             "also tell the displacement of this point at rest (mm); up to 64 times"),
    OPT_OUTPUT(csv, "csv", "CSV", "write one row per depth, and one per point and depth"),
    OPT_OUTPUT(deck, "deck", "INP",
               "write the last depth of a bonded press as a deck of CalculiX, for comparison"),
    OPT_JSON(json),
    OPT_GROUP("Materials"),
    OPT_TEXT(moduli, "moduli", "FILE", "table of all materials that sonde fit --solid has written"),
    OPT_WORD(energy, "energy", "LAW", ENERGIES, "strain energy of all layers"),
    OPT_NUMBERS(layer[SONDE_SOLID_MUSCLE], "muscle", "MU:A", -1e4, 1e4,
                "shear modulus in kPa and exponent of the muscle"),
    OPT_NUMBERS(layer[SONDE_SOLID_FAT], "fat", "MU:A", -1e4, 1e4, "the same of the fat"),
    OPT_NUMBERS(layer[SONDE_SOLID_SKIN], "skin", "MU:A", -1e4, 1e4, "the same of the skin"),
    OPT_REAL(bulk_ratio, "bulk-ratio", "K", 2, 1e5, 1, "bulk over shear modulus; default 24"),
    OPT_GROUP("Mesh and solution"),
    OPT_REAL(mesh.edge_m, "edge-mm", "E", 0.1, 50, 1e-3, "of the skin's faces under the probe"),
    OPT_REAL(mesh.growth, "growth", "G", 1.05, 3, 1, "from face to face away from the probe"),
    OPT_REAL(mesh.reach_m, "reach-mm", "R", 10, 2000, 1e-3,
             "of the mesh along the leg, or half the side of the block"),
    OPT_NUMBERS(through_layers, "through", "M:F:S", 0, 20,
                "hexahedra through muscle, fat and skin; default 4:2:1"),
    OPT_REAL(def.zone_m, "zone-mm", "Z", 1, 200, 1e-3,
             "skin that may touch: this far around the footprint"),
    OPT_REAL(def.contact_n_m3, "contact-kpa-mm", "K", 1, 1e7, 1e6,
             "pressure of the contact per mm of skin in the probe; default 1000"),
    OPT_REAL(def.step_m, "step-mm", "S", 0.01, 100, 1e-3, "longest step of the probe"),
    OPT_REAL(def.tolerance, "residual", "R", 1e-12, 0.01, 1,
             "relative residual of the equilibrium"),
};

static int check(void *from) {
  options *o = from;
  const bool block = !isnan(o->block[0]);
  if (block && (o->site >= 0 || app_option_given("MODEL")))
    return app_usage_error(VERB, "--block takes no model and no --site");
  if (!block && o->site < 0) return app_usage_error(VERB, "--site or --block is missing");
  static const char *const TOLD[] = {"muscle", "fat", "skin", "energy", "bulk-ratio"};
  for (size_t k = 0; k < sizeof TOLD / sizeof *TOLD && o->moduli; ++k)
    if (app_option_given(TOLD[k]))
      return app_usage_error(VERB, "--moduli goes without --%s", TOLD[k]);
  o->def.bonded = o->contact == 1;
  if (o->def.bonded && o->def.friction > 0)
    return app_usage_error(VERB, "--friction goes with --contact slip");
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k)
    o->def.layer[k] = (sonde_hyperelastic){o->energy, 1e3 * o->layer[k][0], o->layer[k][1],
                                           1e3 * o->bulk_ratio * o->layer[k][0]};
  o->mesh.muscle = (uint32_t)o->through_layers[0];
  o->mesh.fat = (uint32_t)o->through_layers[1];
  o->mesh.skin = (uint32_t)o->through_layers[2];
  return APP_OK;
}

typedef struct solved {
  sonde_equilibrium_result result;
  double along_n, lost_j, seconds; // force along the way; to friction so far; of work
  sonde_vec3 moved_m[POINTS_MOST];
} solved;

typedef struct work {
  sonde_model *model;
  sonde_probe probe;
  sonde_hexes mesh;
  sonde_equilibrium *equilibrium;
  sonde_pose start; // at rest; its z axis before tilting is the way
  sonde_vec3 way;
  uint32_t done, unknowns, zone_unknowns;
  solved row[DEPTHS_MOST];
} work;

static sonde_status open_solid(work *w, options *o, sonde_error *error) {
  assert(o->depth_count > 0);
  static const sonde_site middle = {.normal = {0, 0, 1}, .u = {1, 0, 0}, .v = {0, 1, 0}};
  const sonde_site *site = &middle;
  sonde_status status = sonde_probe_create(o->probe, &w->probe, error);
  if (!status && o->moduli) status = sonde_moduli_load(o->moduli, o->def.layer, error);
  if (status) return status;
  o->mesh.half_u_m = w->probe.half_x_m, o->mesh.half_v_m = w->probe.half_y_m;
  if (!isnan(o->block[0])) {
    status = sonde_hexes_block(1e-3 * o->block[0], 1e-3 * o->block[1], 1e-3 * o->block[2], &o->mesh,
                               &w->mesh, error);
  } else {
    status = sonde_limb_model_load(o->model, &w->model, error);
    if (status) return status;
    site = sonde_model_site(w->model, (uint32_t)o->site);
    if (!site)
      return app_error(error, SONDE_NOT_FOUND, "%.400s: no site %ld, the model has %u sites",
                       o->model, o->site, w->model->site_count);
    status = sonde_hexes_ring(w->model, site, &o->mesh, &w->mesh, error);
  }
  if (status) return status;
  w->start = sonde_site_pose(site, 0);
  w->way = pose_axis(w->start, 2);
  w->start = pose_shift(w->start, 1e-3 * o->offset_mm[0], site->u);
  w->start = pose_shift(w->start, 1e-3 * o->offset_mm[1], site->v);
  w->start = pose_turn(w->start, 1, o->tilt_rad);
  w->start = pose_turn(w->start, 0, o->roll_rad);
  status = sonde_equilibrium_create(&w->mesh, &w->probe, w->start, &o->def, &w->equilibrium, error);
  if (!status) sonde_equilibrium_size(w->equilibrium, &w->unknowns, &w->zone_unknowns);
  return status;
}

static sonde_status solve_depths(work *w, const options *o, sonde_error *error) {
  assert(w->equilibrium != NULL && w->done == 0);
  const sonde_progress progress = app_progress();
  sonde_status status = SONDE_OK;
  for (uint32_t k = 0; k < o->depth_count && !status; ++k) {
    char what[48];
    snprintf(what, sizeof what, "%.4g mm, %u unknowns", 1e3 * o->depth_m[k], w->unknowns);
    if (!progress.report((double)k / o->depth_count, what, progress.user))
      return app_error(error, SONDE_CANCELLED, "cancelled at %.4g mm", 1e3 * o->depth_m[k]);
    solved *s = &w->row[k];
    const double before = app_seconds(CLOCK_MONOTONIC);
    status = sonde_equilibrium_find(w->equilibrium, pose_shift(w->start, o->depth_m[k], w->way),
                                    &s->result, error);
    s->seconds = app_seconds(CLOCK_MONOTONIC) - before;
    s->along_n = -vec_dot(s->result.force_n, w->way);
    s->lost_j = s->result.slipped_j + (k > 0 ? w->row[k - 1].lost_j : 0);
    for (uint32_t p = 0; p < o->point_count && !status; ++p)
      if (!sonde_equilibrium_at(w->equilibrium, o->point_m[p], &s->moved_m[p]))
        status = app_error(error, SONDE_ARGUMENT, "point %g,%g,%g mm is not in the solid",
                           1e3 * o->point_m[p].x, 1e3 * o->point_m[p].y, 1e3 * o->point_m[p].z);
    w->done += !status;
  }
  return status;
}

static sonde_status write_csv(const work *w, const options *o, sonde_error *error) {
  assert(o->csv != NULL && w->done <= o->depth_count);
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(o->csv, &file, error);
  if (status) return status;
  sonde_file_printf(file, "depth_mm,force_n,work_mj,area_mm2,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm\n");
  for (uint32_t k = 0; k < w->done; ++k) {
    const solved *s = &w->row[k];
    const sonde_equilibrium_result *r = &s->result;
    sonde_file_printf(file, "%.6g,%.7g,%.7g,%.5g,,,,,,\n", 1e3 * o->depth_m[k], s->along_n,
                      1e3 * (r->tissue_j + r->contact_j + s->lost_j), 1e6 * r->area_m2);
    for (uint32_t p = 0; p < o->point_count; ++p)
      sonde_file_printf(file, "%.6g,,,,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", 1e3 * o->depth_m[k],
                        1e3 * o->point_m[p].x, 1e3 * o->point_m[p].y, 1e3 * o->point_m[p].z,
                        1e3 * s->moved_m[p].x, 1e3 * s->moved_m[p].y, 1e3 * s->moved_m[p].z);
  }
  return sonde_file_commit(file, error);
}

// What was solved: a table, or one object.
static void print(const work *w, const options *o) {
  if (!o->json) {
    printf("probe %s, %s, friction %g, %s, %u unknowns, %u of skin that may touch\n", w->probe.name,
           CONTACTS[o->contact], o->def.friction, ENERGIES[o->energy], w->unknowns,
           w->zone_unknowns);
    printf("depth mm    force N    work mJ   area mm2   residual  steps  time s\n");
    for (uint32_t k = 0; k < w->done; ++k) {
      const solved *s = &w->row[k];
      const sonde_equilibrium_result *r = &s->result;
      printf("%8.2f %10.4f %10.4f %10.1f    %.1e  %5u  %6.1f\n", 1e3 * o->depth_m[k], s->along_n,
             1e3 * (r->tissue_j + r->contact_j + s->lost_j), 1e6 * r->area_m2, r->residual,
             r->steps, s->seconds);
      for (uint32_t p = 0; p < o->point_count; ++p)
        printf("         point %.2f,%.2f,%.2f moves by %.3f,%.3f,%.3f mm\n", 1e3 * o->point_m[p].x,
               1e3 * o->point_m[p].y, 1e3 * o->point_m[p].z, 1e3 * s->moved_m[p].x,
               1e3 * s->moved_m[p].y, 1e3 * s->moved_m[p].z);
    }
    return;
  }
  app_json_begin();
  app_json("probe:%s contact:%s friction:%g energy:%s unknowns:%u contact_unknowns:%u",
           w->probe.name, CONTACTS[o->contact], o->def.friction, ENERGIES[o->energy], w->unknowns,
           w->zone_unknowns);
  app_json_array("depths");
  for (uint32_t k = 0; k < w->done; ++k) {
    const solved *s = &w->row[k];
    const sonde_equilibrium_result *r = &s->result;
    app_json_object(NULL);
    app_json("depth_mm:%g force_n:%g work_mj:%g contact_mj:%g lost_mj:%g area_mm2:%g",
             1e3 * o->depth_m[k], s->along_n, 1e3 * (r->tissue_j + r->contact_j + s->lost_j),
             1e3 * r->contact_j, 1e3 * s->lost_j, 1e6 * r->area_m2);
    app_json("fx_n:%g fy_n:%g fz_n:%g tx_nmm:%g ty_nmm:%g tz_nmm:%g", r->force_n.x, r->force_n.y,
             r->force_n.z, 1e3 * r->torque_nm.x, 1e3 * r->torque_nm.y, 1e3 * r->torque_nm.z);
    app_json("deepest_mm:%g residual:%g steps:%u inner_steps:%u shifts:%u seconds:%g",
             1e3 * r->deepest_m, r->residual, r->steps, r->inner_steps, r->shifts, s->seconds);
    app_json_array("points");
    for (uint32_t p = 0; p < o->point_count; ++p) {
      app_json_object(NULL);
      app_json("x_mm:%g y_mm:%g z_mm:%g ux_mm:%g uy_mm:%g uz_mm:%g", 1e3 * o->point_m[p].x,
               1e3 * o->point_m[p].y, 1e3 * o->point_m[p].z, 1e3 * s->moved_m[p].x,
               1e3 * s->moved_m[p].y, 1e3 * s->moved_m[p].z);
      app_json_close();
    }
    app_json_close();
    app_json_close();
  }
  app_json_close();
  app_json_end();
}

static int run(void *from) {
  static work w;
  options *o = from;
  sonde_error error = {0}, other;
  app_progress_begin("solving");
  sonde_status status = open_solid(&w, o, &error);
  if (!status) status = solve_depths(&w, o, &error);
  app_progress_end();
  if (!status && o->deck) status = sonde_equilibrium_export(w.equilibrium, o->deck, &error);
  // What was solved before a failure is told too.
  if (w.done > 0) {
    if (o->csv && write_csv(&w, o, status ? &other : &error) && !status) status = error.status;
    print(&w, o);
  }
  sonde_equilibrium_destroy(w.equilibrium);
  sonde_hexes_clear(&w.mesh);
  sonde_probe_clear(&w.probe);
  sonde_model_destroy(w.model);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_solve = {
    .verb = "solve",
    .summary = "press a probe on a hyperelastic solid until it converges",
    .usage = "[MODEL] --site K --depths LIST [options]\n--block D:S:F --depths LIST [options]",
    .text = "Makes a mesh of hexahedra of skin, fat and muscle on the bone, presses a probe on it "
            "and solves to equilibrium: force and work per depth, without friction whatever the "
            "path. The solid's moduli are those of the options; the model's springs play no part.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .required = "depths",
    .check = check,
    .run = run};
