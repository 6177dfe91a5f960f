// A limb as a model: meshes in the model's frame, layers and springs, vessels, stations.
#include "sonde/limb_model.h"

#include "limb/bones.h"
#include "limb/map.h"
#include "limb/part.h"
#include "limb/pose.h"
#include "tissue/layer_springs.h"

#include <string.h>

enum { COURSE_SITES = 24, SITES = SONDE_LIMB_STATIONS + COURSE_SITES };
// A subject's sites are numbered from PART_SITES on; with more than MOST_PARTS none is kept.
enum { PART_SITES = 100, MOST_PARTS = 200 };
static const double FINE_REACH_M = 0.004, BONE_EDGE_M = 0.004, LEAST_TISSUE_M = 0.004;
// A tendon yields less than muscle: a layer of it counts as muscle of this share of its thickness.
static const double TENDON_SHARE = 0.2;
enum { DEPTHS = 12 }; // places between fascia and bone where the tissue is asked for

sonde_limb_model_def sonde_limb_model_def_default(void) {
  return (sonde_limb_model_def){"limb", "Synthetic limb, not measured", 0.006, 0.003, 1, 0.02, NULL,
                                NULL};
}

sonde_vec3 sonde_limb_to_model(const sonde_limb *limb, sonde_vec3 p) {
  SONDE_ASSERT(limb);
  return vec3(p.x, p.y, limb_z(limb, LIMB_TOP) - p.z);
}

// Appends a mesh of the limb's frame to one of the model's, whose z runs the other way: corners of
// the faces change their order, so that they stay counter-clockwise from outside.
static sonde_status append(const sonde_limb *limb, const sonde_mesh *from, sonde_mesh *to,
                           sonde_error *error) {
  sonde_mesh all;
  const uint32_t v = to->vertex_count, f = to->face_count;
  sonde_status status =
      sonde_mesh_create(&all, v + from->vertex_count, f + from->face_count, error);
  if (status) return status;
  if (v) memcpy(all.vertices, to->vertices, v * sizeof *all.vertices);
  if (f) memcpy(all.faces, to->faces, f * sizeof *all.faces);
  for (uint32_t i = 0; i < from->vertex_count; ++i)
    all.vertices[v + i] = v_whole_nm(sonde_limb_to_model(limb, from->vertices[i]));
  for (uint32_t i = 0; i < from->face_count; ++i) {
    const uint32_t *face = from->faces[i];
    all.faces[f + i][0] = v + face[0];
    all.faces[f + i][1] = v + face[2], all.faces[f + i][2] = v + face[1];
  }
  sonde_mesh_clear(to);
  *to = all;
  return SONDE_OK;
}

// Middles of the bones that carry the body: hip joint, neck, shaft, knee, tibia.
static sonde_status lay_axis(const limb_held *held, sonde_model *model, sonde_error *error) {
  const sonde_limb *limb = held->limb;
  enum { POINTS = 111, PASSES = 3 };
  model->bone_axis_m = SONDE_NEW(sonde_vec3, POINTS);
  if (!model->bone_axis_m) return sonde_fail_memory(error);
  model->bone_axis_count = POINTS;
  const double neck_end = 0.12, mirror = limb->body.side == SONDE_LIMB_LEFT ? -1 : 1;
  sonde_vec3 *p = model->bone_axis_m;
  for (uint32_t k = 0; k < POINTS; ++k) {
    double level = LIMB_TOP + k * (2 - LIMB_TOP) / (POINTS - 1), z = limb_z(limb, level);
    sonde_vec3 shaft =
        v_scale(limb_shaft_axis(&limb->body, fmax(level, 0)), smooth_step(level / neck_end));
    sonde_vec3 shin = limb_tibia_axis(&limb->body, fmax(level, 1));
    sonde_vec3 at = v_lerp(shaft, shin, smooth_step((level - 0.94) / 0.12));
    p[k] = vec3(mirror * at.x, at.y, z);
  }
  for (int pass = 0; pass < PASSES; ++pass) {
    sonde_vec3 before = p[0];
    for (uint32_t k = 1; k + 1 < POINTS; ++k) {
      sonde_vec3 now = p[k], mean = v_lerp(before, p[k + 1], 0.5);
      p[k] = vec3(0.5 * (now.x + mean.x), 0.5 * (now.y + mean.y), now.z);
      before = now;
    }
  }
  for (uint32_t k = 0; k < POINTS; ++k) { // where the model holds the straight limb's points
    if (held->pose) p[k] = sonde_limb_pose_point(held->pose, p[k]);
    p[k] = v_whole_nm(sonde_limb_to_model(held->limb, p[k]));
  }
  return SONDE_OK;
}

