// Legs: made, loaded, or of a case.
#include "module.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

PyTypeObject *py_leg_type;

static py_leg *new_leg(void) { return (py_leg *)PyType_GenericAlloc(py_leg_type, 0); }

static void release(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  sonde_case_setup_clear(&((py_leg *)self)->setup);
  PyObject_Free(self);
  Py_DECREF(type);
}

PyObject *py_healthy(sonde_model *model) {
  sonde_error error = {0};
  py_leg *leg = new_leg();
  if (!leg) {
    sonde_model_destroy(model);
    return NULL;
  }
  leg->setup.model = model;
  leg->setup.circulation = sonde_circulation_default();
  sonde_status status = SONDE_OK;
  if (model->femur.face_count && model->vein.count)
    status = sonde_vein_map_make(model, &leg->setup.map, &error);
  if (!status) status = sonde_pathology_preset("healthy", &leg->setup.pathology, &error);
  if (!status) return (PyObject *)leg;
  Py_DECREF((PyObject *)leg);
  return py_raise(&error);
}

static bool read_known(PyObject *known, sonde_limb_body *body) {
  uint32_t count;
  const sonde_parameter *list = sonde_limb_parameters(&count);
  PyObject *key, *value;
  Py_ssize_t at = 0;
  while (known && PyDict_Next(known, &at, &key, &value)) {
    char name[64] = "", side[16] = "";
    PyObject *text = PyUnicode_AsUTF8String(key);
    if (!text) return false;
    snprintf(name, sizeof name, "%s", PyBytes_AsString(text));
    Py_DECREF(text);
    bool is_sex = strcmp(name, "sex") == 0;
    if (is_sex || strcmp(name, "side") == 0) {
      text = PyUnicode_AsUTF8String(value);
      if (!text) return false;
      snprintf(side, sizeof side, "%s", PyBytes_AsString(text));
      Py_DECREF(text);
      const char *first = is_sex ? "female" : "right", *second = is_sex ? "male" : "left";
      bool is_second = strcmp(side, second) == 0;
      if (!is_second && strcmp(side, first) != 0) {
        PyErr_Format(PyExc_ValueError, "%s: expected '%s' or '%s', but got '%s'", name, first,
                     second, side);
        return false;
      }
      if (is_sex) body->sex = is_second ? SONDE_SEX_MALE : SONDE_SEX_FEMALE;
      if (!is_sex) body->side = is_second ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT;
      continue;
    }
    uint32_t k = 0;
    for (char *c = name; *c; ++c) *c = *c == '_' ? '-' : *c;
    while (k < count && strcmp(list[k].name, name) != 0) ++k;
    if (k == count) {
      PyErr_Format(PyExc_TypeError, "a body has no parameter %R; `sonde limb --help` lists them",
                   key);
      return false;
    }
    double number = PyFloat_AsDouble(value);
    if (PyErr_Occurred()) return false;
    *sonde_parameter_of(body, &list[k]) = number * list[k].unit;
  }
  return true;
}

static PyObject *limb(PyObject *type, PyObject *args, PyObject *known) {
  (void)type;
  unsigned long long seed = 1;
  if (!PyArg_ParseTuple(args, "|K:limb", &seed)) return NULL;
  sonde_limb_body body = sonde_limb_unknown();
  if (!read_known(known, &body)) return NULL;
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_status status;
  Py_BEGIN_ALLOW_THREADS;
  sonde_limb_body drawn;
  sonde_limb_model_def def = sonde_limb_model_def_default();
  def.name = "limb";
  def.provenance = "Synthetic limb";
  status = sonde_limb_draw(&body, seed, &drawn, &error);
  if (!status) status = sonde_limb_model(&drawn, &def, &model, &error);
  Py_END_ALLOW_THREADS;
  return status ? py_raise(&error) : py_healthy(model);
}

static PyObject *load(PyObject *type, PyObject *path) {
  (void)type;
  PyObject *keep = NULL;
  const char *name = py_path(path, &keep);
  if (!name) return NULL;
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_status status;
  Py_BEGIN_ALLOW_THREADS;
  status = sonde_limb_model_load(name, &model, &error);
  Py_END_ALLOW_THREADS;
  Py_DECREF(keep);
  return status ? py_raise(&error) : py_healthy(model);
}

static PyObject *of_case(PyObject *type, PyObject *args, PyObject *known) {
  (void)type;
  static char *names[] = {"path", "bundled", NULL};
  PyObject *path, *bundled = Py_None, *keep = NULL, *keep_bundled = NULL;
  if (!PyArg_ParseTupleAndKeywords(args, known, "O|O:case", names, &path, &bundled)) return NULL;
  const char *name = py_path(path, &keep), *thigh = NULL;
  if (!name) return NULL;
  if (bundled != Py_None && !(thigh = py_path(bundled, &keep_bundled))) {
    Py_DECREF(keep);
    return NULL;
  }
  sonde_error error = {0};
  py_leg *leg = new_leg();
  sonde_status status = SONDE_MEMORY;
  if (leg) {
    char directory[4096];
    snprintf(directory, sizeof directory, "%s", name);
    char *slash = strrchr(directory, '/');
    if (slash) *slash = 0;
    Py_BEGIN_ALLOW_THREADS;
    status = sonde_case_load(name, &leg->patient, &error);
    if (!status)
      status =
          sonde_case_build(&leg->patient, thigh, slash ? directory : NULL, &leg->setup, &error);
    Py_END_ALLOW_THREADS;
    leg->is_case = true;
  }
  Py_DECREF(keep);
  Py_XDECREF(keep_bundled);
  if (leg && !status) return (PyObject *)leg;
  Py_XDECREF((PyObject *)leg);
  return leg ? py_raise(&error) : NULL;
}

