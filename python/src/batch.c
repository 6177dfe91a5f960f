// Batches of legs under probes.
#include "module.h"

#include <string.h>

PyTypeObject *py_batch_type;

static py_batch *self_of(PyObject *self) { return (py_batch *)self; }

static void release(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  sonde_batch_destroy(self_of(self)->batch);
  Py_XDECREF(self_of(self)->legs);
  PyObject_Free(self);
  Py_DECREF(type);
}

// Legs as a tuple; one leg counts as a sequence of one.
static PyObject *legs_of(PyObject *legs) {
  if (PyObject_TypeCheck(legs, py_leg_type)) return PyTuple_Pack(1, legs);
  PyObject *tuple = PySequence_Tuple(legs);
  for (Py_ssize_t k = 0; tuple && k < PyTuple_Size(tuple); ++k)
    if (!PyObject_TypeCheck(PyTuple_GetItem(tuple, k), py_leg_type)) {
      PyErr_SetString(PyExc_TypeError, "legs: expected a Leg or a sequence of them");
      Py_CLEAR(tuple);
    }
  return tuple;
}

static bool find_drive(const char *name, sonde_batch_drive *drive) {
  for (int k = 0; k < SONDE_BATCH_DRIVES; ++k) {
    *drive = (sonde_batch_drive)k;
    if (strcmp(sonde_batch_drive_name(*drive), name) == 0) return true;
  }
  PyErr_Format(PyExc_ValueError, "drive: expected 'pose', 'twist' or 'force', but got '%s'", name);
  return false;
}

static PyObject *create(PyTypeObject *type, PyObject *args, PyObject *words) {
  static char *names[] = {"legs",    "count",   "probe",         "drive",      "ticks",
                          "threads", "inside",  "size",          "scanner",    "friction",
                          "speed",   "turning", "force_limit_n", "admittance", NULL};
  sonde_batch_def def = sonde_batch_def_default();
  PyObject *legs, *scanner = Py_None, *size = Py_None, *keep = NULL;
  const char *drive = "twist";
  unsigned count = 0;
  int inside = 1;
  if (!PyArg_ParseTupleAndKeywords(args, words, "O|IssIIpOOddddd:Batch", names, &legs, &count,
                                   &def.probe, &drive, &def.ticks_per_step, &def.threads, &inside,
                                   &size, &scanner, &def.friction.mu_static, &def.speed_m_s,
                                   &def.speed_rad_s, &def.force_limit_n, &def.admittance_m_s_n))
    return NULL;
  if (!find_drive(drive, &def.drive)) return NULL;
  if (size != Py_None && !PyArg_ParseTuple(size, "II:size", &def.width, &def.height)) return NULL;
  def.friction.mu_kinetic = def.friction.mu_static;
  def.inside = inside;
  PyObject *tuple = legs_of(legs);
  if (!tuple) return NULL;
  py_batch *self = (py_batch *)PyType_GenericAlloc(type, 0);
  if (!self) {
    Py_DECREF(tuple);
    return NULL;
  }
  self->legs = tuple;
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  if (scanner != Py_None) {
    const char *path = py_path(scanner, &keep);
    if (!path) {
      Py_DECREF((PyObject *)self);
      return NULL;
    }
    status = sonde_scanner_load(path, &self->scanner, NULL, 0, &error);
    def.scanner = &self->scanner;
    Py_DECREF(keep);
  }
  uint32_t patients = (uint32_t)PyTuple_Size(tuple);
  def.count = count ? count : patients;
  def.patient_count = patients;
  const sonde_case_setup **setups = PyMem_Calloc(patients ? patients : 1, sizeof *setups);
  for (uint32_t k = 0; setups && k < patients; ++k)
    setups[k] = &((py_leg *)PyTuple_GetItem(tuple, k))->setup;
  def.patients = setups;
  if (!setups) status = SONDE_MEMORY;
  Py_BEGIN_ALLOW_THREADS;
  if (!status) status = sonde_batch_create(&def, &self->batch, &error);
  Py_END_ALLOW_THREADS;
  PyMem_Free(setups);
  self->def = def;
  self->def.patients = NULL, self->def.scanner = NULL, self->def.probe = NULL;
  if (!status) return (PyObject *)self;
  Py_DECREF((PyObject *)self);
  error.status = status;
  return py_raise(&error);
}

static bool read_index(const py_batch *self, unsigned index) {
  if (index < self->def.count) return true;
  PyErr_Format(PyExc_IndexError, "environment %u, expected less than %u", index, self->def.count);
  return false;
}

