// sonde press: settles a probe at a site to a force or a depth and reports what is felt and seen.
#include "options.h"
#include "press_solid.h"
#include "settled.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

static const double CUFF_MOST_PA = 300 * SONDE_PA_PER_MMHG, CLOSED = 0.05, CUFF_LIFT_M = 0.005;

typedef struct options {
  const char *model, *probe, *pathology, *image, *preset, *station;
  long site;               // -1: at the station
  double force_n, depth_m; // NaN when not asked for, as all below
  double cuff_pa, vein_depth_m, venous_pa, thrombus_pa, wall_pa, sheath;
  const char *moduli;
  double friction; // of the solid's skin; NaN: none
  bool solid, json;
} options;

static const options DEFAULTS = {.site = -1,
                                 .probe = "linear",
                                 .pathology = "healthy",
                                 .force_n = NAN,
                                 .depth_m = NAN,
                                 .cuff_pa = NAN,
                                 .vein_depth_m = NAN,
                                 .venous_pa = NAN,
                                 .thrombus_pa = NAN,
                                 .wall_pa = NAN,
                                 .sheath = NAN};

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_TEXT(station, "station", "NAME",
             "where to press: a station of the model, such as popliteal; default its first one"),
    OPT_INTEGER(site, "site", "K", 0, 1000000, "at the site of this number instead"),
    OPT_TEXT(probe, "probe", "NAME|FILE",
             "point, linear, square, sphere, or a mesh file in millimetres"),
    OPT_REAL(force_n, "force-n", "F", 0.01, 200, 1, "press until the settled force is F newtons"),
    OPT_REAL(depth_m, "depth-mm", "D", -10, 60, 1e-3, "press D millimetres below the rest skin"),
    OPT_REAL(cuff_pa, "cuff-mmhg", "P", 0, 300, SONDE_PA_PER_MMHG,
             "no probe: a cuff around the leg presses P on every vessel; also finds the pressure "
             "that closes the vein to 5 % of its area at rest"),
    OPT_TEXT(pathology, "case", "NAME", APP_CASES),
    OPT_REAL(vein_depth_m, "vein-depth-mm", "D", 8, 50, 1e-3,
             "put the vein D below the site along its whole course, the artery 11 mm beside it"),
    OPT_REAL(venous_pa, "venous-mmhg", "P", 0, 80, SONDE_PA_PER_MMHG,
             "pressure in the vein; default 10"),
    OPT_REAL(thrombus_pa, "thrombus-kpa", "MU", 0.5, 100, 1e3,
             "fill the vein with a clot of this shear modulus"),
    OPT_REAL(wall_pa, "wall-kpa", "W", 10, 300, 1e3,
             "shear modulus of the vein's wall; default 30"),
    OPT_REAL(sheath, "sheath", "S", 0, 1, 1,
             "how firmly the sheath ties the vessels' walls to the muscle: 0 loose, 1 glued"),
    OPT_TEXT(preset, "preset", "FILE",
             "damping, stiffness and friction, see sonde-identify(1); a settled probe feels the "
             "stiffness only"),
    OPT_FLAG(
        solid, "solid",
        "press the hyperelastic solid instead of the springs, to equilibrium; its displacement and "
        "stress move the inside; also tells work and area of contact"),
    OPT_TEXT(
        moduli, "moduli", "FILE",
        "materials of the solid, as sonde fit --solid writes them; default those of the study"),
    OPT_REAL(friction, "friction", "MU", 0, 10, 1,
             "coefficient of Coulomb's friction between the solid's skin and the probe; default 0"),
    OPT_OUTPUT(image, "image", "PNG",
               "write the echographic image of the settled state, 512 x 512 pixels"),
    OPT_JSON(json)};

typedef struct press {
  settled scene;
  press_solid solid;
  sonde_pose start; // at rest on the site or station
  char at[64];      // what it is called
  sonde_pathology pathology;
  double vein_depth_m;          // NaN: where the model has it
  double closes_pa;             // cuff that closes the vein; NaN: none does, or no cuff
  sonde_vessel_state vessel[2]; // vein, artery
  bool cut[2];                  // the image plane meets it
} press;

// Of one vessel; null when the plane misses it. Diameters before are those of the rest circle.
static void print_vessel(const char *name, const sonde_vessel_state *v, bool cut) {
  assert(!cut || v->rest_radius_m > 0);
  char key[64];
  const double nan = NAN, mm = 1e3;
  const struct {
    const char *what;
    double value;
  } row[] = {{"area_ratio", v->area_ratio},
             {"rest_area_mm2", 3.14159265358979 * v->rest_radius_m * v->rest_radius_m * mm * mm},
             {"area_mm2", 3.14159265358979 * v->half_short_m * v->half_long_m * mm * mm},
             {"rest_ap_mm", 2 * v->rest_radius_m * mm},
             {"ap_mm", 2 * v->half_short_m * mm},
             {"compressibility", v->half_short_m / v->rest_radius_m},
             {"outside_kpa", v->outside_pa * 1e-3}};
  for (size_t i = 0; i < sizeof row / sizeof row[0]; ++i) {
    snprintf(key, sizeof key, "%s_%s", name, row[i].what);
    app_json_real(key, cut ? row[i].value : nan);
  }
}

