// sonde simulate: runs a scene of several bodies and writes its motion.
#include "options.h"
#include "scene_figure.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char VERB[] = "simulate";

typedef struct options {
  const char *scene, *directory, *picture;
  long steps, every; // 0: not given
  double seconds;    // 0: not given
  bool resume, json, no_frames;
} options;

static const app_option TABLE[] = {
    OPT_ARGUMENT(scene, "SCENE", NULL),
    OPT_TEXT(directory, "o,output", "DIR", "directory to write to; made when absent"),
    OPT_INTEGER(steps, "steps", "N", 1, 2000000000, "simulate N steps"),
    OPT_REAL(seconds, "seconds", "S", 1e-9, 1e6, 1,
             "simulate S seconds; default: duration_s of the scene"),
    OPT_INTEGER(every, "every", "K", 1, 2000000000,
                "write every K-th step and the last; default: 60 frames per second of the scene"),
    OPT_FLAG(no_frames, "no-frames", "write no VTK files"),
    OPT_TEXT(picture, "picture", "FILE",
             "draw the bodies as they stand at the end: as a report that can be turned when FILE "
             "ends in "
             ".html, as SVG otherwise"),
    OPT_FLAG(resume, "resume",
             "go on from the snapshot in DIR; the result is the same, bit by bit, as that of a run "
             "without a break"),
    OPT_JSON(json)};

typedef struct simulation {
  options a;
  sonde_scene *scene;
  sonde_scene_state *state;
  uint64_t steps, every, start;                // steps in all, and where this run began
  sonde_file *bodies, *contacts, *attachments; // the last only where there are any
  double seconds;
  uint64_t solver_iterations, most_points, awake;
  double processor_s, contact_s, assembly_s, solve_s;
  bool cancelled;
} simulation;

static void path_of(const simulation *s, const char *name, char *path, size_t size) {
  snprintf(path, size, "%s/%s", s->a.directory, name);
}

// ---- tables

static const char BODIES_HEAD[] =
    "step,time_s,body,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s,px_kg_m_s,"
    "py_kg_m_s,pz_kg_m_s,lx_kg_m2_s,ly_kg_m2_s,lz_kg_m2_s,kinetic_j,elastic_j,gravity_j\n";
static const char CONTACTS_HEAD[] =
    "step,time_s,a,b,fx_n,fy_n,fz_n,tx_n_m,ty_n_m,tz_n_m,normal_n,friction_n,volume_m3,area_m2,"
    "depth_m,energy_j,regions\n";

static const char ATTACHMENTS_HEAD[] =
    "step,time_s,attachment,a,b,fx_n,fy_n,fz_n,stretch_m,energy_j\n";

static void put_vector(sonde_file *table, sonde_vec3 v) {
  sonde_file_printf(table, ",%.12g,%.12g,%.12g", v.x, v.y, v.z);
}

// A new table, or the old one without the rows of steps that will be made again.
static sonde_status open_table(const simulation *s, const char *name, const char *head,
                               sonde_file **table, sonde_error *error) {
  char path[1100], *text = NULL;
  size_t count = 0;
  long keep = 0;
  path_of(s, name, path, sizeof path);
  if (s->a.resume) {
    sonde_status status = sonde_file_load(path, &text, &count, error);
    if (status) return status;
    // Bytes before the rows of later steps.
    keep = strncmp(text, head, strlen(head)) == 0 ? (long)strlen(head) : -1;
    for (const char *end; keep >= 0 && (end = strchr(text + keep, '\n')); keep = end + 1 - text)
      if (strtoull(text + keep, NULL, 10) > s->start) break;
    sonde_free(text);
    if (keep < 0)
      return app_error(error, SONDE_FORMAT, "%.300s: not a table of sonde simulate", path);
  }
  sonde_status status = sonde_file_extend(path, (uint64_t)keep, table, error);
  if (!status && !s->a.resume) sonde_file_printf(*table, "%s", head);
  return status;
}

// ---- frames

static void frame_name(const simulation *s, uint32_t body, uint64_t step, char *name, size_t size) {
  snprintf(name, size, "frames/%s_%09llu.vtp", sonde_scene_body(s->scene, body).name,
           (unsigned long long)step);
}

static sonde_status save_snapshot(const simulation *s, sonde_error *error) {
  char path[1100];
  path_of(s, "state.snapshot", path, sizeof path);
  return sonde_scene_state_save(s->state, path, error);
}