// Finds layers and springs of every node from the tissue that lies on its inward normal as far as
// the nearest bone is away.
static void lay_springs(const limb_held *held, const sonde_limb_model_def *def,
                        sonde_model *model) {
  const sonde_limb *limb = held->limb;
  const double below_m = 0.002;
  const sonde_tissue_map *map = model->map;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 node = model->surface.vertices[i], in = v_neg(model->normal[i]);
    sonde_tissue_depths depth;
    map->depths(map->self, node, &depth);
    if (held->pose) { // the map tells depths at rest: by how much they change along the normal here
      sonde_tissue_depths below;
      map->depths(map->self, v_madd(node, below_m, in), &below);
      depth.fascia_m /= clamp((depth.fascia_m - below.fascia_m) / below_m, 0.5, 2);
    }
    double bone = model->bone_depth_m[i], skin = fmin(whole_nm(limb->body.skin_m), 0.4 * bone);
    double muscle = clamp(whole_nm(depth.fascia_m), skin, 0.9 * bone), tendon = 0;
    model->fat_depth_m[i] = skin, model->muscle_depth_m[i] = muscle;
    for (int k = 0; k < DEPTHS; ++k) {
      double at = muscle + (bone - muscle) * (k + 0.5) / DEPTHS;
      if (map->tissue(map->self, v_madd(node, at, in)) == SONDE_TISSUE_TENDON)
        tendon += 1.0 / DEPTHS;
    }
    double thick = (bone - muscle) * (1 - (1 - TENDON_SHARE) * tendon);
    sonde_layer_springs(muscle - skin, whole_nm(thick), LEAST_TISSUE_M, def->stiffness,
                        &model->k0_n_m3[i], &model->xm_m[i]);
  }
}

/* ---- vessels ------------------------------------------------------------------------------ */

// Branches that follow each other, as one line.
typedef struct chain {
  uint32_t count, branch[5];
  double length_m;
} chain;

static chain find_chain(const sonde_limb *limb, const char *const *names) {
  chain c = {0};
  for (; *names; ++names) {
    uint32_t branch = sonde_limb_vessel_find(limb, *names);
    if (branch == SONDE_LIMB_NO_VESSEL) continue;
    c.branch[c.count++] = branch;
    c.length_m += sonde_limb_vessel_get(limb, branch).length_m;
  }
  return c;
}

// A place of the vessels as the model holds them, with the radius of 10 mmHg.
static sonde_limb_vessel_point held_place(const limb_held *held, uint32_t vessel, double arc) {
  sonde_limb_vessel_point place = sonde_limb_vessel_place(held->limb, vessel, arc);
  if (!held->pose) return place;
  place.radius_m *= limb_pose_knee(held->pose, vessel, limb_side_point(held->limb, place.centre_m));
  place.centre_m = sonde_limb_pose_point(held->pose, place.centre_m);
  return place;
}

// Place on a line by its arc, which is that of the straight limb.
static sonde_limb_vessel_point chain_place(const limb_held *held, const chain *c, double arc) {
  const sonde_limb *limb = held->limb;
  uint32_t k = 0;
  for (; k + 1 < c->count; ++k) {
    double length = sonde_limb_vessel_get(limb, c->branch[k]).length_m;
    if (arc <= length) break;
    arc -= length;
  }
  return held_place(held, c->branch[k], arc);
}