static PyObject *reset(PyObject *from, PyObject *args, PyObject *words) {
  static char *names[] = {"index",       "pose",      "pathology",     "extent_m",
                          "venous_mmhg", "stiffness", "damping",       "friction",
                          "gain_db",     "depth_mm",  "frequency_mhz", NULL};
  py_batch *self = self_of(from);
  const double nan_value = Py_HUGE_VAL - Py_HUGE_VAL;
  unsigned index;
  PyObject *pose = Py_None, *extent = Py_None;
  const char *pathology = NULL;
  double mmhg = nan_value, gain = nan_value, depth = nan_value, frequency = nan_value;
  double stiffness = 1, damping = 1, friction = 1;
  if (!PyArg_ParseTupleAndKeywords(args, words, "I|OzOddddddd:reset", names, &index, &pose,
                                   &pathology, &extent, &mmhg, &stiffness, &damping, &friction,
                                   &gain, &depth, &frequency) ||
      !read_index(self, index))
    return NULL;
  sonde_error error = {0};
  sonde_batch_start start = sonde_batch_start_default(self->batch, index);
  start.stiffness_scale = stiffness, start.damping_scale = damping;
  start.friction_scale = friction;
  if (pose != Py_None && !py_read_pose(pose, &start.world_from_probe)) return NULL;
  if (pathology && sonde_pathology_preset(pathology, &start.pathology, &error))
    return py_raise(&error);
  if (extent != Py_None &&
      !PyArg_ParseTuple(extent, "dd:extent_m", &start.pathology.thrombus_from_m,
                        &start.pathology.thrombus_to_m))
    return NULL;
  if (mmhg == mmhg) start.pathology.venous_pressure_pa = mmhg * SONDE_PA_PER_MMHG;
  if (gain == gain) start.settings.gain_db = gain;
  if (depth == depth) start.settings.depth_m = depth * 1e-3;
  if (frequency == frequency) start.settings.frequency_hz = frequency * 1e6;
  sonde_status status;
  Py_BEGIN_ALLOW_THREADS;
  status = sonde_batch_reset(self->batch, index, &start, &error);
  Py_END_ALLOW_THREADS;
  if (status) return py_raise(&error);
  Py_RETURN_NONE;
}

// A buffer of so many items of one format, C-contiguous. @return false with an exception
static bool get_items(PyObject *from, const char *name, const char *format, Py_ssize_t bytes,
                      Py_buffer *view) {
  if (PyObject_GetBuffer(from, view, PyBUF_FORMAT | PyBUF_C_CONTIGUOUS)) return false;
  const char *given = view->format ? view->format : "B";
  if (view->len == bytes && strchr(format, given[0]) && !given[1]) return true;
  PyErr_Format(PyExc_ValueError, "%s: expected %zd bytes of type '%c', but got %zd of '%s'", name,
               bytes, format[0], view->len, given);
  PyBuffer_Release(view);
  return false;
}

static PyObject *step(PyObject *from, PyObject *args, PyObject *words) {
  static char *names[] = {"actions", "mask", NULL};
  py_batch *self = self_of(from);
  PyObject *actions, *mask = Py_None;
  if (!PyArg_ParseTupleAndKeywords(args, words, "O|O:step", names, &actions, &mask)) return NULL;
  const Py_ssize_t count = self->def.count;
  Py_buffer numbers, kept = {0};
  if (!get_items(actions, "actions", "d", 8 * SONDE_BATCH_ACTION * count, &numbers)) return NULL;
  if (mask != Py_None && !get_items(mask, "mask", "?Bb", count, &kept)) {
    PyBuffer_Release(&numbers);
    return NULL;
  }
  sonde_error error = {0};
  sonde_status status;
  Py_BEGIN_ALLOW_THREADS;
  status = sonde_batch_step(self->batch, numbers.buf, kept.buf, &error);
  Py_END_ALLOW_THREADS;
  PyBuffer_Release(&numbers);
  if (mask != Py_None) PyBuffer_Release(&kept);
  if (status) return py_raise(&error);
  Py_RETURN_NONE;
}

static PyObject *save(PyObject *from, PyObject *args) {
  py_batch *self = self_of(from);
  unsigned index;
  if (!PyArg_ParseTuple(args, "I:save", &index) || !read_index(self, index)) return NULL;
  PyObject *bytes =
      PyBytes_FromStringAndSize(NULL, (Py_ssize_t)sonde_batch_size(self->batch, index));
  if (bytes) sonde_batch_save(self->batch, index, PyBytes_AsString(bytes));
  return bytes;
}

static PyObject *restore(PyObject *from, PyObject *args) {
  py_batch *self = self_of(from);
  unsigned index;
  Py_buffer blob;
  if (!PyArg_ParseTuple(args, "Iy*:restore", &index, &blob)) return NULL;
  sonde_error error = {0};
  sonde_status status = SONDE_ARGUMENT;
  bool there = read_index(self, index);
  if (there) status = sonde_batch_restore(self->batch, index, blob.buf, (size_t)blob.len, &error);
  PyBuffer_Release(&blob);
  if (!there) return NULL;
  if (status) return py_raise(&error);
  Py_RETURN_NONE;
}

