// sonde press: settles a probe at a site to a force or a depth and reports what is felt and seen.
// press_on:   to a force or to a depth.
// look:       vessels and picture of the settled state.
#include "app.h"
#include "settled.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HELP[] =
    "usage: sonde press [MODEL] --site K --probe NAME|FILE (--force-n F | --depth-mm D) [options]\n"
    "\n"
    "Presses a probe on the thigh until everything is at rest and reports the force, the\n"
    "penetration and the state of the vein and the artery below it.\n"
    "\n"
    "  --site K          number of the site to press at\n"
    "  --probe NAME      point, linear, square, sphere, or a mesh file (mm); default linear\n"
    "  --force-n F       press until the settled force is F newtons (0.01 to 200)\n"
    "  --depth-mm D      press D millimetres below the rest skin (-10 to 60)\n"
    "  --case NAME       healthy, partial_mural, acute_occlusive, subacute_occlusive,\n"
    "                    chronic_occlusive; default healthy\n"
    "  --vein-depth-mm D    put the vein D below the site, the artery 11 mm beside it (8 to 50)\n"
    "  --venous-mmhg P      pressure in the vein (0 to 80); default 10\n"
    "  --thrombus-kpa MU    fill the vein with a clot of this shear modulus (0.5 to 100)\n"
    "  --wall-kpa W         shear modulus of the vein's wall (10 to 300); default 30\n"
    "  --preset FILE     damping, stiffness and friction (sonde-identify(1)); a settled probe\n"
    "                    feels the stiffness only\n"
    "  --image PNG       write the echographic image of the settled state (512 x 512)\n"
    "  --json            print one JSON object\n"
    "  --help            this text\n"
    "MODEL defaults to the bundled thigh.\n";

typedef struct options {
  char model[1024];
  long site;
  const char *probe, *pathology, *image, *preset;
  double force_n, depth_m; // NaN when not asked for, as all below
  double vein_depth_m, venous_pa, thrombus_pa, wall_pa;
  bool json;
} options;

typedef struct press {
  settled scene;
  sonde_pose start; // at rest on the site
  sonde_pathology pathology;
  double vein_depth_m;          // NaN: where the model has it
  sonde_vessel_state vessel[2]; // vein, artery
  bool cut[2];                  // the image plane meets it
} press;

// A number within bounds, scaled to SI; false after a message.
static bool read_real(const char *name, double low, double high, double scale, double *to) {
  if (!app_parse_real("press", name, optarg, low, high, to)) return false;
  *to *= scale;
  return true;
}

// The vessel options; false after a message.
static bool read_vessel_option(int c, options *o) {
  const double pa_per_mmhg = 133.322387415;
  switch (c) {
  case 'D': return read_real("--vein-depth-mm", 8, 50, 1e-3, &o->vein_depth_m);
  case 'V': return read_real("--venous-mmhg", 0, 80, pa_per_mmhg, &o->venous_pa);
  case 'T': return read_real("--thrombus-kpa", 0.5, 100, 1e3, &o->thrombus_pa);
  default: return read_real("--wall-kpa", 10, 300, 1e3, &o->wall_pa);
  }
}

// Returns -1 to go on, else the exit code.
static int read_options(int argc, char **argv, options *o) {
  static const struct option LONG[] = {{"site", required_argument, NULL, 's'},
                                       {"probe", required_argument, NULL, 'p'},
                                       {"force-n", required_argument, NULL, 'f'},
                                       {"depth-mm", required_argument, NULL, 'd'},
                                       {"case", required_argument, NULL, 'c'},
                                       {"image", required_argument, NULL, 'i'},
                                       {"preset", required_argument, NULL, 'P'},
                                       {"json", no_argument, NULL, 'j'},
                                       {"vein-depth-mm", required_argument, NULL, 'D'},
                                       {"venous-mmhg", required_argument, NULL, 'V'},
                                       {"thrombus-kpa", required_argument, NULL, 'T'},
                                       {"wall-kpa", required_argument, NULL, 'W'},
                                       {"help", no_argument, NULL, 'h'},
                                       {NULL, 0, NULL, 0}};
  for (int c; (c = getopt_long(argc, argv, "", LONG, NULL)) != -1;) switch (c) {
    case 's':
      if (!app_parse_integer("press", "--site", optarg, 0, 1000000, &o->site)) return APP_BAD_INPUT;
      break;
    case 'p': o->probe = optarg; break;
    case 'f':
      if (!read_real("--force-n", 0.01, 200, 1, &o->force_n)) return APP_BAD_INPUT;
      break;
    case 'd':
      if (!read_real("--depth-mm", -10, 60, 1e-3, &o->depth_m)) return APP_BAD_INPUT;
      break;
    case 'D':
    case 'V':
    case 'T':
    case 'W':
      if (!read_vessel_option(c, o)) return APP_BAD_INPUT;
      break;
    case 'c': o->pathology = optarg; break;
    case 'i': o->image = optarg; break;
    case 'P': o->preset = optarg; break;
    case 'j': o->json = true; break;
    case 'h': fputs(HELP, stdout); return APP_OK;
    default: return APP_BAD_INPUT;
    }
  if (isnan(o->force_n) == isnan(o->depth_m))
    return app_usage_error("press", "give either --force-n or --depth-mm");
  if (o->site < 0) return app_usage_error("press", "--site is missing");
  if (!app_model_argument("press", argc, argv, o->model, sizeof o->model)) return APP_BAD_INPUT;
  return -1;
}