// The snapshot goes last: what it claims to be finished is on disk.
static sonde_status write_frame(simulation *s, sonde_error *error) {
  sonde_status status = SONDE_OK;
  if (!s->a.no_frames) {
    // The surfaces of all bodies at this step, and the list of every frame up to it, which ParaView
    // plays by time.
    char path[1300], name[128];
    uint64_t last = sonde_scene_tick(s->state);
    uint32_t bodies = sonde_scene_body_count(s->scene);
    for (uint32_t b = 0; b < bodies && !status; ++b) {
      frame_name(s, b, last, name, sizeof name);
      path_of(s, name, path, sizeof path);
      status = sonde_scene_save_vtp(s->state, b, path, error);
    }
    if (!status) {
      sonde_file *file = NULL;
      path_of(s, "scene.pvd", path, sizeof path);
      status = sonde_file_create(path, &file, error);
      if (!status) {
        double dt = sonde_scene_get_step(s->scene).dt_s;
        sonde_file_printf(file,
                          "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n"
                          "<Collection>\n");
        for (uint64_t k = 0; k <= last; k = k < last && k + s->every > last ? last : k + s->every)
          for (uint32_t b = 0; b < bodies; ++b) {
            frame_name(s, b, k, name, sizeof name);
            sonde_file_printf(file,
                              "<DataSet timestep=\"%.9g\" part=\"%u\" name=\"%s\" file=\"%s\"/>\n",
                              (double)k * dt, b, sonde_scene_body(s->scene, b).name, name);
          }
        sonde_file_printf(file, "</Collection>\n</VTKFile>\n");
        status = sonde_file_commit(file, error);
      }
    }
  }
  if (status) return status;

  // Rows of the tables: bodies, then pairs in contact.
  unsigned long long step = sonde_scene_tick(s->state);
  double time_s = sonde_scene_time(s->state);
  for (uint32_t b = 0; b < sonde_scene_body_count(s->scene); ++b) {
    sonde_body_measure m = sonde_scene_measure(s->state, b);
    sonde_file_printf(s->bodies, "%llu,%.12g,%s", step, time_s, sonde_scene_body(s->scene, b).name);
    put_vector(s->bodies, m.centre_m);
    put_vector(s->bodies, m.velocity_m_s);
    put_vector(s->bodies, m.spin_rad_s);
    put_vector(s->bodies, m.momentum_kg_m_s);
    put_vector(s->bodies, m.angular_kg_m2_s);
    sonde_file_printf(s->bodies, ",%.12g,%.12g,%.12g\n", m.kinetic_j, m.elastic_j, m.gravity_j);
  }
  for (uint32_t t = 0; t < sonde_scene_pair_count(s->scene); ++t) {
    sonde_scene_pair pair = sonde_scene_pair_at(s->scene, t);
    sonde_pair_measure m = sonde_scene_pair_measure(s->state, t);
    sonde_file_printf(s->contacts, "%llu,%.12g,%s,%s", step, time_s,
                      sonde_scene_body(s->scene, pair.a).name,
                      sonde_scene_body(s->scene, pair.b).name);
    put_vector(s->contacts, m.force_n);
    put_vector(s->contacts, m.torque_n_m);
    sonde_file_printf(s->contacts, ",%.12g,%.12g,%.12g,%.12g,%.12g,%.12g,%u\n", m.normal_n,
                      sqrt(m.friction_n.x * m.friction_n.x + m.friction_n.y * m.friction_n.y +
                           m.friction_n.z * m.friction_n.z),
                      m.volume_m3, m.area_m2, m.depth_m, m.energy_j, m.region_count);
  }

  for (uint32_t k = 0; k < sonde_scene_attachment_count(s->scene); ++k) {
    sonde_attachment_measure m = sonde_scene_attachment(s->state, k);
    const uint32_t end[2] = {m.a, m.b};
    sonde_file_printf(s->attachments, "%llu,%.12g,%u", step, time_s, k);
    for (int i = 0; i < 2; ++i)
      sonde_file_printf(s->attachments, ",%s",
                        end[i] == UINT32_MAX ? "" : sonde_scene_body(s->scene, end[i]).name);
    put_vector(s->attachments, m.force_n);
    sonde_file_printf(s->attachments, ",%.12g,%.12g\n", m.stretch_m, m.energy_j);
  }

  status = sonde_file_flush(s->bodies, error);
  if (!status && s->attachments) status = sonde_file_flush(s->attachments, error);
  if (!status) status = sonde_file_flush(s->contacts, error);
  return status ? status : save_snapshot(s, error);
}

// ---- run

