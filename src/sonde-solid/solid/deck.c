// A bonded press as a deck for CalculiX: the same mesh, laws and imposed displacements for another
// solver. Units: mm, N, MPa.
#include "equilibrium.h"

#include "base/base.h"

#include <string.h>

static const double mm_per_m = 1e3, mpa_per_pa = 1e-6;

sonde_status sonde_equilibrium_export(const sonde_equilibrium *e, const char *path,
                                      sonde_error *error) {
  static const char *const NAMES[] = {SONDE_SOLID_LAYER_NAMES};
  SONDE_ASSERT(e != NULL && path != NULL);
  const sonde_hexes *mesh = e->mesh;
  bool ogden = e->def.bonded;
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) ogden &= e->def.layer[k].energy != SONDE_ENERGY_FUNG;
  if (!ogden)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a deck holds a bonded press of Ogden or neo-Hookean layers");
  sonde_file *file;
  const sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "*NODE,NSET=ALL\n");
  for (uint32_t n = 0; n < mesh->node_count; ++n) {
    const sonde_vec3 p = v_scale(mesh->node[n], mm_per_m);
    sonde_file_printf(file, "%u,%.9g,%.9g,%.9g\n", n + 1, p.x, p.y, p.z);
  }
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    bool any = false;
    for (uint32_t h = 0; h < mesh->count; ++h) {
      const uint32_t *c = mesh->corner[h];
      if (mesh->layer[h] != k) continue;
      if (!any) sonde_file_printf(file, "*ELEMENT,TYPE=C3D8I,ELSET=%s\n", NAMES[k]);
      any = true;
      sonde_file_printf(file, "%u", h + 1);
      for (int i = 0; i < 8; ++i) sonde_file_printf(file, ",%u", c[i] + 1);
      sonde_file_printf(file, "\n");
    }
    if (!any) continue;
    // CalculiX: 2 mu/a^2 (S - 3) + (J - 1)^2/D.
    const sonde_hyperelastic *m = &e->def.layer[k];
    sonde_file_printf(file,
                      "*MATERIAL,NAME=%s\n*HYPERELASTIC,OGDEN,N=1\n%.9g,%.9g,%.9g\n"
                      "*SOLID SECTION,ELSET=%s,MATERIAL=%s\n",
                      NAMES[k], mpa_per_pa * m->shear_pa,
                      m->energy == SONDE_ENERGY_OGDEN ? m->exponent : 2,
                      2 / (mpa_per_pa * m->bulk_pa), NAMES[k], NAMES[k]);
  }
  sonde_file_printf(file, "*NSET,NSET=PUSHED\n");
  for (uint32_t k = 0; k < e->zone_count; ++k)
    sonde_file_printf(file, "%u,\n", e->zone_node[k] + 1);
  sonde_file_printf(file, "*BOUNDARY\n");
  for (uint32_t n = 0; n < mesh->node_count; ++n)
    for (int axis = 0; axis < 3; ++axis)
      if (mesh->held[n] >> axis & 1)
        sonde_file_printf(file, "%u,%d,%d,0\n", n + 1, axis + 1, axis + 1);
  sonde_file_printf(file, "*STEP,NLGEOM,INC=200\n*STATIC\n0.25,1.,1e-3,0.25\n*BOUNDARY\n");
  for (uint32_t k = 0; k < e->zone_count; ++k)
    for (int axis = 0; axis < 3; ++axis)
      if (!(mesh->held[e->zone_node[k]] >> axis & 1))
        sonde_file_printf(file, "%u,%d,%d,%.9g\n", e->zone_node[k] + 1, axis + 1, axis + 1,
                          mm_per_m * v_coordinate(e->moved[e->zone_node[k]], axis));
  sonde_file_printf(file, "*NODE PRINT,NSET=PUSHED,TOTALS=ONLY\nRF\n*END STEP\n");
  return sonde_file_commit(file, error);
}
