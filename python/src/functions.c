// What is asked of a leg at rest: presses to equilibrium, pictures, estimation, prediction.
#include "module.h"
#include "pose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double DEEPEST_M = 0.06; // of a press to a force

// The leg, a probe and what its press found; cleared also after a failure.
typedef struct pressed {
  const sonde_case_setup *setup;
  sonde_probe probe;
  sonde_state *state;
  sonde_interior *interior;
  sonde_pathology pathology;
  sonde_path_result path;
} pressed;

static void clear(pressed *p) {
  sonde_interior_destroy(p->interior);
  sonde_state_destroy(p->state);
  sonde_probe_clear(&p->probe);
}

// Presses from a pose along the beam to a force or a depth, in equilibrium all the way; then the
// inside.
static sonde_status settle(pressed *p, const char *probe, sonde_pose pose, double force_n,
                           double depth_m, sonde_error *error) {
  sonde_world_def world = sonde_world_def_default();
  world.engine = SONDE_ENGINE_DOUBLE;
  sonde_status status = sonde_probe_create(probe, &p->probe, error);
  if (!status) status = sonde_state_create(p->setup->model, &world, &p->state, error);
  if (status) return status;
  sonde_path_def def = sonde_path_def_default();
  bool by_force = isfinite(force_n);
  if (by_force) def.force_n = force_n, depth_m = DEEPEST_M;
  const sonde_pose to = pose_shift(pose, depth_m, pose_axis(pose, 2));
  status = sonde_settle_path(p->state, &p->probe, pose, to, &def, NULL, &p->path, error);
  if (status || !p->setup->model->femur.face_count) return status;
  status = sonde_interior_create(p->setup->model, &p->interior, error);
  if (!status) status = sonde_interior_set_findings(p->interior, &p->setup->findings, error);
  if (status) return status;
  p->pathology = p->setup->pathology;
  sonde_circulation_apply(&p->setup->circulation, 0, 1e-3, &p->pathology);
  sonde_interior_input input = {.positions_m = sonde_state_positions(p->state),
                                .contact_forces_n = sonde_state_contact_forces(p->state),
                                .world_from_probe = p->path.pose,
                                .pathology = &p->pathology,
                                .dt_s = -1,
                                .face_half_x_m = p->probe.half_x_m,
                                .face_half_y_m = p->probe.half_y_m,
                                .posture = p->setup->circulation.posture};
  sonde_interior_update(p->interior, &input);
  return SONDE_OK;
}

static PyObject *describe(const pressed *p) {
  PyObject *dict = PyDict_New(), *vessels = PyDict_New();
  const sonde_contact *contact = sonde_state_contact(p->state);
  bool good = dict && vessels && py_set(dict, "pose", py_make_pose(p->path.pose)) &&
              py_set(dict, "force_n", PyFloat_FromDouble(p->path.force_n)) &&
              py_set(dict, "depth_m", PyFloat_FromDouble(p->path.way_m)) &&
              py_set(dict, "force_on_probe_n", py_make_vec3(contact->force_n)) &&
              py_set(dict, "torque_on_probe_n_m", py_make_vec3(contact->torque_n_m)) &&
              py_set(dict, "contact_area_m2", PyFloat_FromDouble(contact->area_m2)) &&
              py_set(dict, "jumps", PyLong_FromUnsignedLong(p->path.jump_count));
  uint32_t count = p->interior ? sonde_interior_vessel_count(p->interior) : 0;
  for (uint32_t k = 0; good && k < count; ++k) {
    sonde_vessel_state v;
    if (!sonde_interior_vessel_at_plane(p->interior, (int)k, p->path.pose, &v)) continue;
    good = py_set(vessels, sonde_interior_vessel_name(p->interior, (int)k),
                  Py_BuildValue("{s:d,s:d,s:d,s:N}", "area_ratio", v.area_ratio, "short_m",
                                2 * v.half_short_m, "long_m", 2 * v.half_long_m, "centre_m",
                                py_make_vec3(v.centre_m)));
  }
  if (good) good = PyDict_SetItemString(dict, "vessels", vessels) == 0;
  Py_XDECREF(vessels);
  if (!good) Py_CLEAR(dict);
  return dict;
}