static sonde_status look(press *p, const char *image_path, sonde_error *error) {
  settled *scene = &p->scene;
  sonde_interior *interior = scene->interior;
  sonde_echo *echo = NULL;
  sonde_image image = {0};
  sonde_status status = SONDE_OK;
  if (!interior) return SONDE_OK; // a model without a bone
  if (!isnan(p->vein_depth_m)) {
    const sonde_vec3 at = p->start.position;
    status = sonde_interior_set_vein_depth(interior, at, p->vein_depth_m, error);
  }
  if (status) goto done;
  settled_update(scene, &p->pathology, sonde_state_tick(scene->state));
  for (int which = 0; which < 2; ++which)
    p->cut[which] = sonde_interior_vessel_at_plane(interior, which, scene->pose, &p->vessel[which]);
  if (!image_path) goto done;
  sonde_echo_settings settings = sonde_echo_settings_default();
  status = sonde_echo_create(interior, &(sonde_echo_def){0}, &echo, error);
  if (!status) status = sonde_image_create(512, 512, &image, error);
  if (status) goto done;
  sonde_echo_render(echo, scene->pose, 2 * scene->probe.half_x_m, &p->pathology, &settings, &image);
  status = sonde_image_save_png(&image, image_path, error);
done:
  sonde_image_clear(&image);
  sonde_echo_destroy(echo);
  return status;
}

// Of one vessel; null when the plane misses it. Diameters before are those of the rest circle.
static void print_vessel(const char *name, const sonde_vessel_state *v, bool cut) {
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

static void print(const press *p, const options *o) {
  const settled *s = &p->scene;
  if (o->json) {
    app_json_begin();
    app_json_real("force_n", s->force_n);
    app_json_real("penetration_mm", s->depth_m * 1e3);
    app_json_real("reaction_n", s->result.reaction_n);
    app_json_real("contact_n", s->result.contact_n);
    print_vessel("vein", &p->vessel[0], p->cut[0]);
    print_vessel("artery", &p->vessel[1], p->cut[1]);
    app_json_real("vein_short_mm", p->cut[0] ? p->vessel[0].half_short_m * 2e3 : NAN);
    app_json_real("residual", s->result.residual);
    app_json_integer("steps", s->iterations);
    settled_json_jumps(s);
    app_json_text("case", p->pathology.name);
    app_json_text("probe", s->probe.name);
    app_json_integer("site", o->site);
    app_json_end();
    return;
  }
  printf("site %ld, probe %s, case %s\n", o->site, s->probe.name, p->pathology.name);
  printf("force         %8.3f N\n", s->force_n);
  printf("penetration   %8.2f mm\n", s->depth_m * 1e3);
  printf("residual      %8.1e of the contact force (%u steps)\n", s->result.residual,
         s->iterations);
  if (!p->cut[0])
    printf("vein          not under the probe\n");
  else
    printf("vein area     %8.1f %% of rest, %.1f mm front to back (%.2f of rest)\n",
           p->vessel[0].area_ratio * 100, p->vessel[0].half_short_m * 2e3,
           p->vessel[0].half_short_m / p->vessel[0].rest_radius_m);
  if (p->cut[1]) printf("artery area   %8.1f %% of rest\n", p->vessel[1].area_ratio * 100);
  if (o->image) printf("image         %s\n", o->image);
}

static void set_vein(press *p, const options *o) {
  p->vein_depth_m = o->vein_depth_m;
  if (!isnan(o->venous_pa)) p->pathology.venous_pressure_pa = o->venous_pa;
  if (!isnan(o->wall_pa)) p->pathology.wall_shear_pa = o->wall_pa;
  if (isnan(o->thrombus_pa)) return;
  p->pathology.thrombus_fraction = 1;
  p->pathology.thrombus_modulus_pa = 3 * o->thrombus_pa; // Young's, incompressible
}

static bool needs_vessels(const options *o) {
  return o->image || !isnan(o->vein_depth_m) || !isnan(o->venous_pa) || !isnan(o->wall_pa) ||
         !isnan(o->thrombus_pa);
}

static sonde_status prepare(press *p, const options *o, sonde_error *error) {
  sonde_preset preset = sonde_preset_default();
  sonde_status status = sonde_pathology_preset(o->pathology, &p->pathology, error);
  if (!status) set_vein(p, o);
  if (!status && o->preset) status = sonde_preset_load(o->preset, &preset, error);
  app_progress_begin("pressing");
  if (!status)
    status = settled_open(&p->scene, o->model, o->probe, &preset, needs_vessels(o), error);
  return status ? status : settled_site(&p->scene, o->model, o->site, &p->start, error);
}

static sonde_status press_on(press *p, const options *o, sonde_error *error) {
  sonde_status status = !isnan(o->force_n)
                            ? settled_force(&p->scene, p->start, o->force_n, error)
                            : settled_press(&p->scene, p->start, o->depth_m, INFINITY, error);
  settled_warn(&p->scene, "press");
  return status;
}

int cmd_press(int argc, char **argv) {
  options o = {.site = -1,
               .probe = "linear",
               .pathology = "healthy",
               .force_n = NAN,
               .depth_m = NAN,
               .vein_depth_m = NAN,
               .venous_pa = NAN,
               .thrombus_pa = NAN,
               .wall_pa = NAN};
  int code = read_options(argc, argv, &o);
  if (code >= 0) return code;
  press p = {0};
  sonde_error error = {0};
  sonde_status status = prepare(&p, &o, &error);
  if (!status) status = press_on(&p, &o, &error);
  if (!status) status = look(&p, o.image, &error);
  app_progress_end();
  if (!status) print(&p, &o);
  settled_close(&p.scene);
  return status ? app_fail("press", &error) : APP_OK;
}
