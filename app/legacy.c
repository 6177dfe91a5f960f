// Commands that read their own words.
#include "options.h"

#define OLD(name, text)                                                                            \
  int old_##name(int argc, char **argv);                                                           \
  static int run_##name(void *options, int argc, char **argv) {                                    \
    (void)options;                                                                                 \
    return old_##name(argc, argv);                                                                 \
  }                                                                                                \
  const app_command cmd_##name = {.verb = #name, .summary = text, .run = run_##name};

OLD(run, "simulate in real time and serve the page")
OLD(fit, "fit a thigh to measurements and write a model file")
OLD(generate, "make a thigh from parameters and a seed")
OLD(predict, "compare a model's forces with measurements")
OLD(measure, "press a model at its sites with the virtual robot")
OLD(identify, "find damping and friction from records of a moving probe")
OLD(image, "write the echographic picture of a model at a pose")
OLD(simulate, "simulate a scene of several bodies")
OLD(reconstruct, "make a volume from tracked image frames")
OLD(slice, "make a picture at any pose from tracked frames or a volume")
OLD(replay, "play a recording again and compare the state hash")
OLD(bench, "time the simulation's stages")
OLD(exam, "let a scripted operator examine a case and score it")
OLD(class, "run several learners on one machine")
OLD(cases, "list, check and draw the cases of the trainer")
OLD(validate, "measure a room against its targets")
