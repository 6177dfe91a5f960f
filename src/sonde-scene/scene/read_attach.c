// Attachments of a scene file: points of two bodies, or of one body and the world, that springs
// hold together.
#include "scene/scene.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static const double STIFFNESS_N_M = 1e5, DAMPING_N_S_M = 1;
static const double FARTHEST_M = 1e-3; // of a body's node from the point that it is pinned at

// What holds a body at a point: its frame, or the node nearest to the point.
static bool hold(sonde_reader *reader, sonde_place at, const sonde_scene *scene, uint32_t b,
                 sonde_vec3 point, sonde_pin_end *end) {
  *end = (sonde_pin_end){.body = b, .node = UINT32_MAX, .local = point};
  if (b == UINT32_MAX) return true;
  const sonde_body *body = &scene->bodies[b];
  if (sonde_body_is_rigid(body)) {
    sonde_vec3 centre = pose_apply(body->start, body->mass.centre_m);
    end->local = q_rotate(q_conj(body->start.rotation), v_sub(point, centre));
    return true;
  }
  double least = INFINITY;
  for (uint32_t i = 0; i < body->node_count; ++i) {
    double distance = v_distance(body->node[i], point);
    if (distance < least) least = distance, end->node = i;
  }
  if (least <= FARTHEST_M) return true;
  sonde_reader_fail(
      reader, at, SONDE_ARGUMENT,
      "the point [%g, %g, %g] mm is %.3g mm from the nearest node of '%s', expected %g "
      "or less",
      point.x * 1e3, point.y * 1e3, point.z * 1e3, least * 1e3, body->name, FARTHEST_M * 1e3);
  return false;
}

static void add_pin(sonde_reader *reader, sonde_place at, sonde_scene *scene, sonde_pin pin,
                    const uint32_t bodies[2], sonde_vec3 point) {
  if (!sonde_reader_good(reader)) return;
  // A node stands for the point where one is at hand, so that the spring has no length at the
  // start.
  for (int s = 0; s < 2; ++s) {
    sonde_pin_end *end = &pin.end[s];
    if (!hold(reader, at, scene, bodies[s], point, end)) return;
    if (end->node != UINT32_MAX) point = scene->bodies[bodies[s]].node[end->node];
  }
  if (!hold(reader, at, scene, bodies[0], point, &pin.end[0])) return;
  sonde_pin *more = sonde_realloc(scene->pins, scene->pin_count * sizeof pin,
                                  (scene->pin_count + 1) * sizeof pin);
  if (!more) {
    sonde_reader_fail(reader, at, SONDE_MEMORY, "out of memory");
    return;
  }
  scene->pins = more;
  scene->pins[scene->pin_count++] = pin;
}

static void read_attachment(sonde_reader *reader, sonde_place at, sonde_scene *scene) {
  static const char *const KEYS[] = {"bodies",        "points_mm",     "box_mm",
                                     "stiffness_n_m", "damping_n_s_m", NULL};
  sonde_read_keys(reader, at, "an attachment", KEYS);
  sonde_place ends = sonde_read_find(reader, at, "bodies");
  uint32_t count = sonde_read_count(reader, ends), bodies[2] = {UINT32_MAX, UINT32_MAX};
  if (count < 1 || count > 2)
    sonde_reader_fail(reader, at, SONDE_FORMAT,
                      "an attachment must name two bodies, or one that is held in the world");
  for (uint32_t k = 0; k < count && sonde_reader_good(reader); ++k) {
    sonde_place entry = sonde_read_item(reader, ends, k);
    const char *name = sonde_read_text_at(reader, entry, "a body's name");
    if (name) bodies[k] = sonde_scene_find(scene, name);
    if (name && bodies[k] == UINT32_MAX)
      sonde_reader_fail(reader, entry, SONDE_NOT_FOUND, "no body '%s'", name);
  }
  if (sonde_reader_good(reader) && bodies[0] == bodies[1])
    sonde_reader_fail(reader, at, SONDE_ARGUMENT, "a body is not attached to itself");
  sonde_pin pin = {.attachment = scene->attachment_count};
  pin.stiffness_n_m = sonde_read_real(reader, at, "stiffness_n_m", 1e-3, 1e12, STIFFNESS_N_M);
  pin.damping_n_s_m = sonde_read_real(reader, at, "damping_n_s_m", 0, 1e9, DAMPING_N_S_M);
  sonde_place points = sonde_read_find(reader, at, "points_mm");
  sonde_place box = sonde_read_find(reader, at, "box_mm");
  if (!points == !box)
    sonde_reader_fail(reader, at, SONDE_FORMAT, "an attachment needs points_mm or box_mm");
  for (uint32_t k = 0, n = sonde_read_count(reader, points); k < n; ++k)
    add_pin(reader, at, scene, pin, bodies,
            v_scale(sonde_read_vector_at(reader, sonde_read_item(reader, points, k), "a point",
                                         SONDE_SCENE_FAR_MM),
                    1e-3));
  if (!box || !sonde_reader_good(reader)) return;
  // Every node of the first body in the box is pinned.
  const sonde_body *first = &scene->bodies[bodies[0]];
  if (sonde_read_count(reader, box) != 2 || sonde_body_is_rigid(first)) {
    sonde_reader_fail(reader, at, SONDE_FORMAT,
                      "box_mm must be two corners around nodes of a deformable first body");
    return;
  }
  sonde_vec3 corner[2];
  for (uint32_t k = 0; k < 2; ++k)
    corner[k] = v_scale(sonde_read_vector_at(reader, sonde_read_item(reader, box, k), "a corner",
                                             SONDE_SCENE_FAR_MM),
                        1e-3);
  uint32_t before = scene->pin_count;
  const double grow = 1e-9;
  for (uint32_t i = 0; i < first->node_count && sonde_reader_good(reader); ++i) {
    sonde_vec3 p = first->node[i], low = corner[0], high = corner[1];
    if (p.x >= low.x - grow && p.y >= low.y - grow && p.z >= low.z - grow && p.x <= high.x + grow &&
        p.y <= high.y + grow && p.z <= high.z + grow)
      add_pin(reader, at, scene, pin, bodies, p);
  }
  if (sonde_reader_good(reader) && scene->pin_count == before)
    sonde_reader_fail(reader, box, SONDE_ARGUMENT, "the box holds no node");
}

void sonde_read_attachments(sonde_reader *reader, sonde_place root, sonde_scene *scene) {
  sonde_place list = sonde_read_find(reader, root, "attachments");
  for (uint32_t k = 0, count = sonde_read_count(reader, list);
       k < count && sonde_reader_good(reader); ++k) {
    read_attachment(reader, sonde_read_item(reader, list, k), scene);
    scene->attachment_count++;
  }
  SONDE_ASSERT(scene->pin_count == 0 || scene->pins);
}

bool sonde_bodies_attached(const sonde_scene *scene, uint32_t a, uint32_t b) {
  for (uint32_t k = 0; k < scene->pin_count; ++k) {
    uint32_t p = scene->pins[k].end[0].body, q = scene->pins[k].end[1].body;
    if ((p == a && q == b) || (p == b && q == a)) return true;
  }
  return false;
}