// What press() and image() share: the leg, the pose, and how far.
typedef struct request {
  PyObject *leg, *pose;
  const char *probe;
  double force_n, depth_mm;
  sonde_pose from;
} request;

static bool check(request *r) {
  if (!PyObject_TypeCheck(r->leg, py_leg_type)) {
    PyErr_SetString(PyExc_TypeError, "leg: expected a Leg");
    return false;
  }
  if (isfinite(r->force_n) == isfinite(r->depth_mm)) {
    PyErr_SetString(PyExc_ValueError, "expected either force_n or depth_mm");
    return false;
  }
  return py_read_pose(r->pose, &r->from);
}

static PyObject *press(PyObject *module, PyObject *args, PyObject *words) {
  static char *names[] = {"leg", "pose", "force_n", "depth_mm", "probe", NULL};
  (void)module;
  request r = {.probe = "linear", .force_n = (double)NAN, .depth_mm = (double)NAN};
  if (!PyArg_ParseTupleAndKeywords(args, words, "OO|dds:press", names, &r.leg, &r.pose, &r.force_n,
                                   &r.depth_mm, &r.probe) ||
      !check(&r))
    return NULL;
  sonde_error error = {0};
  pressed p = {.setup = &((py_leg *)r.leg)->setup};
  sonde_status status;
  Py_BEGIN_ALLOW_THREADS;
  status = settle(&p, r.probe, r.from, r.force_n, r.depth_mm * 1e-3, &error);
  Py_END_ALLOW_THREADS;
  PyObject *result = status ? py_raise(&error) : describe(&p);
  clear(&p);
  return result;
}

static PyObject *image(PyObject *module, PyObject *args, PyObject *words) {
  static char *names[] = {"leg",  "pose",    "force_n",        "depth_mm", "probe",
                          "size", "scanner", "image_depth_mm", NULL};
  (void)module;
  request r = {.probe = "linear", .force_n = (double)NAN, .depth_mm = (double)NAN};
  unsigned width = 512, height = 512;
  double image_depth_mm = (double)NAN;
  PyObject *size = Py_None, *scanner = Py_None, *keep = NULL;
  if (!PyArg_ParseTupleAndKeywords(args, words, "OO|ddsOOd:image", names, &r.leg, &r.pose,
                                   &r.force_n, &r.depth_mm, &r.probe, &size, &scanner,
                                   &image_depth_mm) ||
      !check(&r) || (size != Py_None && !PyArg_ParseTuple(size, "II:size", &width, &height)))
    return NULL;
  sonde_error error = {0};
  sonde_scanner look = sonde_scanner_plain();
  if (scanner != Py_None) {
    const char *path = py_path(scanner, &keep);
    if (!path) return NULL;
    sonde_status status = sonde_scanner_load(path, &look, NULL, 0, &error);
    Py_DECREF(keep);
    if (status) return py_raise(&error);
  }
  if (isfinite(image_depth_mm)) look.settings.depth_m = image_depth_mm * 1e-3;
  pressed p = {.setup = &((py_leg *)r.leg)->setup};
  sonde_image drawn = {0};
  sonde_echo *echo = NULL;
  sonde_status status;
  Py_BEGIN_ALLOW_THREADS;
  status = settle(&p, r.probe, r.from, r.force_n, r.depth_mm * 1e-3, &error);
  if (!status && !p.interior) {
    status = error.status = SONDE_MESH;
    snprintf(error.message, sizeof error.message, "the model has no bone and so no picture");
  }
  sonde_echo_def def = sonde_echo_def_default();
  if (scanner != Py_None) def.scanner = &look;
  if (!status) status = sonde_image_create(width, height, &drawn, &error);
  if (!status) status = sonde_echo_create(p.interior, &def, &echo, &error);
  if (!status) {
    sonde_echo_settings settings = sonde_echo_settings_clamp(look.settings);
    sonde_echo_render(echo, p.path.pose, 2 * p.probe.half_x_m, &p.pathology, &settings, &drawn);
  }
  Py_END_ALLOW_THREADS;
  PyObject *result = status ? py_raise(&error) : describe(&p);
  if (result && !(py_set(result, "pixels",
                         PyBytes_FromStringAndSize((const char *)drawn.pixels,
                                                   (Py_ssize_t)width * (Py_ssize_t)height)) &&
                  py_set(result, "size", Py_BuildValue("(II)", height, width)) &&
                  py_set(result, "size_m", Py_BuildValue("(dd)", drawn.height_m, drawn.width_m))))
    Py_CLEAR(result);
  sonde_echo_destroy(echo);
  sonde_image_clear(&drawn);
  clear(&p);
  return result;
}