static int check(void *from) {
  const options *o = from;
  static const char *const SPRINGS[] = {"cuff-mmhg", "preset"};
  if (!o->solid && o->moduli) return app_usage_error("press", "--moduli goes with --solid");
  if (!o->solid && app_option_given("friction"))
    return app_usage_error("press", "--friction goes with --solid");
  for (size_t k = 0; k < sizeof SPRINGS / sizeof *SPRINGS && o->solid; ++k)
    if (app_option_given(SPRINGS[k]))
      return app_usage_error("press", "--solid goes without --%s", SPRINGS[k]);
  return APP_OK;
}

static void print(const press *p, const options *o) {
  const settled *s = &p->scene;
  const sonde_equilibrium_result *r = &p->solid.result;
  const double work_mj = 1e3 * (r->tissue_j + r->contact_j + r->slipped_j);
  const double area_mm2 = 1e6 * r->area_m2;
  if (o->json) {
    app_json_begin();
    app_json("force_n:%g penetration_mm:%g reaction_n:%g contact_n:%g", s->force_n,
             s->depth_m * 1e3, s->result.reaction_n, s->result.contact_n);
    if (o->solid) app_json("work_mj:%g area_mm2:%g", work_mj, area_mm2);
    print_vessel("vein", &p->vessel[0], p->cut[0]);
    print_vessel("artery", &p->vessel[1], p->cut[1]);
    if (!isnan(o->cuff_pa)) {
      app_json_real("cuff_mmhg", o->cuff_pa / SONDE_PA_PER_MMHG);
      app_json_real("vein_closes_mmhg", p->closes_pa / SONDE_PA_PER_MMHG);
    }
    app_json("vein_short_mm:%g residual:%g steps:%u",
             p->cut[0] ? p->vessel[0].half_short_m * 2e3 : NAN, s->result.residual, s->iterations);
    if (s->interior) settled_branches(s, true);
    settled_json_jumps(s);
    app_json("case:%s probe:%s", p->pathology.name, s->probe.name);
    if (o->solid) app_json("tissue:%s friction:%g", "solid", p->solid.friction);
    if (o->site >= 0)
      app_json("site:%ld", o->site);
    else
      app_json("station:%s", p->at);
    app_json_end();
    return;
  }
  printf("%s, probe %s, case %s%s\n", p->at, s->probe.name, p->pathology.name,
         o->solid ? ", solid" : "");
  printf("force         %8.3f N\n", s->force_n);
  printf("penetration   %8.2f mm\n", s->depth_m * 1e3);
  if (o->solid) printf("work          %8.3f mJ\n", work_mj);
  if (o->solid) printf("area          %8.1f mm2 of the skin at rest\n", area_mm2);
  printf("residual      %8.1e of the contact force (%u steps)\n", s->result.residual,
         s->iterations);
  if (!p->cut[0])
    printf("vein          the femoral and popliteal vein are not under the probe\n");
  else
    printf("vein area     %8.1f %% of rest, %.1f mm front to back (%.2f of rest)\n",
           p->vessel[0].area_ratio * 100, p->vessel[0].half_short_m * 2e3,
           p->vessel[0].half_short_m / p->vessel[0].rest_radius_m);
  if (p->cut[0] && !isnan(o->cuff_pa)) {
    if (isnan(p->closes_pa))
      printf("closes        not up to %.0f mmHg\n", CUFF_MOST_PA / SONDE_PA_PER_MMHG);
    else
      printf("closes        at a cuff of %.1f mmHg\n", p->closes_pa / SONDE_PA_PER_MMHG);
  }
  if (p->cut[1]) printf("artery area   %8.1f %% of rest\n", p->vessel[1].area_ratio * 100);
  if (s->interior) settled_branches(s, false);
  if (o->image) printf("image         %s\n", o->image);
}

// The cuff at which the vein's area has fallen to 5 % of that at rest, by bisection; NaN: none.
static double find_closing_cuff(const press *p) {
  sonde_vessel_state v;
  double low = 0, high = CUFF_MOST_PA;
  for (int k = 0; k < 20; ++k) {
    double middle = k > 0 ? 0.5 * (low + high) : high;
    settled_update(&p->scene, &p->pathology, middle, sonde_state_tick(p->scene.state));
    if (!sonde_interior_vessel_at_plane(p->scene.interior, 0, p->scene.pose, &v)) return NAN;
    if (k == 0 && v.area_ratio > CLOSED) return NAN;
    if (v.area_ratio > CLOSED)
      low = middle;
    else
      high = middle;
  }
  return high;
}

