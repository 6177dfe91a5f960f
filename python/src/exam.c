// An examination of one environment of a batch: places of a protocol, judgement, score.
#include "module.h"

#include <math.h>
#include <string.h>

PyTypeObject *py_exam_type;

typedef struct py_exam {
  PyObject ob_base;
  PyObject *leg;
  sonde_plan plan;
  sonde_judge *judge;
} py_exam;

static py_exam *self_of(PyObject *self) { return (py_exam *)self; }
static const sonde_case_setup *setup_of(const py_exam *exam) {
  return &((py_leg *)exam->leg)->setup;
}

static void release(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  sonde_judge_destroy(self_of(self)->judge);
  Py_XDECREF(self_of(self)->leg);
  PyObject_Free(self);
  Py_DECREF(type);
}

static PyObject *create(PyTypeObject *type, PyObject *args, PyObject *words) {
  static char *names[] = {"leg", "protocol", NULL};
  PyObject *leg, *protocol, *keep = NULL;
  if (!PyArg_ParseTupleAndKeywords(args, words, "OO:Exam", names, &leg, &protocol)) return NULL;
  if (!PyObject_TypeCheck(leg, py_leg_type) || !((py_leg *)leg)->is_case) {
    PyErr_SetString(PyExc_TypeError, "leg: expected a Leg made by Leg.case()");
    return NULL;
  }
  const char *path = py_path(protocol, &keep);
  if (!path) return NULL;
  py_exam *self = (py_exam *)PyType_GenericAlloc(type, 0);
  sonde_exam_protocol *read = PyMem_Calloc(1, sizeof *read);
  sonde_status status = SONDE_MEMORY;
  sonde_error error = {.status = SONDE_MEMORY};
  if (self && read) {
    Py_INCREF(leg);
    self->leg = leg;
    const sonde_case_setup *setup = setup_of(self);
    Py_BEGIN_ALLOW_THREADS;
    status = sonde_exam_protocol_load(path, read, &error);
    if (!status) status = sonde_plan_make(read, &setup->map, &self->plan, &error);
    if (!status) status = sonde_plan_find_targets(&self->plan, setup, NULL, &error);
    if (!status) status = sonde_judge_create(&setup->map, &self->plan, &self->judge, &error);
    Py_END_ALLOW_THREADS;
  }
  PyMem_Free(read);
  Py_DECREF(keep);
  if (!status) return (PyObject *)self;
  Py_XDECREF((PyObject *)self);
  return py_raise(&error);
}

// A new examination on the same plan.
static PyObject *restart(PyObject *from, PyObject *unused) {
  (void)unused;
  py_exam *self = self_of(from);
  sonde_judge *fresh = NULL;
  sonde_error error = {0};
  if (sonde_judge_create(&setup_of(self)->map, &self->plan, &fresh, &error))
    return py_raise(&error);
  sonde_judge_destroy(self->judge);
  self->judge = fresh;
  Py_RETURN_NONE;
}

static PyObject *feed(PyObject *from, PyObject *args) {
  py_exam *self = self_of(from);
  PyObject *batch;
  unsigned index;
  if (!PyArg_ParseTuple(args, "OI:feed", &batch, &index)) return NULL;
  if (!PyObject_TypeCheck(batch, py_batch_type) || index >= ((py_batch *)batch)->def.count ||
      PyTuple_GetItem(((py_batch *)batch)->legs,
                      index % (Py_ssize_t)PyTuple_Size(((py_batch *)batch)->legs)) != self->leg) {
    PyErr_SetString(PyExc_ValueError, "expected a batch and an environment of the exam's leg");
    return NULL;
  }
  if (!sonde_judge_feed(self->judge, sonde_batch_snapshot(((py_batch *)batch)->batch, index)))
    return PyErr_NoMemory();
  Py_RETURN_NONE;
}

static PyObject *guidance(PyObject *from, PyObject *unused) {
  (void)unused;
  py_exam *self = self_of(from);
  const sonde_vein_map *map = &setup_of(self)->map;
  sonde_guidance g = sonde_judge_guidance(self->judge);
  PyObject *dict = PyDict_New();
  bool more = g.point < self->plan.count;
  bool good = dict && py_set(dict, "text", PyUnicode_FromString(g.text)) &&
              py_set(dict, "firm_n", PyFloat_FromDouble(g.force.firm_n)) &&
              py_set(dict, "limit_n", PyFloat_FromDouble(g.force.limit_n)) &&
              py_set(dict, "point", more ? PyLong_FromUnsignedLong(g.point) : Py_NewRef(Py_None));
  if (good)
    good = py_set(dict, "undecided",
                  g.undecided < map->segment_count
                      ? PyUnicode_FromString(map->segment[g.undecided].name)
                      : Py_NewRef(Py_None));
  if (good) return dict;
  Py_XDECREF(dict);
  return NULL;
}

