// An engine in one precision: its step.
#include "world/parts.c"

#include "world/contact_batches.c"

#include "world/respond.c"

#include "world/newton.c"