static PyObject *get_name(PyObject *self, void *unused) {
  (void)unused;
  return PyUnicode_FromString(((py_leg *)self)->setup.model->name);
}

static PyObject *get_nodes(PyObject *self, void *unused) {
  (void)unused;
  return PyLong_FromUnsignedLong(((py_leg *)self)->setup.model->surface.vertex_count);
}

// Where a probe is put: the stations of a limb, the sites of any model as "site 27".
static PyObject *get_places(PyObject *self, void *unused) {
  (void)unused;
  const sonde_case_setup *setup = &((py_leg *)self)->setup;
  PyObject *places = PyDict_New();
  for (uint32_t k = 0; places && k < setup->map.station_count; ++k) {
    const sonde_map_station *station = &setup->map.station[k];
    if (!py_set(places, station->name, py_make_pose(station->probe))) Py_CLEAR(places);
  }
  for (uint32_t k = 0; places && k < setup->model->site_count; ++k) {
    char name[32];
    snprintf(name, sizeof name, "site %u", setup->model->sites[k].id);
    if (!py_set(places, name, py_make_pose(sonde_site_pose(&setup->model->sites[k], 0))))
      Py_CLEAR(places);
  }
  return places;
}

static PyObject *get_vein(PyObject *self, void *unused) {
  (void)unused;
  const sonde_vein_map *map = &((py_leg *)self)->setup.map;
  PyObject *list = PyList_New(0);
  for (uint32_t k = 0; list && k < map->point_count; ++k) {
    const sonde_vein_point *p = &map->point[k];
    uint32_t segment = sonde_vein_segment_at(map, p->z_m);
    PyObject *row = PyDict_New();
    bool good = row && py_set(row, "vein_m", py_make_vec3(p->vein_m)) &&
                py_set(row, "pose", py_make_pose(sonde_vein_pose(p, 0))) &&
                py_set(row, "along_m", PyFloat_FromDouble(p->along_m)) &&
                py_set(row, "radius_m", PyFloat_FromDouble(p->radius_m)) &&
                py_set(row, "depth_m", PyFloat_FromDouble(p->depth_m)) &&
                py_set(row, "segment",
                       PyUnicode_FromString(
                           segment < map->segment_count ? map->segment[segment].name : ""));
    if (!good) Py_CLEAR(row);
    if (!py_append(list, row)) Py_CLEAR(list);
  }
  return list;
}

static PyObject *get_segments(PyObject *self, void *unused) {
  (void)unused;
  const sonde_vein_map *map = &((py_leg *)self)->setup.map;
  PyObject *list = PyList_New(0);
  for (uint32_t k = 0; list && k < map->segment_count; ++k)
    if (!py_append(list, PyUnicode_FromString(map->segment[k].name))) Py_CLEAR(list);
  return list;
}

static PyObject *get_diagnosis(PyObject *self, void *unused) {
  (void)unused;
  const py_leg *leg = (py_leg *)self;
  if (!leg->is_case) Py_RETURN_NONE;
  return PyUnicode_FromString(leg->patient.diagnosis);
}

// Skin at rest as two lists of triples: vertices in metres, faces.
static PyObject *skin(PyObject *self, PyObject *unused) {
  (void)unused;
  const sonde_mesh *mesh = &((py_leg *)self)->setup.model->surface;
  const Py_ssize_t points[] = {mesh->vertex_count, 3}, faces[] = {mesh->face_count, 3};
  PyObject *a = py_rows(self, mesh->vertices, "d", 2, points);
  PyObject *b = a ? py_rows(self, mesh->faces, "I", 2, faces) : NULL;
  if (!b) Py_CLEAR(a);
  return b ? Py_BuildValue("(NN)", a, b) : NULL;
}

static PyObject *save(PyObject *self, PyObject *path) {
  PyObject *keep = NULL;
  const char *name = py_path(path, &keep);
  if (!name) return NULL;
  sonde_error error = {0};
  sonde_status status = sonde_model_save(((py_leg *)self)->setup.model, name, &error);
  Py_DECREF(keep);
  if (status) return py_raise(&error);
  Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"limb", (PyCFunction)(void (*)(void))limb, METH_CLASS | METH_VARARGS | METH_KEYWORDS,
     "limb(seed=1, **body): a healthy synthetic limb; body: sex, side, bmi, stature_cm, ..."},
    {"load", load, METH_CLASS | METH_O, "load(path): the healthy leg of a model file"},
    {"case", (PyCFunction)(void (*)(void))of_case, METH_CLASS | METH_VARARGS | METH_KEYWORDS,
     "case(path, bundled=None): the leg of a case with its findings"},
    {"save", save, METH_O, "save(path): writes the model file"},
    {"skin", skin, METH_NOARGS, "skin(): vertices (m) and faces of the skin at rest"},
    {0}};

static PyGetSetDef members[] = {
    {"name", get_name, NULL, "name of the model", NULL},
    {"nodes", get_nodes, NULL, "nodes of the skin", NULL},
    {"places", get_places, NULL, "name of a place: pose of a probe on the skin there", NULL},
    {"vein", get_vein, NULL, "points of the main vein from the groin down", NULL},
    {"segments", get_segments, NULL, "segments that get a finding", NULL},
    {"diagnosis", get_diagnosis, NULL, "of a case, in words", NULL},
    {0}};

bool py_leg_add(PyObject *module) {
  const py_class leg = {.name = "Leg",
                        .doc = "A leg: its model, its veins, and what is ill in them.",
                        .size = sizeof(py_leg),
                        .release = release,
                        .methods = methods,
                        .members = members};
  py_leg_type = py_add_class(module, &leg);
  return py_leg_type != NULL;
}
