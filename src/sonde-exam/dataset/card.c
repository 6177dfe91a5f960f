// What a whole data set says of itself: card, manifest and sums.
#include "dataset/dataset.h"

#include <math.h>
#include <string.h>

static void put_card(sonde_file *file, const sonde_dataset_def *def,
                     const sonde_dataset_contents *c) {
  const sonde_dataset_plan *plan = def->plan;
  const char *where = def->format   ? "file"
                      : def->folder ? "folder"
                                    : "tar file in the layout of WebDataset";
  sonde_file_printf(
      file,
      "# %s\n\n**Synthetic.** Computed by the program sonde %s from random numbers: no person, "
      "animal "
      "or phantom was measured or scanned, and no picture of one was used.\n\n"
      "%u frames of %u legs: %u presses of each leg, up to %u frames of each press. One %s for "
      "each leg. %u frames show a clot. %u presses ended before their last force, because the skin "
      "found no equilibrium or the force was out of reach.\n\n"
      "Licence: %s.\n\n",
      plan->title, sonde_version(), c->all.frames, plan->legs, plan->presses, plan->frames, where,
      c->all.clots, c->all.stopped, plan->licence);
  sonde_file_printf(
      file,
      "## How it was made\n"
      "`plan.yaml` is the plan; `sonde dataset --plan plan.yaml -o DIR` with the same version "
      "makes "
      "the same bytes, in whatever number of shards. For each leg a patient is drawn: body, "
      "position, "
      "veins, clot. For each press a place over the vein, an error of the hand, a scanner with its "
      "settings, a greatest force, and the time in the cycles of heart and breath. The probe goes "
      "slowly along its beam; each frame is the equilibrium at its force, the forces of a press "
      "growing by equal factors. Skin, tissue, vein, picture and labels of a frame come from one "
      "state.\n\n"
      "## A frame\n"
      "Key `LLLLLL_PP_FF`: leg, press, frame, from 0. Frames of one leg are alike: split by "
      "leg.\n\n"
      "| array | content |\n|---|---|\n");
  for (uint32_t k = 0; k < SONDE_DATASET_ARRAYS; ++k)
    if (plan->arrays >> k & 1)
      sonde_file_printf(file, "| `%s` | %s |\n", sonde_dataset_array_name(k),
                        sonde_dataset_array_text(k));
  sonde_file_printf(
      file,
      "\nPictures and labels have %u x %u pixels, row 0 at the probe, column 0 at its negative x; "
      "`pixel_mm` is their size. Probe's frame: x along the face, y across the image plane, z into "
      "the tissue. `json` holds the rest: `force_n` along the beam, `wrench` of the tissue on the "
      "probe (N, N m, about the middle of its face, probe's frame), `position_m` and "
      "`rotation_wxyz` "
      "(world from probe), place and view, scanner and settings, patient, and for each vessel that "
      "the image plane meets within 40 mm of the beam `area_ratio` (area over area at rest: 0 "
      "closed), diameters, and its area in the labels.\n\n"
      "## Tissue\n| value | class | share of pixels |\n|---|---|---|\n",
      plan->width, plan->height);
  double all = 0;
  for (int k = 0; k < SONDE_LABEL_COUNT; ++k) all += (double)c->all.pixels[k];
  for (int k = 0; k < SONDE_LABEL_COUNT; ++k)
    sonde_file_printf(file, "| %d | %s | %.5f |\n", k, sonde_truth_label_name((sonde_label)k),
                      all > 0 ? (double)c->all.pixels[k] / all : 0);
  sonde_file_printf(file, "\n## Closure of the main vein\n| area over area at rest | frames |\n"
                          "|---|---|\n");
  for (int k = 0; k < 10; ++k)
    sonde_file_printf(file, "| %.1f to %.1f%s | %u |\n", 0.1 * k, 0.1 * (k + 1),
                      k == 9 ? " and more" : "", c->all.closure[k]);
  sonde_file_printf(file, "| not in the image plane | %u |\n", c->all.closure[10]);
  sonde_file_printf(
      file,
      "\n## Limits\n"
      "Bodies follow published distributions but are simpler than people; pictures have the "
      "scanners' statistics, not all of their artefacts (docs/echo.md of sonde). Presses are "
      "quasi-static, along the beam, without friction. A model that works on these frames must be "
      "measured on pictures of patients before anybody relies on it. Not for diagnosis.\n\n"
      "## Files\n"
      "`manifest.json` and `SHA256SUMS` list every file with its SHA-256 (`sonde dataset --check "
      "DIR`, `sha256sum -c SHA256SUMS`); `card.json` holds the numbers of this page; `index` what "
      "each leg holds.\n");
}