static sonde_status run(simulation *s, sonde_error *error) {
  sonde_progress progress = app_progress();
  sonde_status status = s->a.resume ? SONDE_OK : write_frame(s, error);
  while (!status && sonde_scene_tick(s->state) < s->steps) {
    double begin = app_seconds(CLOCK_MONOTONIC);
    double processor = app_seconds(CLOCK_PROCESS_CPUTIME_ID);
    sonde_scene_advance(s->state);
    s->seconds += app_seconds(CLOCK_MONOTONIC) - begin;
    s->processor_s += app_seconds(CLOCK_PROCESS_CPUTIME_ID) - processor;
    sonde_scene_report report = sonde_scene_last(s->state);
    s->solver_iterations += report.solver_iterations;
    s->awake += report.awake;
    s->contact_s += report.contact_s, s->assembly_s += report.assembly_s;
    s->solve_s += report.solve_s;
    if (report.touch_points > s->most_points) s->most_points = report.touch_points;
    uint64_t done = sonde_scene_tick(s->state);
    s->cancelled = !progress.report((double)done / (double)s->steps, "simulating", progress.user);
    if (done % s->every == 0 || done == s->steps) status = write_frame(s, error);
    if (s->cancelled) break;
  }
  app_progress_end();
  return status;
}

// What makes a result one that cannot be trusted, in the order of telling. A body that begins
// inside another is let out of it, which is told but is no fault.
typedef struct fault {
  uint32_t flag;
  const char *what, *other; // between the bodies' names and behind the second
} fault;
static const fault FAULTS[] = {
    {SONDE_SCENE_INVERTED, "turned inside out or went through itself", ""},
    {SONDE_SCENE_PASSED, "went through", ""},
    {SONDE_SCENE_INSIDE, "was wholly inside", " and was let out"},
    {SONDE_SCENE_NON_FINITE, "a step was not finite and was undone", ""},
    {SONDE_SCENE_CONTACT_FULL, "there was more contact than room for it, and forces are missing",
     ""},
};

// Tells every fault in a sentence with its bodies and its time; true when the result is spoilt.
static bool tell_faults(const simulation *s, char *first, size_t size) {
  bool spoilt = false;
  for (size_t k = 0; k < sizeof FAULTS / sizeof *FAULTS; ++k) {
    sonde_scene_event event = sonde_scene_first(s->state, FAULTS[k].flag);
    if (!event.count) continue;
    uint32_t bodies = sonde_scene_body_count(s->scene);
    const char *body = event.body < bodies ? sonde_scene_body(s->scene, event.body).name : "";
    const char *other = event.other < bodies ? sonde_scene_body(s->scene, event.other).name : "";
    char sentence[320];
    snprintf(sentence, sizeof sentence, "%s%s%s%s%s%s at %.6g s", body, *body ? " " : "",
             FAULTS[k].what, *other ? " " : "", other, FAULTS[k].other, event.time_s);
    bool worse = FAULTS[k].flag != SONDE_SCENE_INSIDE || event.time_s > 0;
    if (worse && !spoilt) snprintf(first, size, "%s", sentence);
    spoilt |= worse;
    fprintf(stderr, "sonde simulate: %s%s\n", worse ? "the result cannot be trusted: " : "",
            sentence);
  }
  return spoilt;
}

