// A fake libspnav: a puck pushed by position_m (1 = full deflection).
#include "fake.h"

fake_control fake;

typedef struct event {
  int type, axis[6];
  unsigned period;
  int *data;
} event;

int spnav_open(void);
int spnav_close(void);
int spnav_fd(void);
int spnav_poll_event(event *e);

int spnav_open(void) {
  if (!fake.plugged) return -1;
  fake.opened++;
  return 0;
}
int spnav_close(void) {
  fake.closed++;
  return 0;
}
int spnav_fd(void) { return fake.plugged ? 5 : -1; }
int spnav_poll_event(event *e) {
  if (++fake.exchanges % 2) return 0; // every other poll has an event
  *e = (event){.type = 1};
  for (int i = 0; i < 3; ++i) e->axis[i] = (int)(350 * fake.position_m[i]);
  return 1;
}
