// Who controls the probe. The learner is the owner: the client with the learner's token that came
// first. A teacher may take control and gives it back; the learner may lend it to another. An owner
// that is gone (a reload, a lost connection) is waited for and recognised by its id; meanwhile
// another may stand in, and after that the next watcher is the owner. Who came with the watcher's
// token only watches.
#include "stream/page_server.h"

#include "base/clock.h"

#include <string.h>

static bool is_owner(const page_client *client) { return client->server->owner == client; }

bool page_client_controls(const page_client *client) {
  const sonde_page_server *server = client->server;
  return server->borrower ? server->borrower == client : is_owner(client);
}

// The first of the others to come that is or is not a teacher; NULL: none.
static page_client *first_other(sonde_page_server *server, const page_client *self, bool teacher) {
  page_client *first = NULL;
  for (int i = 0; i < PAGE_CLIENTS; ++i) {
    page_client *other = &server->client[i];
    if (!other->here || other == self || other->teacher != teacher || other->guest) continue;
    if (!first || other->joined < first->joined) first = other;
  }
  return first;
}

static page_may may(const page_client *client) {
  sonde_page_server *server = client->server;
  if (client->guest) return PAGE_MAY_NOTHING;
  bool owner = is_owner(client);
  if (page_client_controls(client)) {
    if (!owner) return server->owner ? PAGE_MAY_RETURN : PAGE_MAY_NOTHING;
    bool alone = !first_other(server, client, true) && !first_other(server, client, false);
    return alone ? PAGE_MAY_NOTHING : PAGE_MAY_GIVE;
  }
  if (client->teacher) return PAGE_MAY_TAKE;
  if (owner) return server->borrower->teacher ? PAGE_MAY_NOTHING : PAGE_MAY_TAKE;
  return server->owner || server->borrower ? PAGE_MAY_NOTHING : PAGE_MAY_TAKE;
}

page_role page_client_role(const page_client *client) {
  const sonde_page_server *server = client->server;
  const page_client *holder = server->borrower ? server->borrower : server->owner;
  return (page_role){.controls = page_client_controls(client),
                     .may = may(client),
                     .is = client->teacher    ? PAGE_TEACHER
                           : is_owner(client) ? PAGE_LEARNER
                                              : PAGE_WATCHER,
                     .holder = !holder            ? PAGE_NOBODY
                               : holder->teacher  ? PAGE_TEACHER
                               : is_owner(holder) ? PAGE_LEARNER
                                                  : PAGE_WATCHER};
}

static void make_owner(sonde_page_server *server, page_client *client) {
  SONDE_ASSERT(client->here && !client->teacher);
  server->owner = client;
  server->owner_until_s = 0;
  memcpy(server->owner_id, client->id, sizeof server->owner_id);
  if (server->borrower == client) server->borrower = NULL;
}

static bool awaited(const sonde_page_server *server) {
  return sonde_clock_now() < server->owner_until_s;
}

// While the learner is awaited another may stand in: the learner's id is kept.
static void stand_in(sonde_page_server *server, page_client *client) {
  SONDE_ASSERT(client->here && !client->teacher && !server->owner);
  if (!awaited(server)) make_owner(server, client);
  server->owner = client;
}

static bool stands_in(const sonde_page_server *server) {
  return server->owner && awaited(server) && strcmp(server->owner->id, server->owner_id) != 0;
}

void page_roles_join(page_client *client) {
  sonde_page_server *server = client->server;
  SONDE_ASSERT(client->here && memchr(client->id, 0, sizeof client->id));
  if (client->teacher || client->guest) return;
  bool known = client->id[0] && strcmp(client->id, server->owner_id) == 0;
  bool alone = !first_other(server, client, false);
  if (known && (!server->owner || stands_in(server)))
    make_owner(server, client);
  else if (!server->owner && (alone || !awaited(server)))
    stand_in(server, client);
}

void page_roles_turn(sonde_page_server *server) {
  if (awaited(server)) return;
  page_client *next = server->owner ? server->owner : first_other(server, NULL, false);
  if (next && (next != server->owner || strcmp(next->id, server->owner_id) != 0))
    make_owner(server, next);
}

void page_roles_leave(page_client *client, double heard_s) {
  sonde_page_server *server = client->server;
  SONDE_ASSERT(client->here);
  bool stood_in = stands_in(server);
  client->here = false;
  if (server->borrower == client) server->borrower = NULL;
  if (!is_owner(client)) return;
  server->owner = NULL;
  // An owner without an id could not be recognised: nothing to wait for.
  if (!stood_in) server->owner_until_s = client->id[0] ? heard_s + server->patience.return_s : 0;
  for (int i = 0; i < PAGE_CLIENTS && !server->owner;
       ++i) { // the same page, connected again already
    page_client *other = &server->client[i];
    if (other->here && client->id[0] && strcmp(other->id, client->id) == 0)
      make_owner(server, other);
  }
  page_roles_turn(server);
}

void page_roles_act(page_client *client, page_may action) {
  sonde_page_server *server = client->server;
  SONDE_ASSERT(client->here && action != PAGE_MAY_NOTHING);
  if (action != may(client)) {
    page_client_note(client, "this page may not do that now");
    return;
  }
  if (action == PAGE_MAY_GIVE) {
    page_client *teacher = first_other(server, client, true);
    server->borrower = teacher ? teacher : first_other(server, client, false);
  } else if (action == PAGE_MAY_TAKE && client->teacher) {
    server->borrower = client;
  } else if (action == PAGE_MAY_TAKE && !is_owner(client)) {
    stand_in(server, client); // the learner is gone
  } else {
    server->borrower = NULL; // returned, or taken back
  }
}