static PyObject *report_of(const sonde_error_report *r) {
  return Py_BuildValue("{s:I,s:d,s:d,s:d,s:d}", "rows", r->all.count, "mae_n", r->all.mae_n,
                       "mae_percent", r->all.mae_percent, "bias_n", r->all.bias_n, "sd_n",
                       r->all.sd_n);
}

// Tables of an estimation.
typedef struct tables {
  sonde_site_table sites;
  sonde_measurements measurements;
} tables;

// Sites from a file, or those of the model, which stay the model's.
static sonde_status read_tables(const sonde_model *model, const char *measurements,
                                const char *sites, tables *t, sonde_error *error) {
  sonde_status status = SONDE_OK;
  if (sites)
    status = sonde_site_table_load(sites, &t->sites, error);
  else
    t->sites = (sonde_site_table){.count = model->site_count, .sites = model->sites};
  return status ? status
                : sonde_measurements_load(measurements, &t->sites, &t->measurements, error);
}

typedef struct names_of_tables {
  PyObject *leg, *measurements, *sites, *keep, *keep_sites;
  const char *path, *sites_path;
} names_of_tables;

static bool read_names(names_of_tables *n) {
  if (!PyObject_TypeCheck(n->leg, py_leg_type)) {
    PyErr_SetString(PyExc_TypeError, "leg: expected a Leg");
    return false;
  }
  n->path = py_path(n->measurements, &n->keep);
  if (!n->path) return false;
  if (!n->sites || n->sites == Py_None) return true;
  n->sites_path = py_path(n->sites, &n->keep_sites);
  return n->sites_path != NULL;
}

static void clear_tables(names_of_tables *n, tables *t) {
  if (n->sites_path) sonde_site_table_clear(&t->sites);
  sonde_measurements_clear(&t->measurements);
  Py_XDECREF(n->keep);
  Py_XDECREF(n->keep_sites);
}

static PyObject *predict(PyObject *module, PyObject *args, PyObject *words) {
  static char *names[] = {"leg", "measurements", "sites", "full", NULL};
  (void)module;
  names_of_tables n = {0};
  int full = 1;
  if (!PyArg_ParseTupleAndKeywords(args, words, "OO|Op:predict", names, &n.leg, &n.measurements,
                                   &n.sites, &full))
    return NULL;
  tables t = {0};
  PyObject *result = NULL;
  if (read_names(&n)) {
    const sonde_model *model = ((py_leg *)n.leg)->setup.model;
    sonde_predict_def def = sonde_predict_def_default();
    def.interaction = full ? SONDE_INTERACTION_FULL : SONDE_INTERACTION_SIMPLIFIED;
    sonde_error error = {0};
    sonde_error_report report;
    double *force_n = NULL;
    sonde_status status;
    Py_BEGIN_ALLOW_THREADS;
    status = read_tables(model, n.path, n.sites_path, &t, &error);
    if (!status) {
      force_n = calloc(t.measurements.count, sizeof *force_n);
      status = force_n
                   ? sonde_predict(model, &t.sites, &t.measurements, &def, NULL, force_n, &error)
                   : (error.status = SONDE_MEMORY);
    }
    if (!status)
      status = sonde_error_report_of(t.measurements.data, force_n, t.measurements.count, &report,
                                     &error);
    Py_END_ALLOW_THREADS;
    PyObject *list = status ? py_raise(&error) : PyList_New(0);
    for (uint32_t k = 0; list && k < t.measurements.count; ++k)
      if (!py_append(list, PyFloat_FromDouble(force_n[k]))) Py_CLEAR(list);
    free(force_n);
    if (list) result = Py_BuildValue("{s:N,s:N}", "force_n", list, "errors", report_of(&report));
  }
  clear_tables(&n, &t);
  return result;
}

