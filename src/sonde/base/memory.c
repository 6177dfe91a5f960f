// The memory hook: every allocation of the library goes through here.
#include "base/base.h"

#include <string.h>

static void *allocate_default(size_t bytes, void *user) {
  (void)user;
  return malloc(bytes);
}
static void release_default(void *pointer, void *user) {
  (void)user;
  free(pointer);
}

static sonde_allocator hook = {allocate_default, release_default, NULL};

void sonde_set_allocator(const sonde_allocator *allocator) {
  hook = (sonde_allocator){allocate_default, release_default, NULL};
  if (!allocator) return;
  if (allocator->allocate) hook.allocate = allocator->allocate;
  if (allocator->release) hook.release = allocator->release;
  hook.user = allocator->user;
}

void *sonde_calloc(size_t count, size_t size) {
  size_t bytes;
  if (__builtin_mul_overflow(count, size, &bytes)) return NULL;
  if (bytes == 0) bytes = 1;
  // The system's pages hold zeros and come when they are touched: most of the room for the largest
  // factor of a model is never used.
  if (hook.allocate == allocate_default) return calloc(1, bytes);
  void *pointer = hook.allocate(bytes, hook.user);
  SONDE_ASSERT(((uintptr_t)pointer & (sizeof(double) - 1)) == 0); // the hook keeps alignment
  if (pointer) memset(pointer, 0, bytes);
  return pointer;
}

void *sonde_realloc(void *pointer, size_t old_bytes, size_t new_bytes) {
  SONDE_ASSERT(pointer || old_bytes == 0);
  void *grown = sonde_calloc(1, new_bytes);
  if (!grown) return NULL;
  if (pointer) memcpy(grown, pointer, old_bytes < new_bytes ? old_bytes : new_bytes);
  sonde_free(pointer);
  return grown;
}

void sonde_free(void *pointer) {
  if (pointer) hook.release(pointer, hook.user);
}
