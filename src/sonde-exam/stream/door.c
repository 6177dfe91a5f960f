// A class's door: opening, closing, and what the program tells it.
#include "stream/door.h"

#include "stream/port.h"

#include <string.h>
#include <unistd.h>

sonde_status sonde_door_open(const sonde_door_def *def, sonde_door **door_out, sonde_error *error) {
  SONDE_ASSERT(def && door_out && def->address && def->identity && def->join && def->places > 0);
  SONDE_ASSERT(!def->learner_tokens == !def->follow);
  *door_out = NULL;
  if (!def->code || strlen(def->code) != SONDE_DOOR_CODE - 1 ||
      !sonde_page_token_valid(def->teacher_token))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a class's code has %d characters, a teacher's token %d digits from 0-9a-f",
                      SONDE_DOOR_CODE - 1, SONDE_PAGE_TOKEN - 1);
  sonde_door *door = SONDE_NEW(sonde_door, 1);
  if (door) door->ticket = SONDE_NEW(door_ticket, def->places);
  if (!door || !door->ticket) {
    sonde_free(door);
    return sonde_fail_memory(error);
  }
  door->def = *def;
  atomic_store(&door->ask_s, 10);
  atomic_store(&door->code_s, 1);
  snprintf(door->code, sizeof door->code, "%s", def->code);
  snprintf(door->teacher_token, sizeof door->teacher_token, "%s", def->teacher_token);
  door->port = def->port;
  door->listener = door->wake = -1;
  pthread_mutex_init(&door->lock, NULL);
  for (int i = 0; i < DOOR_CONNECTIONS; ++i) door->connection[i].socket = -1;
  door->context = door_context_make(def->identity, error);
  sonde_status status = door->context ? stream_port_open(def->address, &door->port, &door->listener,
                                                         &door->wake, error)
                                      : SONDE_ARGUMENT;
  door->def.address = door->def.identity = door->def.code = door->def.teacher_token = NULL;
  if (!status) {
    door->runs = pthread_create(&door->thread, NULL, door_run, door) == 0;
    if (!door->runs) status = sonde_fail(error, SONDE_MEMORY, "a thread could not start");
  }
  if (status)
    sonde_door_close(door);
  else
    *door_out = door;
  return status;
}

uint16_t sonde_door_port(const sonde_door *door) {
  SONDE_ASSERT(door);
  return door->port;
}

uint64_t sonde_door_wrong(sonde_door *door) { return atomic_load(&door->wrong); }

sonde_status sonde_door_publish(sonde_door *door, sonde_door_text which, const char *text,
                                sonde_error *error) {
  SONDE_ASSERT(door && text && which < SONDE_DOOR_TEXTS);
  size_t size = strlen(text) + 1;
  char *copy = SONDE_NEW(char, size);
  if (!copy) return sonde_fail_memory(error);
  memcpy(copy, text, size);
  pthread_mutex_lock(&door->lock);
  char *old = door->text[which];
  door->text[which] = copy;
  pthread_mutex_unlock(&door->lock);
  sonde_free(old);
  return SONDE_OK;
}

void sonde_door_close(sonde_door *door) {
  if (!door) return;
  if (door->runs) {
    atomic_store(&door->stopping, true);
    stream_port_wake(door->wake);
    pthread_join(door->thread, NULL);
  }
  if (door->listener >= 0) close(door->listener);
  if (door->wake >= 0) close(door->wake);
  SSL_CTX_free(door->context);
  sonde_free(door->ticket);
  for (int i = 0; i < SONDE_DOOR_TEXTS; ++i) sonde_free(door->text[i]);
  pthread_mutex_destroy(&door->lock);
  sonde_free(door);
}
