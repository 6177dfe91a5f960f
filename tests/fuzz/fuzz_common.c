// Files, the small leg and short simulations that the fuzz targets share.
// remove_directory   at the end of the process
// barrel             skin of the leg
#include "fuzz.h"

#include "../barrel_mesh.h"

#include "base/maths.h"

#include <dirent.h>
#include <sys/stat.h>

bool fuzz_accepted, fuzz_is_seed;

static char directory[64];

static void remove_directory(void) {
  DIR *list = opendir(directory);
  for (struct dirent *entry; list && (entry = readdir(list));)
    if (entry->d_name[0] != '.') unlink(fuzz_path(entry->d_name));
  if (list) closedir(list);
  rmdir(directory);
}

const char *fuzz_directory(void) {
  if (directory[0]) return directory;
  snprintf(directory, sizeof directory, "/tmp/sonde_fuzz_%ld", (long)getpid());
  FUZZ_CHECK(mkdir(directory, 0700) == 0);
  atexit(remove_directory);
  return directory;
}

const char *fuzz_path(const char *name) {
  static char paths[4][384];
  static int next;
  char *path = paths[next++ % 4];
  snprintf(path, sizeof paths[0], "%s/%.255s", fuzz_directory(), name);
  return path;
}

const char *fuzz_file(const char *name, const uint8_t *bytes, size_t count) {
  const char *path = fuzz_path(name);
  FILE *stream = fopen(path, "wb");
  FUZZ_CHECK(stream && fwrite(bytes, 1, count, stream) == count && fclose(stream) == 0);
  return path;
}

char *fuzz_text(const uint8_t *bytes, size_t count) {
  if (memchr(bytes, 0, count)) return NULL;
  char *text = malloc(count + 1);
  FUZZ_CHECK(text);
  memcpy(text, bytes, count);
  text[count] = 0;
  return text;
}

bool fuzz_checked(sonde_status status, const sonde_error *error) {
  fuzz_accepted |= status == SONDE_OK;
  if (status == SONDE_OK) return true;
  FUZZ_CHECK(status > SONDE_OK && status < SONDE_STATUS_COUNT && error->status == status);
  FUZZ_CHECK(error->message[0] && memchr(error->message, 0, sizeof error->message));
  return false;
}

// A closed round leg along z, 240 mm long, 60 mm in radius, with flat ends.
static void barrel(sonde_mesh *mesh) {
  enum { RINGS = 9, AROUND = 12 };
  sonde_error error = {0};
  FUZZ_CHECK(sonde_mesh_create(mesh, 2 + RINGS * AROUND, 2 * AROUND * RINGS, &error) == SONDE_OK);
  mesh->vertices[0] = vec3(0, 0, -0.12);
  mesh->vertices[1] = vec3(0, 0, 0.12);
  for (uint32_t i = 0; i < RINGS; ++i)
    for (uint32_t k = 0; k < AROUND; ++k) {
      double turn = 2 * SONDE_PI * k / AROUND;
      mesh->vertices[2 + i * AROUND + k] =
          vec3(0.06 * cos(turn), 0.06 * sin(turn), 0.24 * i / (RINGS - 1) - 0.12);
    }
  FUZZ_CHECK(barrel_mesh_faces(mesh, RINGS, AROUND) == mesh->face_count);
}

sonde_model *fuzz_leg(void) {
  static sonde_model *leg;
  if (leg) return leg;
  sonde_error error = {0};
  sonde_mesh skin;
  barrel(&skin);
  sonde_site site = {.id = 1,
                     .position_m = vec3(0.06, 0, 0),
                     .normal = vec3(1, 0, 0),
                     .u = vec3(0, 1, 0),
                     .v = vec3(0, 0, 1),
                     .k0_n_m3 = 1.5e5,
                     .xm_m = 0.045};
  sonde_model_def def = sonde_model_def_default();
  def.name = "leg";
  def.provenance = "made for the fuzz targets";
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  def.fine_edge_m = 0.02;
  def.fine_reach_m = 0.01;
  sonde_status status = sonde_model_build(&def, &leg, &error);
  if (status) fprintf(stderr, "%s\n", error.message);
  FUZZ_CHECK(status == SONDE_OK);
  leg->checksum = 0x0123456789abcdefu; // equal in every build: the seeds name it
  sonde_mesh_clear(&skin);
  return leg;
}