// A cancelled run ends with a snapshot only, so that tables and frames keep their rhythm.
static int simulate(void *from) {
  simulation s = {.a = *(const options *)from};
  sonde_error error = {0};
  assert(s.a.scene && s.a.directory);
  char thigh[1024], searched[1024], path[1100];
  bool bundled = app_bundled_model(thigh, sizeof thigh, searched, sizeof searched);
  sonde_status status = sonde_scene_load(s.a.scene, bundled ? thigh : NULL, &s.scene, &error);
  if (!status) status = sonde_scene_state_create(s.scene, &s.state, &error);
  if (!status) {
    double dt = sonde_scene_get_step(s.scene).dt_s;
    double seconds = s.a.seconds > 0 ? s.a.seconds : sonde_scene_duration(s.scene);
    s.steps = s.a.steps ? (uint64_t)s.a.steps : (uint64_t)ceil(seconds / dt - 1e-9);
    s.every = s.a.every ? (uint64_t)s.a.every : (uint64_t)fmax(1, round(1 / (60 * dt)));
    path_of(&s, "state.snapshot", path, sizeof path);
    if (s.a.resume) status = sonde_scene_state_load(s.state, path, &error);
    s.start = sonde_scene_tick(s.state);
    if (!status) status = sonde_directory_make(s.a.directory, 0777, false, &error);
    path_of(&s, "frames", path, sizeof path);
    if (!status && !s.a.no_frames) status = sonde_directory_make(path, 0777, false, &error);
    if (!status) status = open_table(&s, "bodies.csv", BODIES_HEAD, &s.bodies, &error);
    if (!status) status = open_table(&s, "contacts.csv", CONTACTS_HEAD, &s.contacts, &error);
    if (!status && sonde_scene_attachment_count(s.scene))
      status = open_table(&s, "attachments.csv", ATTACHMENTS_HEAD, &s.attachments, &error);
  }
  if (!status) status = run(&s, &error);
  if (!status && s.cancelled) status = save_snapshot(&s, &error);
  if (!status && s.a.picture) status = scene_figure(s.scene, s.state, s.a.picture, &error);
  double steps = status ? 0 : (double)(sonde_scene_tick(s.state) - s.start);
  // Simulated over processor time of the steps.
  double simulated_s = status ? 0 : steps * sonde_scene_get_step(s.scene).dt_s;
  double real_time = s.processor_s > 0 ? simulated_s / s.processor_s : NAN;
  char trouble[320] = "";
  bool spoilt = !status && tell_faults(&s, trouble, sizeof trouble), trusted = !spoilt;
  if (!status && s.a.json) {
    app_json_begin();
    app_json("title:%s bodies:%u steps:%lu time_s:%g ms_per_step:%g solver_iterations_per_step:%g "
             "most_contact_points:%lu flagged_steps:%lu flags:%u awake_per_step:%g real_time:%g "
             "contact_ms:%g assembly_ms:%g solve_ms:%g",
             sonde_scene_title(s.scene), sonde_scene_body_count(s.scene), sonde_scene_tick(s.state),
             sonde_scene_time(s.state), steps > 0 ? 1e3 * s.seconds / steps : NAN,
             steps > 0 ? (double)s.solver_iterations / steps : NAN, s.most_points,
             sonde_scene_flag_count(s.state), sonde_scene_all_flags(s.state),
             steps > 0 ? (double)s.awake / steps : NAN, real_time,
             steps > 0 ? 1e3 * s.contact_s / steps : NAN,
             steps > 0 ? 1e3 * s.assembly_s / steps : NAN,
             steps > 0 ? 1e3 * s.solve_s / steps : NAN);
    char hash[24];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)sonde_scene_hash(s.state));
    app_json("hash:%s cancelled:%hhd trusted:%hhd trouble:%s", hash, s.cancelled, trusted, trouble);
    app_json_end();
  }
  if (!status && !s.a.json) {
    printf("steps         %8llu (%.6g s)\n", (unsigned long long)sonde_scene_tick(s.state),
           sonde_scene_time(s.state));
    if (steps > 0) {
      printf("step          %8.3f ms\n", 1e3 * s.seconds / steps);
      printf("iterations    %8.1f per step\n", (double)s.solver_iterations / steps);
      printf("real time     %8.2f\n", real_time);
    }
    printf("flagged steps %8llu\n", (unsigned long long)sonde_scene_flag_count(s.state));
    printf("hash          %016llx\n", (unsigned long long)sonde_scene_hash(s.state));
    printf("written to    %s\n", s.a.directory);
  }
  if (!status && s.cancelled)
    fprintf(stderr, "sonde simulate: cancelled at step %llu of %llu; --resume goes on\n",
            (unsigned long long)sonde_scene_tick(s.state), (unsigned long long)s.steps);
  sonde_file_discard(s.bodies);
  sonde_file_discard(s.contacts);
  sonde_file_discard(s.attachments);
  sonde_scene_state_destroy(s.state);
  sonde_scene_destroy(s.scene);
  if (status) return app_fail(VERB, &error);
  return s.cancelled || spoilt ? APP_FAILED : APP_OK;
}

const app_command cmd_simulate = {
    .verb = "simulate",
    .summary = "simulate a scene of several bodies",
    .usage = "SCENE -o DIR [options]",
    .text =
        "Simulates a scene of several bodies with contact and friction (docs/scene.md; examples "
        "in data/scenes) and writes, into DIR, the surfaces as VTK files (open scene.pvd in "
        "ParaView), bodies.csv, contacts.csv, attachments.csv where there are any, and a snapshot.",
    .tail = "Ctrl-C keeps what is finished; --resume goes on from there.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .required = "SCENE o",
    .not_both = "steps seconds",
    .run = simulate};
