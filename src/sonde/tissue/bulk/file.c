// The inside of a volumetric model in the model file (docs/model_file.md).
#include "tissue/bulk/bulk.h"
#include "tissue/kinds.h"
#include "tissue/model_file.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

// Members of the law in the file's order.
static double *law_field(sonde_bulk_law *law, int index, const char **name) {
  const struct {
    const char *name;
    double *value;
  } field[] = {{"density_kg_m3", &law->density_kg_m3},
               {"damping_s", &law->damping_s},
               {"skin_n_m", &law->skin_n_m},
               {"spring_fat_pa", &law->spring_pa[SONDE_LAYER_FAT]},
               {"spring_muscle_pa", &law->spring_pa[SONDE_LAYER_MUSCLE]},
               {"steepening", &law->steepening},
               {"knee", &law->knee},
               {"volume_pa", &law->volume_pa},
               {"young_fat_pa", &law->young_pa[SONDE_LAYER_FAT]},
               {"young_muscle_pa", &law->young_pa[SONDE_LAYER_MUSCLE]},
               {"poisson", &law->poisson},
               {"stiffness_scale", &law->stiffness_scale}};
  if (index >= (int)SONDE_COUNT_OF(field)) return NULL;
  *name = field[index].name;
  return field[index].value;
}

void sonde_bulk_put_arrays(sonde_model_writer *w, const sonde_model *model) {
  const sonde_bulk *bulk = model->bulk;
  uint32_t skin = model->surface.vertex_count;
  uint32_t inner = bulk->node_count + bulk->held_count - skin;
  sonde_model_put(w, "bulk_nodes", "f64", "m", inner, 3, bulk->node + skin);
  sonde_model_put(w, "bulk_tetrahedra", "u32", "1", bulk->element_count, 4, bulk->element);
  sonde_model_put(w, "bulk_layer", "u32", "0 fat, 1 muscle", bulk->element_count, 1, bulk->layer);
}

void sonde_bulk_put_section(sonde_json_out *header, const sonde_model *model) {
  sonde_bulk_law law = model->bulk->law;
  const char *name;
  SONDE_ASSERT(model->kind != SONDE_TWO_LAYER);
  sonde_json_begin_object(header, "bulk");
  sonde_json_put_text(header, "kind", sonde_model_kind_name(model->kind));
  sonde_json_put_integer(header, "held", model->bulk->held_count);
  for (int k = 0; law_field(&law, k, &name); ++k)
    sonde_json_put_real(header, name, *law_field(&law, k, &name), 0);
  sonde_json_end(header);
}

sonde_status sonde_bulk_take(const sonde_model_reader *r, sonde_model *model) {
  const sonde_json *section = sonde_json_member(r->header, "bulk");
  if (!section) return SONDE_OK;
  const char *kind = sonde_json_as_text(sonde_json_member(section, "kind"));
  sonde_bulk_law law;
  const char *name;
  double *field;
  sonde_status status = sonde_model_kind_named(kind ? kind : "", &model->kind, r->error);
  if (status) return status;
  for (int k = 0; (field = law_field(&law, k, &name)) != NULL; ++k) {
    const sonde_json *item = sonde_json_member(section, name);
    if (sonde_json_kind_of(item) != SONDE_JSON_NUMBER)
      return sonde_fail(r->error, SONDE_FORMAT, "%s: bulk.%s is missing, expected a number",
                        r->path, name);
    *field = sonde_json_as_number(item);
  }
  uint32_t skin = model->surface.vertex_count, inner, count, layers;
  double held = sonde_json_as_number(sonde_json_member(section, "held"));
  const void *nodes = sonde_model_take(r, "bulk_nodes", "f64", 3, &inner);
  const void *corners = nodes ? sonde_model_take(r, "bulk_tetrahedra", "u32", 4, &count) : NULL;
  const void *layer = corners ? sonde_model_take(r, "bulk_layer", "u32", 1, &layers) : NULL;
  if (!layer) return SONDE_FORMAT;
  if (!(held >= 0 && held <= inner) || layers != count || count == 0)
    return sonde_fail(r->error, SONDE_FORMAT,
                      "%s: %g held of %u inner nodes, %u layers of %u tetrahedra", r->path, held,
                      inner, layers, count);
  sonde_bulk *bulk = model->bulk = SONDE_NEW(sonde_bulk, 1);
  if (!bulk) return sonde_fail_memory(r->error);
  bulk->held_count = (uint32_t)held, bulk->node_count = skin + inner - (uint32_t)held;
  bulk->element_count = count;
  bulk->node = SONDE_NEW(sonde_vec3, (size_t)skin + inner);
  bulk->element = sonde_calloc(count, sizeof *bulk->element);
  bulk->layer = SONDE_NEW(uint32_t, count);
  if (!bulk->node || !bulk->element || !bulk->layer) return sonde_fail_memory(r->error);
  memcpy(bulk->node, model->surface.vertices, skin * sizeof *bulk->node);
  memcpy(bulk->node + skin, nodes, (size_t)inner * sizeof *bulk->node);
  memcpy(bulk->element, corners, (size_t)count * sizeof *bulk->element);
  memcpy(bulk->layer, layer, (size_t)count * sizeof *bulk->layer);
  for (uint32_t i = 0; i < skin + inner; ++i)
    if (!(v_norm(bulk->node[i]) < 100))
      return sonde_fail(r->error, SONDE_FORMAT, "%s: bulk_nodes has a place beyond 100 m", r->path);
  // Every tetrahedron names nodes that there are, with a volume of its own.
  for (uint32_t e = 0; e < count; ++e) {
    const uint32_t *v = bulk->element[e];
    for (int c = 0; c < 4; ++c)
      if (v[c] >= skin + inner)
        return sonde_fail(r->error, SONDE_FORMAT,
                          "%s: tetrahedron %u names node %u, expected less than %u", r->path, e,
                          v[c], skin + inner);
    sonde_vec3 origin = bulk->node[v[0]], edge[3];
    for (int c = 0; c < 3; ++c) edge[c] = v_sub(bulk->node[v[c + 1]], origin);
    if (!(v_dot(v_cross(edge[0], edge[1]), edge[2]) > 0) || bulk->layer[e] >= SONDE_LAYERS)
      return sonde_fail(r->error, SONDE_FORMAT,
                        "%s: tetrahedron %u is inside out, flat or of no layer", r->path, e);
  }
  if (!status) status = sonde_model_set_bulk_law(model, &law, r->error);
  return status ? status : sonde_bulk_derive(bulk, model, r->error);
}