const char *fuzz_leg_file(void) {
  static char path[128];
  if (path[0]) return path;
  sonde_model *leg = fuzz_leg();
  sonde_error error = {0};
  uint64_t checksum = leg->checksum;
  snprintf(path, sizeof path, "%s", fuzz_path("leg.sonde"));
  FUZZ_CHECK(sonde_model_save(leg, path, &error) == SONDE_OK);
  leg->checksum = checksum;
  return path;
}

sonde_pose fuzz_press(const sonde_model *model, double depth_m) {
  FUZZ_CHECK(model->site_count > 0);
  return sonde_site_pose(&model->sites[0], depth_m);
}

void fuzz_step_model(const sonde_model *model, const sonde_world_def *def) {
  enum { STEPS = 3 };
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_error error = {0};
  sonde_status status = sonde_probe_create("linear", &probe, &error);
  FUZZ_CHECK(status == SONDE_OK);
  status = sonde_state_create(model, def, &state, &error);
  if (status) FUZZ_CHECK(error.status == status && error.message[0]);
  for (int k = 0; !status && k < STEPS; ++k)
    sonde_step(state, &probe,
               model->site_count ? fuzz_press(model, 1e-3 * (k + 1))
                                 : (sonde_pose){{0, 0, 0}, {1, 0, 0, 0}});
  for (uint32_t i = 0; !status && i < model->surface.vertex_count; ++i)
    FUZZ_CHECK(v_finite(sonde_state_positions(state)[i]));
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
}

// What a picture needs of a model.
typedef struct sight {
  sonde_interior *interior;
  sonde_echo *echo;
  sonde_image image;
} sight;

static sonde_status open_sight(const sonde_model *model, sight *s, sonde_error *error) {
  sonde_echo_def def = {.version = SONDE_DEF_VERSION,
                        .line_count = 32,
                        .sample_count = 128,
                        .scatterers_per_m3 = 1e8};
  sonde_status status = sonde_interior_create(model, &s->interior, error);
  if (!status) status = sonde_echo_create(s->interior, &def, &s->echo, error);
  return status ? status : sonde_image_create(32, 32, &s->image, error);
}

static void close_sight(sight *s) {
  sonde_image_clear(&s->image);
  sonde_echo_destroy(s->echo);
  sonde_interior_destroy(s->interior);
}

static sonde_status look(sight *s, const sonde_model *model, const sonde_pathology *pathology,
                         const sonde_findings *findings, sonde_error *error) {
  static const sonde_findings NONE;
  sonde_echo_settings settings = sonde_echo_settings_default();
  sonde_status status =
      sonde_interior_set_findings(s->interior, findings ? findings : &NONE, error);
  if (!status && model->site_count)
    sonde_echo_render(s->echo, fuzz_press(model, 0), 0.06, pathology, &settings, &s->image);
  return status;
}

void fuzz_picture(const sonde_model *model, const sonde_pathology *pathology,
                  const sonde_findings *findings) {
  static sight leg;
  sight s = {0};
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  if (!model && !leg.interior) status = open_sight(fuzz_leg(), &leg, &error);
  if (model) status = open_sight(model, &s, &error);
  if (!status)
    status = look(model ? &s : &leg, model ? model : fuzz_leg(), pathology, findings, &error);
  if (status) FUZZ_CHECK(error.status == status && error.message[0]);
  close_sight(&s);
}

bool fuzz_chosen(const uint8_t *bytes, size_t count, uint64_t one_of) {
  return fuzz_is_seed || sonde_hash(0, bytes, count) % one_of == 0;
}