static int run(void *from) {
  const options *o = from;
  const bool cuff = !isnan(o->cuff_pa);
  assert(cuff + !isnan(o->force_n) + !isnan(o->depth_m) == 1);
  press p = {.scene.without_springs = o->solid,
             .solid = {.moduli = o->moduli,
                       .friction = isnan(o->friction) ? 0 : o->friction,
                       .depth_m = o->depth_m,
                       .force_n = o->force_n},
             .vein_depth_m = o->vein_depth_m,
             .closes_pa = NAN};
  sonde_pathology *vein = &p.pathology;
  sonde_error error = {0};
  sonde_preset preset = sonde_preset_default();
  sonde_status status = sonde_pathology_preset(o->pathology, vein, &error);
  if (!status && o->preset) status = sonde_preset_load(o->preset, &preset, &error);

  // The vein as asked for: its pressure, its wall and its clot, whose modulus is Young's and whose
  // material is incompressible.
  if (!isnan(o->venous_pa)) vein->venous_pressure_pa = o->venous_pa;
  if (!isnan(o->wall_pa)) vein->wall_shear_pa = o->wall_pa;
  if (!isnan(o->sheath)) vein->sheath = o->sheath;
  if (!isnan(o->thrombus_pa)) {
    vein->thrombus_fraction = 1;
    vein->thrombus_modulus_pa = 3 * o->thrombus_pa;
  }

  // A model without a bone can be pressed, unless vessels or a picture are asked for.
  bool vessels = o->image || !isnan(o->vein_depth_m) || !isnan(o->venous_pa) ||
                 !isnan(o->wall_pa) || !isnan(o->thrombus_pa) || !isnan(o->sheath) || cuff;
  app_progress_begin("pressing");
  if (!status) status = settled_open(&p.scene, o->model, o->probe, &preset, vessels, &error);
  if (!status)
    status = settled_place(&p.scene, o->model, o->site, o->station, &p.start, p.at, &error);
  if (!status && o->solid) {
    status = press_solid_find(&p.solid, &p.scene, p.start, &error);
  } else if (!status) {
    double depth_m = cuff ? -CUFF_LIFT_M : o->depth_m;
    status = !isnan(o->force_n) ? settled_force(&p.scene, p.start, o->force_n, &error)
                                : settled_press(&p.scene, p.start, depth_m, INFINITY, &error);
    settled_warn(&p.scene, "press");
  }
  if (!status && p.scene.interior) { // a model with a bone
    sonde_echo *echo = NULL;
    sonde_image image = {0};
    if (!isnan(p.vein_depth_m))
      status =
          sonde_interior_set_vein_depth(p.scene.interior, p.start.position, p.vein_depth_m, &error);
    if (!status) {
      if (cuff) p.closes_pa = find_closing_cuff(&p);
      const uint64_t tick = o->solid ? 0 : sonde_state_tick(p.scene.state);
      settled_update(&p.scene, &p.pathology, cuff ? o->cuff_pa : 0, tick);
      for (int which = 0; which < 2; ++which)
        p.cut[which] =
            sonde_interior_vessel_at_plane(p.scene.interior, which, p.scene.pose, &p.vessel[which]);
    }
    if (!status && o->image) {
      sonde_echo_settings settings = sonde_echo_settings_default();
      status = sonde_echo_create(p.scene.interior, NULL, &echo, &error);
      if (!status) status = sonde_image_create(512, 512, &image, &error);
      if (!status) {
        sonde_echo_render(echo, p.scene.pose, 2 * p.scene.probe.half_x_m, &p.pathology, &settings,
                          &image);
        status = sonde_image_save_png(&image, o->image, &error);
      }
    }
    sonde_image_clear(&image);
    sonde_echo_destroy(echo);
  }
  app_progress_end();
  if (!status) print(&p, o);
  settled_close(&p.scene);
  press_solid_clear(&p.solid);
  return status ? app_fail("press", &error) : APP_OK;
}

const app_command cmd_press = {
    .verb = "press",
    .summary = "press once, settle, report force, penetration and vessels",
    .usage = "[MODEL] [--station NAME | --site K] (--force-n F | --depth-mm D | --cuff-mmhg P) "
             "[options]",
    .text =
        "Presses a probe on the thigh until everything is at rest and reports the force, the "
        "penetration and the state of the vein and the artery below it. With --solid the tissue "
        "is the hyperelastic solid of sonde-solve(1) in place of the model's springs.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .one_of = "force-n depth-mm cuff-mmhg",
    .not_both = "station site",
    .check = check,
    .run = run};