// Lays a line through places at equal arcs of the branches. `down`: places that do not lie lower
// than the one before are left out, because sections of a main vessel ascend along the leg.
static void lay_line(const limb_held *held, const chain *c, bool down, sonde_vessel *line) {
  const double step_m = 0.004, least_down_m = 0.002;
  uint32_t most = (uint32_t)clamp(ceil(c->length_m / step_m) + 1, 2, SONDE_VESSEL_POINTS);
  line->count = 0;
  for (uint32_t k = 0; k < most; ++k) {
    sonde_limb_vessel_point at = chain_place(held, c, c->length_m * k / (most - 1));
    sonde_vec3 centre = v_whole_nm(sonde_limb_to_model(held->limb, at.centre_m));
    if (down && line->count && centre.z < line->point[line->count - 1].centre_m.z + least_down_m)
      continue;
    double skin = held->pose ? sonde_limb_pose_distance(held->pose, at.centre_m).skin
                             : sonde_limb_distance(held->limb, at.centre_m).skin;
    double depth = fmax(isfinite(skin) ? -skin : 0, at.radius_m);
    line->point[line->count++] =
        (sonde_vessel_point){centre, whole_nm(at.radius_m), whole_nm(depth)};
  }
}

static const char *const VEINS[] = {"external iliac vein", "common femoral vein", "femoral vein",
                                    "popliteal vein", NULL};
static const char *const ARTERIES[] = {"external iliac artery", "common femoral artery",
                                       "superficial femoral artery", "popliteal artery", NULL};

// Vessels beside the main ones, in the order of the graph while there is room.
static void lay_branches(const limb_held *held, const chain *veins, const chain *arteries,
                         sonde_thigh_anatomy *a) {
  const sonde_limb *limb = held->limb;
  const uint32_t count = sonde_limb_vessel_count(limb);
  for (uint32_t v = 0; v < count && a->branch_count < SONDE_BRANCHES; ++v) {
    bool main = false;
    for (uint32_t k = 0; k < veins->count; ++k) main |= veins->branch[k] == v;
    for (uint32_t k = 0; k < arteries->count; ++k) main |= arteries->branch[k] == v;
    if (main) continue;
    sonde_limb_vessel vessel = sonde_limb_vessel_get(limb, v);
    chain c = {1, {v}, vessel.length_m};
    sonde_branch *branch = &a->branch[a->branch_count++];
    *branch = (sonde_branch){.kind = vessel.kind == SONDE_LIMB_ARTERY ? SONDE_VESSEL_ARTERY
                                                                      : SONDE_VESSEL_VEIN};
    // A name as files have it: "deep femoral vein" -> "deep_femoral_vein". Saphenous veins go
    // without their last word, as those of a thigh, and so do names that are too long.
    char all[SONDE_LIMB_VESSEL_NAME];
    snprintf(all, sizeof all, "%s", vessel.name);
    for (char *letter = all; *letter; ++letter)
      if (*letter == ' ') *letter = '_';
    char *last = strstr(all, "saphenous_vein");
    if (last && strlen(last) == strlen("saphenous_vein")) last[strlen("saphenous")] = '\0';
    while (strlen(all) >= sizeof branch->name && (last = strrchr(all, '_')) != NULL) *last = '\0';
    snprintf(branch->name, sizeof branch->name, "%.31s", all);
    lay_line(held, &c, false, &branch->line);
  }
}

/* ---- stations ----------------------------------------------------------------------------- */

// A site across the limb, which runs along `axis` there. @param skin, normal as held
static sonde_site site_at(const sonde_limb *limb, uint32_t id, sonde_vec3 skin, sonde_vec3 normal,
                          sonde_vec3 axis) {
  sonde_vec3 n = vec3(normal.x, normal.y, -normal.z),
             u = v_unit(v_cross(vec3(axis.x, axis.y, -axis.z), n), vec3(1, 0, 0));
  return (sonde_site){.id = id,
                      .position_m = v_whole_nm(sonde_limb_to_model(limb, skin)),
                      .normal = n,
                      .u = u,
                      .v = v_cross(n, u)};
}

// Direction of the limb, downwards, where the model holds a point of the straight limb.
static sonde_vec3 held_axis(const limb_held *held, sonde_vec3 rest) {
  const sonde_vec3 down = vec3(0, 0, -1);
  if (!held->pose) return down;
  sonde_mat3 gradient = limb_pose_gradient(held->pose, limb_side_point(held->limb, rest));
  return limb_side_point(held->limb, v_unit(m_mul_v(gradient, down), down));
}

