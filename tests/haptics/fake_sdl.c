// A fake SDL2 with one pad; position_m are its stick and triggers (1 = full deflection).
#include "fake.h"

#include <stdint.h>

fake_control fake;
static int pad;

int SDL_InitSubSystem(uint32_t what);
void SDL_QuitSubSystem(uint32_t what);
int SDL_NumJoysticks(void);
int SDL_IsGameController(int index);
void *SDL_GameControllerOpen(int index);
void SDL_GameControllerClose(void *p);
int SDL_GameControllerGetAttached(void *p);
int SDL_GameControllerRumble(void *p, uint16_t low, uint16_t high, uint32_t ms);
int16_t SDL_GameControllerGetAxis(void *p, int axis);
uint8_t SDL_GameControllerGetButton(void *p, int button);
void SDL_GameControllerUpdate(void);
int SDL_SetHint(const char *name, const char *value);
const char *SDL_GetError(void);

int SDL_InitSubSystem(uint32_t what) { return what == 0x2000 ? 0 : -1; }
void SDL_QuitSubSystem(uint32_t what) { (void)what; }
int SDL_NumJoysticks(void) { return fake.plugged ? 1 : 0; }
int SDL_IsGameController(int index) { return index == 0; }
void *SDL_GameControllerOpen(int index) {
  fake.opened++;
  return index == 0 ? &pad : NULL;
}
void SDL_GameControllerClose(void *p) {
  if (p == &pad) fake.closed++;
}
int SDL_GameControllerGetAttached(void *p) { return p == &pad && fake.plugged; }
int SDL_GameControllerRumble(void *p, uint16_t low, uint16_t high, uint32_t ms) {
  (void)high, (void)ms;
  fake.force_n[2] = low / 65535.0 * 40.0;
  return p == &pad ? 0 : -1;
}
int16_t SDL_GameControllerGetAxis(void *p, int axis) {
  if (p != &pad) return 0;
  if (axis == 0) return (int16_t)(32767 * fake.position_m[0]);
  if (axis == 1) return (int16_t)(-32767 * fake.position_m[1]);
  return axis == 4 ? (int16_t)(32767 * fake.position_m[2]) : 0;
}
uint8_t SDL_GameControllerGetButton(void *p, int button) { return p == &pad && button == 0; }
void SDL_GameControllerUpdate(void) { fake.exchanges++; }
int SDL_SetHint(const char *name, const char *value) { return name && value; }
const char *SDL_GetError(void) { return ""; }
