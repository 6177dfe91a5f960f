// The Python module sonde._sonde: legs, batches, exams, and what is asked of a leg at rest.
#ifndef SONDE_PYTHON_MODULE_H
#define SONDE_PYTHON_MODULE_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000 // one binary for CPython 3.11 and later
#include <Python.h>

#include "sonde/sonde.h"
#include "sonde/batch.h"

// A leg with its veins and what is ill in them.
typedef struct py_leg {
  PyObject ob_base;
  sonde_case_setup setup;
  sonde_case patient; // of a case
  bool is_case;
} py_leg;

typedef struct py_batch {
  PyObject ob_base;
  sonde_batch *batch;
  PyObject *legs; // tuple of py_leg
  sonde_batch_def def;
  sonde_scanner scanner;
} py_batch;

// The types of the module, made when it is loaded.
extern PyTypeObject *py_leg_type, *py_batch_type, *py_rows_type, *py_exam_type;
bool py_leg_add(PyObject *module);
bool py_batch_add(PyObject *module);
bool py_rows_add(PyObject *module);
bool py_exam_add(PyObject *module);
extern PyMethodDef py_functions[];

// An array of a batch as a buffer: no copy, and the batch stays alive as long as it is used.
// @param format as in the struct module: d, I, B @param shape [dimensions] at most 3
PyObject *py_rows(PyObject *owner, const void *data, const char *format, int dimensions,
                  const Py_ssize_t *shape);

// A healthy leg from its model, which moves into it, or is destroyed on failure.
PyObject *py_healthy(sonde_model *model);

// Raises the exception that fits a status: ValueError, LookupError, OSError, MemoryError or
// RuntimeError. @return NULL
PyObject *py_raise(const sonde_error *error);

// A type of the module: what is NULL it has not; without `create` Python code makes none.
typedef struct py_class {
  const char *name, *doc;
  size_t size;
  PyObject *(*create)(PyTypeObject *, PyObject *, PyObject *);
  void (*release)(PyObject *);
  int (*buffer)(PyObject *, Py_buffer *, int);
  PyMethodDef *methods;
  PyGetSetDef *members;
} py_class;
// Makes a type and puts it into the module. @return NULL with an exception
PyTypeObject *py_add_class(PyObject *module, const py_class *description);
// Seven numbers x y z (m), w x y z. @return false with an exception
bool py_read_pose(PyObject *from, sonde_pose *pose);
PyObject *py_make_pose(sonde_pose pose);
PyObject *py_make_vec3(sonde_vec3 v);
// Sets a key and releases the value; false when the value is NULL or on failure.
bool py_set(PyObject *dict, const char *key, PyObject *value);
// Appends a value and releases it; false when the value is NULL or on failure.
bool py_append(PyObject *list, PyObject *value);
// A path as a C string of the object `*keep`, which the caller releases. NULL with an exception
const char *py_path(PyObject *path, PyObject **keep);

#endif