// A site on the skin at a level and an angle.
static sonde_site skin_site(const limb_held *held, uint32_t id, double level, double angle) {
  const sonde_limb *limb = held->limb;
  sonde_vec3 rest = vec3(0, 0, 0), middle = sonde_limb_point(limb, level, angle, 0), p[3];
  const double shift[3][2] = {{0.01, 0}, {0, 0.02}, {0, 0}};
  for (int j = 0; j < 3; ++j) {
    double l = level + shift[j][0], a = angle + shift[j][1];
    double out = limb_skin_radius(limb, l, a) / limb_fascia_radius(limb, l, a);
    p[j] = rest = sonde_limb_point(limb, l, a, out);
    if (held->pose) p[j] = sonde_limb_pose_point(held->pose, rest);
  }
  if (held->pose) middle = sonde_limb_pose_point(held->pose, middle);
  sonde_vec3 n = v_unit(v_cross(v_sub(p[0], p[2]), v_sub(p[1], p[2])), vec3(0, 1, 0));
  sonde_vec3 out = v_sub(p[2], middle);
  return site_at(limb, id, p[2], v_dot(n, out) < 0 ? v_neg(n) : n, held_axis(held, rest));
}

// Sites stand at the stations, along the main vein, and where a subject was measured. Between two
// stations the side from which the probe looks at the vein turns evenly from that of one to that of
// the other.
static void lay_sites(const limb_held *held, const chain *veins,
                      const sonde_limb_station station[SONDE_LIMB_STATIONS],
                      const limb_measured *measured, uint32_t parts, sonde_site *site) {
  enum { LAST = 9 }; // station at the popliteal vein's end
  const sonde_limb *limb = held->limb;
  const limb_held straight = {.limb = held->limb};
  double level[SONDE_LIMB_STATIONS], angle[SONDE_LIMB_STATIONS], f;
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
    sonde_vec3 rest = station[k].skin_m;
    if (held->pose) (void)sonde_limb_pose_rest(held->pose, station[k].skin_m, &rest);
    site[k] = site_at(limb, k, station[k].skin_m, station[k].normal, held_axis(held, rest));
    sonde_limb_polar(limb, rest, &level[k], &angle[k], &f);
  }
  for (uint32_t k = 0; k < COURSE_SITES; ++k) {
    double arc = veins->length_m * (k + 1.0) / (COURSE_SITES + 1), at, unused;
    sonde_limb_polar(limb, chain_place(&straight, veins, arc).centre_m, &at, &unused, &f);
    uint32_t i = 0;
    while (i + 1 < LAST && level[i + 1] < at) ++i;
    double t = clamp((at - level[i]) / (level[i + 1] - level[i]), 0, 1);
    double side = angle[i] + t * remainder(angle[i + 1] - angle[i], 2 * SONDE_PI);
    site[SONDE_LIMB_STATIONS + k] = skin_site(held, SONDE_LIMB_STATIONS + k, at, side);
  }
  for (uint32_t k = 0; k < parts; ++k) {
    double at, side;
    limb_measured_site(measured, k, &at, &side);
    site[SITES + k] = skin_site(held, PART_SITES + k, at, side);
  }
}

// Names of the stations as landmarks, those of a thigh where it has them.
static const char *const LANDMARKS[] = {
    "external_iliac",   "common_femoral",  "saphenofemoral_junction", "femoral_confluence",
    "femoral_proximal", "femoral_mid",     "femoral_distal",          "adductor_canal",
    "popliteal",        "trifurcation",    "posterior_tibial",        "peroneal",
    "gastrocnemius",    "great_saphenous", "small_saphenous"};
_Static_assert(SONDE_COUNT_OF(LANDMARKS) == SONDE_LIMB_STATIONS, "a name for each station");