static PyObject *places(PyObject *from, void *unused) {
  (void)unused;
  py_exam *self = self_of(from);
  const sonde_vein_map *map = &setup_of(self)->map;
  PyObject *list = PyList_New(0);
  for (uint32_t k = 0; list && k < self->plan.count; ++k) {
    const sonde_plan_point *p = &self->plan.point[k];
    PyObject *row = PyDict_New();
    bool good = row && py_set(row, "title", PyUnicode_FromString(p->title)) &&
                py_set(row, "segment", PyUnicode_FromString(map->segment[p->segment].name)) &&
                py_set(row, "pose", py_make_pose(sonde_vein_pose(&p->at, 0))) &&
                py_set(row, "closes_n", PyFloat_FromDouble(p->target.closes_n)) &&
                py_set(row, "firm_n", PyFloat_FromDouble(p->target.firm_n)) &&
                py_set(row, "limit_n", PyFloat_FromDouble(p->target.limit_n));
    if (!good) Py_CLEAR(row);
    if (!py_append(list, row)) Py_CLEAR(list);
  }
  return list;
}

// What each segment of the plan is like so far.
static PyObject *segments(PyObject *from, PyObject *unused) {
  (void)unused;
  py_exam *self = self_of(from);
  const sonde_vein_map *map = &setup_of(self)->map;
  PyObject *dict = PyDict_New();
  for (uint32_t k = 0; dict && k < map->segment_count; ++k) {
    sonde_segment_status s = sonde_judge_segment(self->judge, k);
    if (!s.needed) continue;
    PyObject *row = PyDict_New();
    bool good = row && py_set(row, "places", PyLong_FromUnsignedLong(s.points)) &&
                py_set(row, "done", PyLong_FromUnsignedLong(s.done)) &&
                py_set(row, "open", PyLong_FromUnsignedLong(s.open)) &&
                py_set(row, "decision", PyUnicode_FromString(sonde_decision_name(s.decision))) &&
                PyDict_SetItemString(dict, map->segment[k].name, row) == 0;
    if (!good) Py_CLEAR(dict);
    Py_XDECREF(row);
  }
  return dict;
}

static PyObject *decide(PyObject *from, PyObject *args) {
  py_exam *self = self_of(from);
  const char *segment, *name;
  if (!PyArg_ParseTuple(args, "ss:decide", &segment, &name)) return NULL;
  sonde_decision decision;
  sonde_error error = {0};
  if (!sonde_decision_parse(name, &decision)) {
    PyErr_Format(PyExc_ValueError,
                 "decision: expected 'compressible', 'clot' or 'not_seen', but got '%s'", name);
    return NULL;
  }
  uint32_t at = sonde_vein_segment(&setup_of(self)->map, segment);
  if (sonde_judge_decide(self->judge, at, decision, &error)) return py_raise(&error);
  Py_RETURN_NONE;
}

static PyObject *score(PyObject *from, PyObject *unused) {
  (void)unused;
  py_exam *self = self_of(from);
  sonde_score result;
  if (!sonde_judge_finish(self->judge)) return PyErr_NoMemory();
  sonde_judge_score(self->judge, &((py_leg *)self->leg)->patient, &result);
  PyObject *dict = PyDict_New();
  bool good = dict && py_set(dict, "score", PyFloat_FromDouble(result.score)) &&
              py_set(dict, "passed", PyBool_FromLong(result.passed)) &&
              py_set(dict, "correct", PyBool_FromLong(result.correct)) &&
              py_set(dict, "thrombosis", PyBool_FromLong(result.thrombosis)) &&
              py_set(dict, "summary", PyUnicode_FromString(result.summary));
#define PART(name, weight, title, text)                                                            \
  good = good && py_set(dict, #name, PyFloat_FromDouble(result.name));
  SONDE_SCORE_LIST(PART)
#undef PART
  if (good) return dict;
  Py_XDECREF(dict);
  return NULL;
}

static PyMethodDef methods[] = {
    {"restart", restart, METH_NOARGS, "restart(): a new examination on the same plan"},
    {"feed", feed, METH_VARARGS, "feed(batch, index): what the environment shows now"},
    {"guidance", guidance, METH_NOARGS, "guidance(): what to do next"},
    {"segments", segments, METH_NOARGS, "segments(): places, done, open, decision of each"},
    {"decide", decide, METH_VARARGS, "decide(segment, 'compressible'|'clot'|'not_seen')"},
    {"score", score, METH_NOARGS, "score(): points out of 100 and their parts"},
    {0}};
static PyGetSetDef members[] = {
    {"places", places, NULL, "places of the plan with their forces", NULL}, {0}};

bool py_exam_add(PyObject *module) {
  const py_class exam = {.name = "Exam",
                         .doc = "Exam(leg, protocol): the judge of an examination.",
                         .size = sizeof(py_exam),
                         .create = create,
                         .release = release,
                         .methods = methods,
                         .members = members};
  py_exam_type = py_add_class(module, &exam);
  return py_exam_type != NULL;
}