static PyObject *sites_of(const sonde_fit_result *fit) {
  PyObject *list = PyList_New(0);
  for (uint32_t k = 0; list && k < fit->site_count; ++k) {
    const sonde_site *s = &fit->sites[k];
    PyObject *row =
        Py_BuildValue("{s:I,s:d,s:d}", "site", s->id, "k0_n_m3", s->k0_n_m3, "xm_m", s->xm_m);
    if (!py_append(list, row)) Py_CLEAR(list);
  }
  return list;
}

// What a fit reads and finds; cleared also after a failure.
typedef struct fitting {
  const char *skin, *femur, *fat, *muscle, *measurements, *sites; // paths; NULL: none
  sonde_mesh mesh[4];
  sonde_site_table table;
  sonde_measurements data;
  sonde_model *model;
  sonde_fit_result result;
  sonde_doubts doubts;
} fitting;

// Refuses what no tissue gives.
static sonde_status doubt(const fitting *f, sonde_error *error) {
  const sonde_doubt *d = sonde_doubts_gravest(&f->doubts);
  if (!d || d->grade == SONDE_DOUBT_WARNING) return SONDE_OK;
  snprintf(error->message, sizeof error->message, "%.90s: %.400s", f->measurements, d->sentence);
  return error->status = SONDE_ARGUMENT;
}

static sonde_status estimate(fitting *f, const sonde_fit_def *fit, sonde_error *error) {
  const char *const paths[] = {f->skin, f->femur, f->fat, f->muscle};
  sonde_status status = SONDE_OK;
  for (int k = 0; k < 4 && !status; ++k)
    if (paths[k]) status = sonde_mesh_load(paths[k], 1e-3, &f->mesh[k], error);
  if (!status) status = sonde_site_table_load(f->sites, &f->table, error);
  if (!status) status = sonde_measurements_load(f->measurements, &f->table, &f->data, error);
  if (!status) status = sonde_measurements_examine(&f->data, &f->doubts, error);
  if (!status) status = doubt(f, error);
  sonde_model_def def = sonde_model_def_default();
  def.name = "fitted leg";
  def.skin = &f->mesh[0];
  if (f->femur) def.femur = &f->mesh[1];
  if (f->fat) def.fat_interface = &f->mesh[2];
  if (f->muscle) def.muscle_interface = &f->mesh[3];
  def.sites = f->table.sites, def.site_count = f->table.count;
  def.data = f->data.data, def.datum_count = f->data.count;
  def.fine_edge_m = 3e-3;
  def.law.inplane_stiffness_n_m = SONDE_SKIN_INPLANE_N_M;
  def.law.tangential_stiffness_n_m3 = SONDE_SKIN_TANGENTIAL_N_M3;
  if (!status) status = sonde_model_build(&def, &f->model, error);
  if (!status) status = sonde_fit(f->model, &f->table, &f->data, fit, NULL, &f->result, error);
  if (!status) status = sonde_fit_examine(f->model, &f->data, &f->result, &f->doubts, error);
  if (!status) status = doubt(f, error);
  const sonde_fit_result *r = &f->result;
  if (!status)
    status = sonde_model_set_parameters(f->model, &r->law, r->sites, r->site_count, error);
  return status;
}