// Stations as landmarks, and stretches of the main vein.
static void name_parts(const limb_held *held, const sonde_limb_station station[SONDE_LIMB_STATIONS],
                       sonde_model *model) {
  const sonde_limb *limb = held->limb;
  sonde_thigh_anatomy *a = model->anatomy;
  _Static_assert((int)SONDE_LIMB_STATIONS <= (int)SONDE_LANDMARKS, "a landmark for each station");
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
    sonde_landmark *mark = &a->landmark[a->landmark_count++];
    *mark = (sonde_landmark){.skin_m = model->sites[k].position_m,
                             .normal = model->sites[k].normal,
                             .vein_m = sonde_limb_to_model(limb, station[k].target_m),
                             .site = k};
    snprintf(mark->name, sizeof mark->name, "%s", LANDMARKS[k]);
  }
  uint32_t common = sonde_limb_vessel_find(limb, "common femoral vein"),
           popliteal = sonde_limb_vessel_find(limb, "popliteal vein");
  const sonde_vessel *vein = &model->vein;
  double whole = sonde_limb_vessel_get(limb, common).length_m;
  double ligament = sonde_limb_to_model(limb, held_place(held, common, 0).centre_m).z;
  double meet = sonde_limb_to_model(limb, held_place(held, common, whole).centre_m).z;
  double hiatus = sonde_limb_to_model(limb, held_place(held, popliteal, 0).centre_m).z;
  double third = (hiatus - meet) / 3, end = vein->point[vein->count - 1].centre_m.z;
  const struct {
    const char *name;
    double from, to;
  } segment[] = {{"common_femoral", ligament, meet},
                 {"femoral_proximal", meet, meet + third},
                 {"femoral_mid", meet + third, meet + 2 * third},
                 {"femoral_distal", meet + 2 * third, hiatus},
                 {"popliteal", hiatus, end}};
  for (size_t k = 0; k < SONDE_COUNT_OF(segment); ++k) {
    sonde_segment *to = &a->segment[a->segment_count++];
    to->from_m = whole_nm(segment[k].from), to->to_m = whole_nm(segment[k].to);
    snprintf(to->name, sizeof to->name, "%s", segment[k].name);
  }
  a->fascia_medial_m = 0.0008, a->fascia_lateral_m = 0.0011;
}

/* ---- the body as numbers ------------------------------------------------------------------ */

enum { ORIGIN_STRAIGHT = 1, ORIGIN_POSED = 2, ORIGIN_HEAD = 5, ORIGIN_SETTING = 5 };

// Version, sex, side, both halves of the seed, the parameters in the order of SONDE_LIMB_LIST, the
// muscles' shares; of a limb in a position also the position and the joints' angles.
static uint32_t body_numbers(sonde_limb_body *body, double **number) {
  uint32_t count = 0;
#define X(member, name, unit, low, high, text) number[count++] = &body->member;
  SONDE_LIMB_LIST(X)
#undef X
  for (uint32_t k = 0; k < SONDE_LIMB_MUSCLES; ++k) number[count++] = &body->share[k];
  return count;
}

enum { MOST_NUMBERS = 128 };

/* ---- the model ---------------------------------------------------------------------------- */

