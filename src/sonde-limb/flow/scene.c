// What flows in the vessels of a pressed model: which segment of the network each section belongs
// to, what probe and clots leave open of them, flows and profiles at a time.
#include "flow/gate.h"
#include "flow/scene.h"

#include "base/base.h"
#include "flow/blood.h"
#include "sonde/limb_model.h"

#include <string.h>

// Veins that the network has by themselves, by the limb's names; any other deep vein flows as the
// calf's main one, any other superficial one as the great saphenous.
static const struct {
  const char *name;
  sonde_flow_segment segment;
  uint32_t vein;
} VEIN[] = {{"external iliac vein", SONDE_FLOW_EXTERNAL_ILIAC, 0},
            {"common femoral vein", SONDE_FLOW_COMMON_FEMORAL, 0},
            {"femoral vein", SONDE_FLOW_FEMORAL, 0},
            {"second femoral vein", SONDE_FLOW_FEMORAL, 1},
            {"third femoral vein", SONDE_FLOW_FEMORAL, 1},
            {"popliteal vein", SONDE_FLOW_POPLITEAL, 0},
            {"second popliteal vein", SONDE_FLOW_POPLITEAL, 1},
            {"tibioperoneal trunk vein", SONDE_FLOW_CALF, SCENE_WHOLE},
            {"deep femoral vein", SONDE_FLOW_DEEP_FEMORAL, 0},
            {"great saphenous vein", SONDE_FLOW_GREAT_SAPHENOUS, 0},
            {"great saphenous", SONDE_FLOW_GREAT_SAPHENOUS, 0},
            {"small saphenous", SONDE_FLOW_CALF, SCENE_OTHER}};

static void find_vein(const char *name, scene_section *section) {
  const bool superficial = strstr(name, "saphenous") || strstr(name, "superficial") ||
                           strstr(name, "epigastric") || strstr(name, "pudendal");
  section->segment = superficial ? SONDE_FLOW_GREAT_SAPHENOUS : SONDE_FLOW_CALF;
  section->vein = SCENE_OTHER;
  for (size_t k = 0; k < SONDE_COUNT_OF(VEIN); ++k)
    if (strcmp(VEIN[k].name, name) == 0)
      section->segment = VEIN[k].segment, section->vein = VEIN[k].vein;
}

sonde_status sonde_flow_scene_create(const sonde_limb *limb, const sonde_interior *in,
                                     sonde_flow_scene **out, sonde_error *error) {
  SONDE_ASSERT(in && out);
  *out = NULL;
  uint32_t sections = 0;
  for (uint32_t v = 0; v < in->vessel_count; ++v) sections += in->course[v].count;
  sonde_flow_scene *s = SONDE_NEW(sonde_flow_scene, 1);
  scene_section *all = SONDE_NEW(scene_section, sections + 1);
  if (!s || !all) {
    sonde_free(s), sonde_free(all);
    return sonde_fail_memory(error);
  }
  s->interior = in, s->all = all;
  s->flow.time_s = (double)NAN;
  const sonde_limb_pose *pose = limb ? sonde_limb_pose_of(in->model) : NULL;
  for (uint32_t v = 0; v < in->vessel_count; ++v) {
    s->section[v] = all, all += in->course[v].count;
    char name[SONDE_LIMB_VESSEL_NAME];
    snprintf(name, sizeof name, "%s", sonde_interior_vessel_name(in, (int)v));
    for (char *c = name; *c; ++c) *c = *c == '_' ? ' ' : *c;
    for (uint32_t i = 0; i < in->course[v].count; ++i) {
      const sonde_vessel_section *at = &in->section[v][i];
      scene_section *section = &s->section[v][i];
      find_vein(name, section);
      // Models of legs have z downwards; a limb knows each branch's way.
      section->upwards = at->axis.z > 0 ? -1 : 1, section->share = 1;
      if (!limb) continue;
      // Vessels are looked up in the straight limb, their way is that of the position.
      sonde_vec3 point = sonde_limb_to_model(limb, at->rest_m);
      if (pose && !sonde_limb_pose_rest(pose, point, &point)) continue;
      const sonde_limb_vessel_near near = sonde_limb_vessel_at(limb, point);
      const sonde_limb_vessel_point place =
          pose ? sonde_limb_pose_place(pose, near.vessel, near.arc_m)
               : sonde_limb_vessel_place(limb, near.vessel, near.arc_m);
      const sonde_vec3 distal = place.direction;
      const sonde_limb_vessel branch = sonde_limb_vessel_get(limb, near.vessel);
      if ((branch.kind == SONDE_LIMB_ARTERY) != (in->course[v].kind == SONDE_VESSEL_ARTERY))
        continue;
      section->upwards =
          distal.x * at->axis.x + distal.y * at->axis.y - distal.z * at->axis.z > 0 ? -1 : 1;
      if (v == 0) find_vein(branch.name, section);
      const double least = 0.1;
      if (section->segment == SONDE_FLOW_CALF || section->segment >= SONDE_FLOW_DEEP_FEMORAL)
        section->share = fmax(1 - near.arc_m / branch.length_m, least);
    }
  }
  *out = s;
  return SONDE_OK;
}

