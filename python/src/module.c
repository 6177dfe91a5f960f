// The module, its exceptions and what all its parts use.
#include "module.h"

#include <stdio.h>

PyObject *py_raise(const sonde_error *error) {
  PyObject *kind = PyExc_ValueError;
  switch (error->status) {
  case SONDE_MEMORY: return PyErr_NoMemory();
  case SONDE_IO:
  case SONDE_DISK: kind = PyExc_OSError; break;
  case SONDE_NOT_FOUND: kind = PyExc_LookupError; break;
  case SONDE_CONVERGENCE:
  case SONDE_CANCELLED: kind = PyExc_RuntimeError; break;
  default: break;
  }
  PyErr_SetString(kind, error->message[0] ? error->message : sonde_status_text(error->status));
  return NULL;
}

PyTypeObject *py_add_class(PyObject *module, const py_class *c) {
  // Slots are pointers to anything; C converts functions to those through a union only.
  union {
    PyObject *(*create)(PyTypeObject *, PyObject *, PyObject *);
    void (*release)(PyObject *);
    int (*buffer)(PyObject *, Py_buffer *, int);
    void *pointer;
  } create = {.create = c->create}, release = {.release = c->release},
    buffer = {.buffer = c->buffer};
  union { // the interpreter does not change the text
    const char *from;
    void *to;
  } doc = {.from = c->doc};
  const PyType_Slot all[] = {{Py_tp_new, create.pointer},       {Py_tp_dealloc, release.pointer},
                             {Py_bf_getbuffer, buffer.pointer}, {Py_tp_methods, c->methods},
                             {Py_tp_getset, c->members},        {Py_tp_doc, doc.to}};
  enum { SLOTS = sizeof all / sizeof *all };
  PyType_Slot used[SLOTS + 1] = {{0, NULL}};
  int count = 0;
  for (int k = 0; k < SLOTS; ++k)
    if (all[k].pfunc) used[count++] = all[k];
  char name[64];
  snprintf(name, sizeof name, "sonde._sonde.%s", c->name);
  const unsigned flags =
      c->create ? Py_TPFLAGS_DEFAULT : Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION;
  PyType_Spec spec = {name, (int)c->size, 0, flags, used};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type) return NULL;
  if (PyModule_AddObjectRef(module, c->name, type)) {
    Py_DECREF(type);
    return NULL;
  }
  return (PyTypeObject *)type;
}

bool py_set(PyObject *dict, const char *key, PyObject *value) {
  if (!value) return false;
  int failed = PyDict_SetItemString(dict, key, value);
  Py_DECREF(value);
  return failed == 0;
}

bool py_append(PyObject *list, PyObject *value) {
  if (!value) return false;
  int failed = PyList_Append(list, value);
  Py_DECREF(value);
  return failed == 0;
}

bool py_read_pose(PyObject *from, sonde_pose *pose) {
  double v[7];
  if (!PySequence_Check(from) || PySequence_Size(from) != 7) {
    PyErr_SetString(PyExc_ValueError, "a pose: expected 7 numbers, x y z in metres and a "
                                      "quaternion w x y z");
    return false;
  }
  for (int k = 0; k < 7; ++k) {
    PyObject *item = PySequence_GetItem(from, k);
    v[k] = item ? PyFloat_AsDouble(item) : -1;
    Py_XDECREF(item);
    if (PyErr_Occurred()) return false;
  }
  *pose = (sonde_pose){{v[0], v[1], v[2]}, {v[3], v[4], v[5], v[6]}};
  return true;
}

PyObject *py_make_pose(sonde_pose p) {
  return Py_BuildValue("(ddddddd)", p.position.x, p.position.y, p.position.z, p.rotation.w,
                       p.rotation.x, p.rotation.y, p.rotation.z);
}

PyObject *py_make_vec3(sonde_vec3 v) { return Py_BuildValue("(ddd)", v.x, v.y, v.z); }

const char *py_path(PyObject *path, PyObject **keep) {
  if (!PyUnicode_FSConverter(path, keep)) return NULL;
  return PyBytes_AsString(*keep);
}

static int fill(PyObject *module) {
  bool good = py_rows_add(module) && py_leg_add(module) && py_batch_add(module) &&
              py_exam_add(module) &&
              !PyModule_AddStringConstant(module, "__version__", sonde_version());
  return good ? 0 : -1;
}

PyMODINIT_FUNC PyInit__sonde(void);
PyMODINIT_FUNC PyInit__sonde(void) {
  static PyModuleDef_Slot slots[] = {{Py_mod_exec, NULL}, {0, NULL}};
  static struct PyModuleDef definition = {.m_base = PyModuleDef_HEAD_INIT,
                                          .m_name = "_sonde",
                                          .m_doc = "The C part of the package sonde.",
                                          .m_methods = py_functions,
                                          .m_slots = slots};
  union {
    int (*call)(PyObject *);
    void *pointer;
  } exec = {.call = fill};
  slots[0].value = exec.pointer;
  return PyModuleDef_Init(&definition);
}