static sonde_status make(const limb_held *held, const sonde_limb_model_def *def,
                         const limb_measured *measured, sonde_mesh *skin, sonde_mesh *bones,
                         sonde_model **out, sonde_error *error) {
  const sonde_limb *limb = held->limb;
  const sonde_limb_pose *pose = held->pose;
  sonde_mesh part = {0};
  sonde_status status = pose ? sonde_limb_pose_skin(pose, def->edge_m, &part, error)
                             : sonde_limb_skin(limb, def->edge_m, &part, error);
  if (!status) status = append(limb, &part, skin, error);
  sonde_mesh_clear(&part);
  for (int bone = 0; bone < SONDE_LIMB_BONES && !status; ++bone) {
    sonde_limb_bone which = (sonde_limb_bone)bone;
    status = pose ? sonde_limb_pose_bone_mesh(pose, which, BONE_EDGE_M, &part, error)
                  : sonde_limb_bone_mesh(limb, which, BONE_EDGE_M, &part, error);
    if (!status) status = append(limb, &part, bones, error);
    sonde_mesh_clear(&part);
  }
  if (status) return status;
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  sonde_site site[SITES + MOST_PARTS];
  const uint32_t parts =
      measured && def->part->model->site_count <= MOST_PARTS ? def->part->model->site_count : 0;
  chain veins = find_chain(limb, VEINS), arteries = find_chain(limb, ARTERIES);
  if (pose)
    sonde_limb_pose_stations(pose, station);
  else
    sonde_limb_stations(limb, station);
  lay_sites(held, &veins, station, measured, parts, site);
  sonde_model_def built = sonde_model_def_default();
  built.name = def->name, built.provenance = def->provenance;
  built.skin = skin, built.femur = bones;
  built.sites = site, built.site_count = SITES + parts;
  built.fine_edge_m = def->fine_edge_m, built.fine_reach_m = FINE_REACH_M;
  built.law = sonde_layered_law(def->stiffness, def->damping_s);
  status = sonde_model_build(&built, out, error);
  if (status) return status;
  sonde_model *model = *out;
  model->anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
  if (!model->anatomy) return sonde_fail_memory(error);
  status = limb_map_create(held, &model->map, error);
  if (!status) status = lay_axis(held, model, error);
  if (status) return status;
  if (pose) {
    const sonde_vec3 up = sonde_limb_pose_up(pose);
    model->gravity =
        (sonde_gravity){limb_pose_posture(pose->setting.position), vec3(up.x, up.y, -up.z),
                        sonde_limb_to_model(limb, limb_side_point(limb, limb_pose_groin(pose)))};
  }
  // The body as numbers, for the file.
  sonde_limb_body copy = limb->body;
  double *number[MOST_NUMBERS];
  const uint32_t count = body_numbers(&copy, number);
  const uint32_t numbers = ORIGIN_HEAD + count + (pose ? ORIGIN_SETTING : 0);
  double *to = model->map_origin = SONDE_NEW(double, numbers);
  if (!to) return sonde_fail_memory(error);
  model->map_origin_count = numbers;
  to[0] = pose ? ORIGIN_POSED : ORIGIN_STRAIGHT, to[1] = copy.sex, to[2] = copy.side;
  to[3] = (double)(copy.seed >> 32), to[4] = (double)(copy.seed & 0xffffffffu);
  for (uint32_t k = 0; k < count; ++k) to[ORIGIN_HEAD + k] = *number[k];
  if (pose) {
    to += ORIGIN_HEAD + count;
    to[0] = pose->setting.position, to[1] = pose->setting.hip_flexion_rad;
    to[2] = pose->setting.hip_rotation_rad, to[3] = pose->setting.hip_abduction_rad;
    to[4] = pose->setting.knee_flexion_rad;
  }
  lay_springs(held, def, model);
  if (measured) limb_measured_springs(measured, model);
  // A site has the springs of the node nearest to it.
  for (uint32_t k = 0; k < SITES + parts; ++k) {
    uint32_t at =
        v_nearest(model->surface.vertices, model->surface.vertex_count, model->sites[k].position_m);
    model->sites[k].k0_n_m3 = model->k0_n_m3[at], model->sites[k].xm_m = model->xm_m[at];
  }
  lay_line(held, &veins, true, &model->vein);
  lay_line(held, &arteries, true, &model->artery);
  lay_branches(held, &veins, &arteries, model->anatomy);
  name_parts(held, station, model);
  return SONDE_OK;
}

sonde_status sonde_limb_model(const sonde_limb_body *body, const sonde_limb_model_def *def,
                              sonde_model **model, sonde_error *error) {
  SONDE_ASSERT(body && def && model);
  *model = NULL;
  if (!(def->edge_m >= 0.003 && def->edge_m <= 0.02))
    return sonde_fail(error, SONDE_ARGUMENT, "edge_m is %g, expected 0.003 to 0.02", def->edge_m);
  if (!(def->stiffness >= 0.2 && def->stiffness <= 5))
    return sonde_fail(error, SONDE_ARGUMENT, "stiffness is %g, expected 0.2 to 5", def->stiffness);
  limb_held held = {0};
  sonde_mesh skin = {0}, bones = {0};
  sonde_status status = sonde_limb_create(body, &held.limb, error);
  if (!status && def->setting)
    status = sonde_limb_pose_create(held.limb, def->setting, &held.pose, error);
  limb_measured *measured = NULL;
  if (!status && def->part) status = limb_measured_make(&held, def->part, &measured, error);
  if (!status) status = make(&held, def, measured, &skin, &bones, model, error);
  limb_measured_destroy(measured);
  sonde_mesh_clear(&skin);
  sonde_mesh_clear(&bones);
  if (status) {
    bool owned = *model && (*model)->map; // the limb is the map's
    sonde_model_destroy(*model);
    if (!owned) limb_held_clear(&held);
    *model = NULL;
  }
  return status;
}