void sonde_flow_scene_destroy(sonde_flow_scene *scene) {
  if (scene) sonde_free(scene->all);
  sonde_free(scene);
}

void sonde_flow_scene_narrow(const sonde_flow_scene *s, sonde_flow_def *def) {
  SONDE_ASSERT(s && def);
  const sonde_interior *in = s->interior;
  double sum[SONDE_FLOW_SEGMENTS][SONDE_FLOW_VEINS] = {{0}};
  uint32_t count[SONDE_FLOW_SEGMENTS][SONDE_FLOW_VEINS] = {{0}};
  for (uint32_t v = 0; v < in->vessel_count; ++v) {
    if (in->course[v].kind != SONDE_VESSEL_VEIN) continue;
    for (uint32_t i = 0; i < in->course[v].count; ++i) {
      const scene_section *section = &s->section[v][i];
      if (section->vein >= SONDE_FLOW_VEINS) continue;
      // Conductance over that of the round lumen at rest: an ellipse's 2 a^3 b^3/(a^2 + b^2), of
      // what a clot leaves as if it were an even share. Wider than at rest counts as rest: the
      // network widens its veins itself.
      const sonde_vessel_state *at = &in->state[v][i];
      const double a = at->half_short_m / at->rest_radius_m,
                   b = at->half_long_m / at->rest_radius_m;
      const double conducts = 2 * pow(scene_open(s, v, i), 2) * pow(a * b, 3) / (a * a + b * b);
      sum[section->segment][section->vein] += 1 / fmax(fmin(conducts, 1), 1e-9);
      ++count[section->segment][section->vein];
    }
  }
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k)
    for (int v = 0; v < SONDE_FLOW_VEINS; ++v) {
      if (count[k][v] == 0) continue;
      const double kept = sqrt(count[k][v] / sum[k][v]);
      def->closed[k][v] = 1 - (1 - def->closed[k][v]) * (kept < 1e-2 ? 0 : kept);
    }
}

void sonde_flow_scene_listen(sonde_flow_scene *s, sonde_gate *gate) {
  SONDE_ASSERT(s != NULL);
  s->gate = gate;
}

// How a segment's flow is shared by its veins.
static void share_out(sonde_flow_scene *s) {
  sonde_flow unit = s->flow;
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) {
    unit.flow_m3_s[k] = 1;
    for (uint32_t v = 0; v < SONDE_FLOW_VEINS; ++v)
      s->part[k][v] = sonde_flow_through(&unit, (sonde_flow_segment)k, v);
    s->main_per_m2[k] = sonde_flow_velocity(&unit, (sonde_flow_segment)k);
  }
}

// Moves the blood of the sections in the picture by the volumes that the run has sent through the
// segments, m3, and by its way along the arteries, m. Red cells stick together where the blood
// shears slower than 8 1/s. A valve's cusps stand half-way to each other in standing blood, open
// with the flow towards the heart and shut as the blood falls back.
static void move_blood(sonde_flow_scene *s, const double *ran_m3, double artery_m) {
  const double slow_per_s = 8, rest = 0.5, opens = 0.32, shuts = 0.45, opening_m_s = 0.03,
               shutting_m_s = 0.01;
  for (uint32_t v = 0; v < s->interior->vessel_count; ++v) {
    if (s->interior->course[v].count == 0) continue;
    const uint32_t i = s->shown[v];
    const scene_section *at = &s->section[v][i];
    const double gain = scene_gain(s, v, i), along = at->upwards;
    sonde_vessel_blood *blood = &s->blood[v];
    if (s->interior->course[v].kind == SONDE_VESSEL_ARTERY) {
      *blood = (sonde_vessel_blood){.path_m = blood->path_m - along * gain * artery_m,
                                    .speed_m_s = -along * gain * s->artery_m_s,
                                    .shut = rest};
      continue;
    }
    const sonde_vessel_state *now = &s->interior->state[v][i];
    const double radius_m = sqrt(now->half_short_m * now->half_long_m * scene_open(s, v, i));
    const double shear = // of a parabola, mean over the lumen
        radius_m > 0 ? 8 * gain * s->clearing_m3_s[at->segment] / (3 * radius_m * slow_per_s) : 0;
    const double speed = gain * s->flow.flow_m3_s[at->segment], size = fabs(speed);
    *blood = (sonde_vessel_blood){.path_m = blood->path_m + along * gain * ran_m3[at->segment],
                                  .speed_m_s = along * speed,
                                  .rouleaux = 1 / (1 + shear * shear),
                                  .shut = speed > 0 ? rest - opens * size / (size + opening_m_s)
                                                    : rest + shuts * (1 - s->flow.def.leak) * size /
                                                                 (size + shutting_m_s)};
  }
}

