// What every test of the base room needs; cmocka.h wants the first three before it.
#ifndef SONDE_TESTS_BASE_TEST_H
#define SONDE_TESTS_BASE_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "base/base.h"

#include <string.h>

#endif
