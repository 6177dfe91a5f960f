// Arrays of a batch as buffers of Python.
#include "module.h"

#include <string.h>

enum { MOST_DIMENSIONS = 3 };

typedef struct py_rows_object {
  PyObject ob_base;
  PyObject *owner;
  const void *data;
  char format[2];
  int dimensions;
  Py_ssize_t item, shape[MOST_DIMENSIONS], stride[MOST_DIMENSIONS];
} py_rows_object;

PyTypeObject *py_rows_type;

PyObject *py_rows(PyObject *owner, const void *data, const char *format, int dimensions,
                  const Py_ssize_t *shape) {
  py_rows_object *rows = (py_rows_object *)PyType_GenericAlloc(py_rows_type, 0);
  if (!rows) return NULL;
  Py_INCREF(owner);
  rows->owner = owner;
  rows->data = data;
  rows->format[0] = format[0];
  rows->dimensions = dimensions;
  rows->item = format[0] == 'd' ? 8 : format[0] == 'I' ? 4 : 1;
  for (int k = dimensions - 1; k >= 0; --k) {
    rows->shape[k] = shape[k];
    rows->stride[k] = k + 1 < dimensions ? rows->stride[k + 1] * shape[k + 1] : rows->item;
  }
  return (PyObject *)rows;
}

static int get_buffer(PyObject *self, Py_buffer *view, int flags) {
  py_rows_object *rows = (py_rows_object *)self;
  if (flags & PyBUF_WRITABLE) {
    PyErr_SetString(PyExc_BufferError, "what a batch shows is read only");
    return -1;
  }
  memset(view, 0, sizeof *view);
  union { // Py_buffer has no const
    const void *from;
    void *to;
  } data = {.from = rows->data};
  view->buf = data.to;
  view->itemsize = rows->item;
  view->len = rows->stride[0] * rows->shape[0];
  view->readonly = 1;
  view->format = flags & PyBUF_FORMAT ? rows->format : NULL;
  view->ndim = rows->dimensions;
  view->shape = rows->shape;
  view->strides = rows->stride;
  Py_INCREF(self);
  view->obj = self;
  return 0;
}

static void release(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  Py_XDECREF(((py_rows_object *)self)->owner);
  PyObject_Free(self);
  Py_DECREF(type);
}

bool py_rows_add(PyObject *module) {
  const py_class rows = {.name = "Rows",
                         .doc = "An array of a batch, read only; numpy.asarray() makes a view.",
                         .size = sizeof(py_rows_object),
                         .release = release,
                         .buffer = get_buffer};
  py_rows_type = py_add_class(module, &rows);
  return py_rows_type != NULL;
}