static PyObject *tell_fit(fitting *f, uint32_t stages) {
  const sonde_fit_result *r = &f->result;
  PyObject *warnings = PyList_New(0);
  for (uint32_t k = 0; warnings && k < f->doubts.count; ++k)
    if (!py_append(warnings, PyUnicode_FromString(f->doubts.doubt[k].sentence))) Py_CLEAR(warnings);
  sonde_model *model = f->model;
  f->model = NULL;
  PyObject *leg = py_healthy(model), *sites = leg ? sites_of(r) : NULL;
  if (!warnings || !sites) {
    Py_XDECREF(warnings);
    Py_XDECREF(leg);
    return NULL;
  }
  return Py_BuildValue("{s:N,s:N,s:N,s:I,s:O,s:N}", "leg", leg, "sites", sites, "errors",
                       report_of(stages == 1   ? &r->stage1
                                 : stages == 2 ? &r->stage2
                                               : &r->stage3),
                       "parameters", r->parameters, "converged", r->converged ? Py_True : Py_False,
                       "warnings", warnings);
}

static PyObject *fit(PyObject *module, PyObject *args, PyObject *words) {
  static char *names[] = {"surface", "measurements", "sites",   "femur", "fat",
                          "muscle",  "stages",       "threads", NULL};
  (void)module;
  fitting f = {0};
  sonde_fit_def def = sonde_fit_def_default();
  def.stages = 3;
  PyObject *path[6] = {NULL, NULL, NULL, Py_None, Py_None, Py_None}, *keep[6] = {0};
  if (!PyArg_ParseTupleAndKeywords(args, words, "OOO|OOOII:fit", names, &path[0], &path[1],
                                   &path[2], &path[3], &path[4], &path[5], &def.stages,
                                   &def.threads))
    return NULL;
  const char **into[] = {&f.skin, &f.measurements, &f.sites, &f.femur, &f.fat, &f.muscle};
  bool named = true;
  for (int k = 0; k < 6 && named; ++k)
    if (path[k] != Py_None) named = (*into[k] = py_path(path[k], &keep[k])) != NULL;
  PyObject *result = NULL;
  if (named) {
    sonde_error error = {0};
    sonde_status status;
    Py_BEGIN_ALLOW_THREADS;
    status = estimate(&f, &def, &error);
    Py_END_ALLOW_THREADS;
    result = status ? py_raise(&error) : tell_fit(&f, def.stages);
  }
  sonde_fit_result_clear(&f.result);
  sonde_model_destroy(f.model);
  sonde_measurements_clear(&f.data);
  sonde_site_table_clear(&f.table);
  for (int k = 0; k < 4; ++k) sonde_mesh_clear(&f.mesh[k]);
  for (int k = 0; k < 6; ++k) Py_XDECREF(keep[k]);
  return result;
}

static PyObject *pathologies(PyObject *module, PyObject *unused) {
  (void)module, (void)unused;
  PyObject *list = PyList_New(0);
  for (const char *const *name = sonde_pathology_names(); list && *name; ++name)
    if (!py_append(list, PyUnicode_FromString(*name))) Py_CLEAR(list);
  return list;
}

PyMethodDef py_functions[] = {
    {"press", (PyCFunction)(void (*)(void))press, METH_VARARGS | METH_KEYWORDS,
     "press(leg, pose, force_n=nan, depth_mm=nan, probe='linear'): equilibrium of a slow press"},
    {"image", (PyCFunction)(void (*)(void))image, METH_VARARGS | METH_KEYWORDS,
     "image(leg, pose, force_n=nan, depth_mm=nan, probe='linear', size=None, scanner=None, "
     "image_depth_mm=nan): the same with the picture"},
    {"fit", (PyCFunction)(void (*)(void))fit, METH_VARARGS | METH_KEYWORDS,
     "fit(surface, measurements, sites, femur=None, fat=None, muscle=None, stages=3, threads=0): a "
     "leg from its skin (mm) and indentation"},
    {"predict", (PyCFunction)(void (*)(void))predict, METH_VARARGS | METH_KEYWORDS,
     "predict(leg, measurements, sites=None, full=True): the model's force for each row"},
    {"pathologies", pathologies, METH_NOARGS, "pathologies(): names for Batch.reset()"},
    {0}};