static void put_card_json(sonde_json_out *out, const sonde_dataset_def *def,
                          const sonde_dataset_contents *c) {
  const sonde_dataset_plan *plan = def->plan;
  sonde_json_begin_object(out, NULL);
  sonde_json_put_text(out, "title", plan->title);
  sonde_json_put_bool(out, "synthetic", true);
  sonde_json_put_text(out, "made_by", "sonde " SONDE_VERSION_STRING);
  sonde_json_put_text(out, "licence", plan->licence);
  sonde_json_put_integer(out, "seed", (int64_t)plan->seed);
  const struct {
    const char *key;
    uint32_t value;
  } numbers[] = {{"legs", plan->legs},          {"frames", c->all.frames},
                 {"clot_frames", c->all.clots}, {"stopped_presses", c->all.stopped},
                 {"width", plan->width},        {"height", plan->height}};
  for (size_t k = 0; k < SONDE_COUNT_OF(numbers); ++k)
    sonde_json_put_integer(out, numbers[k].key, numbers[k].value);
  sonde_json_begin_object(out, "arrays");
  for (uint32_t k = 0; k < SONDE_DATASET_ARRAYS; ++k)
    if (plan->arrays >> k & 1)
      sonde_json_put_text(out, sonde_dataset_array_name(k), sonde_dataset_array_text(k));
  sonde_json_end(out);
  sonde_json_begin_list(out, "tissue");
  for (int k = 0; k < SONDE_LABEL_COUNT; ++k) {
    sonde_json_begin_object(out, NULL);
    sonde_json_put_integer(out, "value", k);
    sonde_json_put_text(out, "name", sonde_truth_label_name((sonde_label)k));
    sonde_json_put_integer(out, "pixels", (int64_t)c->all.pixels[k]);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_begin_list(out, "closure_tenths");
  for (int k = 0; k < 10; ++k) sonde_json_put_integer(out, NULL, c->all.closure[k]);
  sonde_json_end(out);
  sonde_json_put_integer(out, "main_vein_not_in_plane", c->all.closure[10]);
  sonde_json_end(out);
  sonde_file_printf(out->file, "\n");
}

sonde_status sonde_dataset_finish(const sonde_dataset_def *def, sonde_dataset_contents *c,
                                  sonde_error *error) {
  SONDE_ASSERT(def && c && c->legs == def->plan->legs);
  enum { PLAN, CARD, NUMBERS, MANIFEST, SUMS, FILES };
  static const char *const NAMES[FILES] = {"plan.yaml", "README.md", "card.json", "manifest.json",
                                           "SHA256SUMS"};
  sonde_file *file[FILES] = {NULL};
  sonde_status status = SONDE_OK;
  for (int k = 0; k < FILES && !status; ++k) status = sonde_file_in_memory(&file[k], error);
  char path[SONDE_DATASET_PATH], digest[SHA256_DIGEST_STRING_LENGTH], *text = NULL;
  size_t bytes;
  sonde_dataset_path(def->directory, NAMES[PLAN], path);
  if (!status) status = sonde_file_load(path, &text, &bytes, error);
  if (!status) {
    sonde_file_write(file[PLAN], text, bytes);
    put_card(file[CARD], def, c);
    put_card_json(&(sonde_json_out){.file = file[NUMBERS], .layout = SONDE_JSON_TABS}, def, c);
  }
  sonde_free(text);
  for (int k = 0; k < FILES && !status; ++k) {
    if (k == MANIFEST) { // the lists of all files but the lists themselves
      sonde_json_out out = {.file = file[MANIFEST], .layout = SONDE_JSON_TABS};
      sonde_json_begin_object(&out, NULL);
      sonde_json_put_text(&out, "made_by", "sonde " SONDE_VERSION_STRING);
      sonde_json_put_integer(&out, "frames", c->all.frames);
      sonde_json_put_integer(&out, "bytes", (int64_t)c->bytes);
      sonde_dataset_put_files(&out, &c->files);
      sonde_json_end(&out);
      for (uint32_t i = 0; i < c->files.count; ++i)
        sonde_file_printf(file[SUMS], "%s  %s\n", c->files.list[i].sha256, c->files.list[i].path);
      sonde_file_printf(file[MANIFEST], "\n");
    }
    sonde_file *memory = file[k];
    file[k] = NULL, text = NULL;
    sonde_dataset_path(def->directory, NAMES[k], path);
    status = sonde_file_take(memory, &text, &bytes, error);
    if (!status) status = sonde_dataset_save(path, text, bytes, error);
    if (!status && k < MANIFEST) {
      SHA256Data((const uint8_t *)text, bytes, digest);
      status = sonde_dataset_add_file(c, NAMES[k], bytes, digest, error);
    }
    sonde_free(text);
  }
  for (int k = 0; k < FILES; ++k) sonde_file_discard(file[k]);
  return status;
}