static PyObject *start_pose(PyObject *from, PyObject *args) {
  unsigned index;
  if (!PyArg_ParseTuple(args, "I:start_pose", &index) || !read_index(self_of(from), index))
    return NULL;
  return py_make_pose(sonde_batch_start_default(self_of(from)->batch, index).world_from_probe);
}

static PyObject *hash_now(PyObject *self, PyObject *unused) {
  (void)unused;
  return PyLong_FromUnsignedLongLong(sonde_batch_hash(self_of(self)->batch));
}

// The arrays. The closure says which.
enum { ROW_POSE, ROW_WRENCH, ROW_VESSEL, ROW_TIME, ROW_FLAGS, ROW_IMAGES };
static char which[] = {ROW_POSE, ROW_WRENCH, ROW_VESSEL, ROW_TIME, ROW_FLAGS, ROW_IMAGES};

static PyObject *get_rows(PyObject *self, void *closure) {
  sonde_batch_view v = sonde_batch_look(self_of(self)->batch);
  Py_ssize_t shape[3] = {v.count, 1, 1};
  switch (*(char *)closure) {
  case ROW_POSE: shape[1] = SONDE_BATCH_POSE; return py_rows(self, v.pose, "d", 2, shape);
  case ROW_WRENCH: shape[1] = SONDE_BATCH_WRENCH; return py_rows(self, v.wrench, "d", 2, shape);
  case ROW_VESSEL: shape[1] = SONDE_BATCH_VESSEL; return py_rows(self, v.vessel, "d", 2, shape);
  case ROW_TIME: return py_rows(self, v.time_s, "d", 1, shape);
  case ROW_FLAGS: return py_rows(self, v.flags, "I", 1, shape);
  default: break;
  }
  if (!v.pixels) Py_RETURN_NONE;
  shape[1] = v.height, shape[2] = v.width;
  return py_rows(self, v.pixels, "B", 3, shape);
}

static PyObject *get_count(PyObject *self, void *unused) {
  (void)unused;
  return PyLong_FromUnsignedLong(self_of(self)->def.count);
}

static PyObject *get_names(PyObject *self, void *unused) {
  (void)self, (void)unused;
  PyObject *names = PyTuple_New(SONDE_BATCH_VESSEL);
  for (uint32_t k = 0; names && k < SONDE_BATCH_VESSEL; ++k) {
    PyObject *name = PyUnicode_FromString(sonde_batch_vessel_name(k));
    if (!name || PyTuple_SetItem(names, k, name)) Py_CLEAR(names);
  }
  return names;
}

static PyObject *get_extent(PyObject *self, void *unused) {
  (void)unused;
  sonde_batch_view v = sonde_batch_look(self_of(self)->batch);
  return Py_BuildValue("(dd)", v.width_m, v.height_m);
}

static PyMethodDef methods[] = {
    {"reset", (PyCFunction)(void (*)(void))reset, METH_VARARGS | METH_KEYWORDS,
     "reset(index, pose=None, pathology=None, extent_m=None, venous_mmhg=nan, stiffness=1, "
     "damping=1, friction=1, gain_db=nan, depth_mm=nan, frequency_mhz=nan)"},
    {"step", (PyCFunction)(void (*)(void))step, METH_VARARGS | METH_KEYWORDS,
     "step(actions, mask=None): actions are float64 of shape (count, 7)"},
    {"save", save, METH_VARARGS, "save(index): the environment as bytes"},
    {"restore", restore, METH_VARARGS, "restore(index, saved): goes on there, bit for bit"},
    {"start_pose", start_pose, METH_VARARGS, "start_pose(index): of the probe by default"},
    {"hash", hash_now, METH_NOARGS, "hash(): of motion and poses of all environments"},
    {0}};

static PyGetSetDef members[] = {
    {"count", get_count, NULL, "environments", NULL},
    {"pose", get_rows, NULL, "(count, 7) x y z (m), w x y z", &which[ROW_POSE]},
    {"wrench", get_rows, NULL, "(count, 6) N, N m on the probe, in its frame", &which[ROW_WRENCH]},
    {"vessel", get_rows, NULL, "(count, len(vessel_names))", &which[ROW_VESSEL]},
    {"time_s", get_rows, NULL, "(count,) since the reset", &which[ROW_TIME]},
    {"flags", get_rows, NULL, "(count,) trouble of the last step", &which[ROW_FLAGS]},
    {"images", get_rows, NULL, "(count, height, width) grey values; None without size",
     &which[ROW_IMAGES]},
    {"vessel_names", get_names, NULL, "columns of vessel", NULL},
    {"image_size_m", get_extent, NULL, "width and height of the picture", NULL},
    {0}};

bool py_batch_add(PyObject *module) {
  const py_class batch = {.name = "Batch",
                          .doc = "Many legs under many probes, stepped together.",
                          .size = sizeof(py_batch),
                          .create = create,
                          .release = release,
                          .methods = methods,
                          .members = members};
  py_batch_type = py_add_class(module, &batch);
  return py_batch_type != NULL;
}