void sonde_flow_scene_run(sonde_flow_scene *s, sonde_flow *flow, double until_s) {
  SONDE_ASSERT(s && flow && isfinite(until_s));
  const double step_s = 1e-3;
  // One profile for all arteries, of the size of the thigh's.
  const double artery_radius_m = 3.5e-3;
  const double beats_hz = flow->def.heart_rate_hz;
  // Rouleaux form in seconds and break up in less than one.
  const double form = exp(-step_s / 5), clear = exp(-step_s / 0.3);
  double ran_m3[SONDE_FLOW_SEGMENTS] = {0}, artery_m = 0;
  if (!(flow->time_s == s->flow.time_s)) {
    enum { SAMPLES = 64 };
    double wave[SAMPLES];
    for (int k = 0; k < SAMPLES; ++k) wave[k] = sonde_flow_artery((double)k / SAMPLES);
    const double beat = beats_hz * flow->time_s;
    sonde_flow_pulsed(wave, SAMPLES, artery_radius_m, beats_hz, beat - floor(beat),
                      s->artery_profile);
    for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) {
      sonde_flow_steady(sonde_flow_velocity(flow, (sonde_flow_segment)k), s->profile[k]);
      s->clearing_m3_s[k] = fabs(flow->flow_m3_s[k]);
    }
  }
  s->flow = *flow;
  share_out(s);
  while (s->flow.time_s < until_s - 1e-9) {
    sonde_flow_step(&s->flow, step_s);
    for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) {
      const double area = sonde_flow_area(&s->flow, (sonde_flow_segment)k, 0);
      if (area > 0)
        sonde_flow_follow(s->profile[k], sqrt(area / SONDE_PI),
                          sonde_flow_velocity(&s->flow, (sonde_flow_segment)k), step_s);
      const double through = s->flow.flow_m3_s[k], size = fabs(through);
      ran_m3[k] += step_s * through;
      s->clearing_m3_s[k] =
          size + (size > s->clearing_m3_s[k] ? clear : form) * (s->clearing_m3_s[k] - size);
    }
    s->artery_m_s = sonde_flow_artery(beats_hz * s->flow.time_s);
    artery_m += step_s * s->artery_m_s;
    sonde_flow_follow(s->artery_profile, artery_radius_m, s->artery_m_s, step_s);
    if (s->gate) gate_step(s->gate, s, step_s);
  }
  s->artery_m_s = sonde_flow_artery(beats_hz * s->flow.time_s);
  *flow = s->flow;
  share_out(s);
  move_blood(s, ran_m3, artery_m);
}

sonde_flow_scene_memory sonde_flow_scene_remember(const sonde_flow_scene *s) {
  SONDE_ASSERT(s != NULL);
  sonde_flow_scene_memory memory = {.flow = s->flow};
  memcpy(memory.profile_m_s, s->profile, sizeof s->profile);
  memcpy(memory.artery_m_s, s->artery_profile, sizeof s->artery_profile);
  memcpy(memory.clearing_m3_s, s->clearing_m3_s, sizeof s->clearing_m3_s);
  for (uint32_t v = 0; v < SONDE_VESSELS; ++v) memory.path_m[v] = s->blood[v].path_m;
  return memory;
}

void sonde_flow_scene_recall(sonde_flow_scene *s, const sonde_flow_scene_memory *memory) {
  SONDE_ASSERT(s && memory);
  s->flow = memory->flow;
  memcpy(s->profile, memory->profile_m_s, sizeof s->profile);
  memcpy(s->artery_profile, memory->artery_m_s, sizeof s->artery_profile);
  memcpy(s->clearing_m3_s, memory->clearing_m3_s, sizeof s->clearing_m3_s);
  for (uint32_t v = 0; v < SONDE_VESSELS; ++v) s->blood[v].path_m = memory->path_m[v];
}

static uint32_t nearest_section(const sonde_flow_scene *s, uint32_t vessel, sonde_pose probe) {
  const sonde_interior *in = s->interior;
  uint32_t nearest = 0;
  double least = INFINITY;
  for (uint32_t i = 0; i < in->course[vessel].count; ++i) {
    const sonde_vec3 at = pose_apply_inverse(probe, in->state[vessel][i].centre_m);
    const double beside = at.x * at.x + at.y * at.y;
    if (beside < least) least = beside, nearest = i;
  }
  return nearest;
}

void sonde_flow_scene_show(sonde_flow_scene *s, sonde_pose probe) {
  SONDE_ASSERT(s != NULL);
  for (uint32_t v = 0; v < s->interior->vessel_count; ++v)
    s->shown[v] = nearest_section(s, v, probe);
}

const sonde_vessel_blood *sonde_flow_scene_blood(const sonde_flow_scene *s) {
  SONDE_ASSERT(s != NULL);
  return s->blood;
}

double sonde_flow_scene_velocity(const sonde_flow_scene *s, uint32_t vessel, sonde_pose pose) {
  SONDE_ASSERT(s && vessel < s->interior->vessel_count);
  if (s->interior->course[vessel].count == 0) return 0;
  const uint32_t i = nearest_section(s, vessel, pose);
  const bool artery = s->interior->course[vessel].kind == SONDE_VESSEL_ARTERY;
  return scene_gain(s, vessel, i) *
         (artery ? s->artery_m_s : s->flow.flow_m3_s[s->section[vessel][i].segment]);
}