const sonde_limb *sonde_limb_of(const sonde_model *model) {
  SONDE_ASSERT(model);
  const limb_held *held = limb_map_held(model->map);
  return held ? held->limb : NULL;
}

const sonde_limb_pose *sonde_limb_pose_of(const sonde_model *model) {
  SONDE_ASSERT(model);
  const limb_held *held = limb_map_held(model->map);
  return held ? held->pose : NULL;
}

sonde_limb_position sonde_limb_position_of(const sonde_model *model) {
  const sonde_limb_pose *pose = sonde_limb_pose_of(model);
  return pose ? pose->setting.position : SONDE_LIMB_POSITIONS;
}

sonde_status sonde_limb_model_load(const char *path, sonde_model **out, sonde_error *error) {
  sonde_model *model;
  *out = NULL;
  sonde_status status = sonde_model_load(path, &model, error);
  if (status || !model->map_origin) {
    *out = model;
    return status;
  }
  const double tolerance_m = 1e-6;
  sonde_limb_body body;
  sonde_limb_setting setting;
  limb_held held = {0};
  // The body from its numbers.
  const double *from = model->map_origin;
  double *number[MOST_NUMBERS];
  body = sonde_limb_unknown();
  const uint32_t count = body_numbers(&body, number);
  const bool posed = model->map_origin_count == ORIGIN_HEAD + count + ORIGIN_SETTING;
  bool good = (posed || model->map_origin_count == ORIGIN_HEAD + count) &&
              from[0] == (posed ? ORIGIN_POSED : ORIGIN_STRAIGHT) &&
              (from[1] == SONDE_SEX_FEMALE || from[1] == SONDE_SEX_MALE) &&
              (from[2] == SONDE_LIMB_RIGHT || from[2] == SONDE_LIMB_LEFT) && from[3] >= 0 &&
              from[3] < 4294967296.0 && from[4] >= 0 && from[4] < 4294967296.0;
  for (uint32_t k = 0; good && k < count; ++k) good = isfinite(*number[k] = from[ORIGIN_HEAD + k]);
  const double *held_as = from + ORIGIN_HEAD + count;
  if (good && posed) good = held_as[0] >= 0 && held_as[0] < SONDE_LIMB_POSITIONS;
  if (good) {
    body.sex = (sonde_sex)from[1], body.side = (sonde_limb_side)from[2];
    body.seed = (uint64_t)from[3] << 32 | (uint64_t)from[4];
  } else {
    status = sonde_fail(error, SONDE_VERSION,
                        "%s: describes a limb that this program does not know", path);
  }
  if (!status) status = sonde_limb_draw(&body, body.seed, &body, error);
  if (!status) status = sonde_limb_create(&body, &held.limb, error);
  if (!status && posed) {
    setting = (sonde_limb_setting){(sonde_limb_position)held_as[0], held_as[1], held_as[2],
                                   held_as[3], held_as[4]};
    status = sonde_limb_pose_create(held.limb, &setting, &held.pose, error);
  }
  if (!status) status = limb_map_create(&held, &model->map, error);
  if (status) {
    limb_held_clear(&held);
    sonde_model_destroy(model);
    return status;
  }
  // The same limb has its vein where the file says.
  sonde_vessel vein = {0};
  chain veins = find_chain(held.limb, VEINS);
  lay_line(&held, &veins, true, &vein);
  bool same = vein.count == model->vein.count;
  for (uint32_t k = 0; same && k < vein.count; ++k)
    same = v_distance(vein.point[k].centre_m, model->vein.point[k].centre_m) < tolerance_m;
  if (same) {
    *out = model;
    return SONDE_OK;
  }
  sonde_model_destroy(model);
  return sonde_fail(error, SONDE_VERSION,
                    "%s: was made by a program that makes another limb of this body; make it again",
                    path);
}
