// Gamepads through SDL2, opened at run time; they steer, and rumble with the force.
#include "haptics/devices/pump.h"

#include "base/base.h"
#include "base/maths.h"

#include <dlfcn.h>

enum { SDL_GAMECONTROLLER = 0x2000, RUMBLE_MS = 50, TICKS_PER_RUMBLE = 16 };

typedef struct gamepad {
  void *library, *pad;
  bool ready, placed;
  int (*init)(uint32_t), (*count)(void), (*is_pad)(int), (*attached)(void *);
  int (*rumble)(void *, uint16_t, uint16_t, uint32_t);
  int16_t (*axis)(void *, int);
  uint8_t (*button)(void *, int);
  void *(*open)(int);
  void (*close)(void *), (*update)(void), (*quit)(uint32_t);
  int (*hint)(const char *, const char *);
  const char *(*error)(void);
  double full_n; // force of the strongest rumble
  unsigned ticks;
  sonde_pose pose;
} gamepad;

static sonde_status bind(void *self, const sonde_device_open_def *def, sonde_error *error) {
  gamepad *g = self;
  static const char *const names[] = {"libSDL2-2.0.so.0", "libSDL2.so", NULL};
  const sonde_symbol symbols[] = {{"SDL_InitSubSystem", &g->init},
                                  {"SDL_NumJoysticks", &g->count},
                                  {"SDL_IsGameController", &g->is_pad},
                                  {"SDL_GameControllerGetAttached", &g->attached},
                                  {"SDL_GameControllerRumble", &g->rumble},
                                  {"SDL_GameControllerGetAxis", &g->axis},
                                  {"SDL_GameControllerGetButton", &g->button},
                                  {"SDL_GameControllerOpen", &g->open},
                                  {"SDL_GameControllerClose", &g->close},
                                  {"SDL_GameControllerUpdate", &g->update},
                                  {"SDL_QuitSubSystem", &g->quit},
                                  {"SDL_SetHint", &g->hint},
                                  {"SDL_GetError", &g->error}};
  return sonde_library_open(def->library, names, symbols, SONDE_COUNT_OF(symbols), &g->library,
                            error);
}

static sonde_status open_device(void *self, const sonde_device_open_def *def, sonde_error *error) {
  gamepad *g = self;
  sonde_pose kept = g->pose;
  g->hint("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1");
  g->hint("SDL_NO_SIGNAL_HANDLERS", "1"); // Ctrl-C stays ours
  g->ready = g->init(SDL_GAMECONTROLLER) == 0;
  if (!g->ready) return sonde_fail(error, SONDE_DEVICE, "SDL does not start: %s", g->error());
  for (int i = 0; i < g->count() && !g->pad; ++i)
    if (g->is_pad(i)) g->pad = g->open(i);
  if (!g->pad) return sonde_fail(error, SONDE_DEVICE, "no gamepad is plugged in");
  g->full_n = def->limits.force_n > 0.0 ? def->limits.force_n : 40.0;
  g->pose = g->placed ? kept : (sonde_pose){vec3(0, 0, 0), quat_identity()};
  g->placed = true;
  return SONDE_OK;
}

static double stick(gamepad *g, int axis) { return g->axis(g->pad, axis) / 32767.0; }

// Left stick: along the skin. Triggers: up and down. Right stick: tilt.
static int exchange(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                    sonde_device_sample *sample) {
  gamepad *g = self;
  (void)torque_n_m;
  SONDE_ASSERT(g->pad != NULL);
  g->update();
  if (!g->attached(g->pad)) return -1;
  const double axis[6] = {stick(g, 0), -stick(g, 1), stick(g, 4) - stick(g, 5),
                          stick(g, 3), stick(g, 2),  0.0};
  sonde_steer(&g->pose, axis, 1e-3);
  sample->world_from_probe = g->pose;
  for (int i = 0; i < 15; ++i)
    if (g->button(g->pad, i)) sample->buttons |= 1u << i;
  if (g->ticks++ % TICKS_PER_RUMBLE == 0) {
    double share = clamp(v_norm(force_n) / g->full_n, 0.0, 1.0);
    g->rumble(g->pad, (uint16_t)(share * 65535.0), 0, RUMBLE_MS);
  }
  return 1;
}

static void close_device(void *self) {
  gamepad *g = self;
  if (g->pad) {
    g->rumble(g->pad, 0, 0, 0);
    g->close(g->pad);
  }
  if (g->ready) g->quit(SDL_GAMECONTROLLER);
  if (g->library) dlclose(g->library);
  *g = (gamepad){.pose = g->pose, .placed = g->placed};
}

// as exchange() makes it: x to the right, y away, z up
const sonde_driver sonde_driver_gamepad = {"gamepad",
                                           "gamepad steers and rumbles (SDL2)",
                                           {0.70710678118654752, -0.70710678118654752, 0, 0},
                                           sizeof(gamepad),
                                           bind,
                                           open_device,
                                           exchange,
                                           close_device};
