// Laws of drawn limbs: counts of violations over seeds, both sexes and body mass indices 17 to 40
// (docs/limb_vessels.md).
#include "limb_laws.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv) {
  long count = argc > 2 ? atol(argv[2]) : 200, first = argc > 3 ? atol(argv[3]) : 1;
  if (argc < 2 || argc > 4 || count < 1 || count > 100000 || first < 0) {
    fprintf(stderr, "usage: bench_limb OUT.csv [COUNT [SEED]]: COUNT limbs from SEED on\n");
    return 2;
  }
  FILE *out = fopen(argv[1], "w");
  if (!out) {
    fprintf(stderr, "bench_limb: %s cannot be written\n", argv[1]);
    return 1;
  }
  fprintf(out, "seed,sex,bmi,places,walls,bone,lumen,fascia,eye");
  for (int k = 1; k <= LIMB_VIEWS; ++k) fprintf(out, ",v%d,v%d_mm,v%d_off_mm", k, k, k);
  fprintf(out, ",vein_error_mm,thigh_ratio,calf_ratio\n");
  unsigned long sum[5] = {0}, places = 0, kept[LIMB_VIEWS] = {0}, within[LIMB_VIEWS] = {0};
  double error = 0, square = 0, ratio[2] = {0, 0};
  for (long k = 0; k < count; ++k) {
    sonde_limb_body body = sonde_limb_unknown();
    sonde_limb *limb = NULL;
    sonde_error failed = {0};
    body.sex = k % 2 ? SONDE_SEX_MALE : SONDE_SEX_FEMALE, body.bmi = 17 + (double)(k * 7 % 24);
    if (sonde_limb_draw(&body, (uint64_t)(first + k), &body, &failed) ||
        sonde_limb_create(&body, &limb, &failed)) {
      fprintf(stderr, "bench_limb: seed %ld: %s\n", first + k, failed.message);
      fclose(out);
      return 1;
    }
    sonde_limb_vessel_faults f = sonde_limb_vessel_check(limb);
    const unsigned faults[5] = {f.walls, f.bone, f.lumen, f.fascia, f.eye};
    unsigned long here = 0;
    for (uint32_t b = 0; b < sonde_limb_vessel_count(limb); ++b)
      here += sonde_limb_vessel_get(limb, b).points;
    places += here;
    fprintf(out, "%ld,%s,%g,%lu", first + k, k % 2 ? "male" : "female", body.bmi, here);
    for (int i = 0; i < 5; ++i) fprintf(out, ",%u", faults[i]), sum[i] += faults[i];
    limb_view view[LIMB_VIEWS];
    limb_views(limb, view);
    for (int i = 0; i < LIMB_VIEWS; ++i) {
      // How far the depth is beyond its band, mm; 0 within.
      double beyond = fmax(view[i].band_mm[0] - view[i].depth_mm, 0) +
                      fmax(view[i].depth_mm - view[i].band_mm[1], 0);
      kept[i] += !view[i].missing, within[i] += beyond <= 5;
      fprintf(out, ",%d,%.1f,%.1f", !view[i].missing, view[i].depth_mm, beyond);
    }
    sonde_limb_station stations[SONDE_LIMB_STATIONS];
    sonde_limb_stations(limb, stations);
    const sonde_limb_station *s = stations;
    while (strcmp(s->name, "common femoral vein") != 0) ++s;
    double off = 1e3 * s->depth_m - limb_vein_depth_mm(body.bmi), own[2];
    error += off / (double)count, square += off * off / (double)count;
    limb_muscle_ratio(limb, own);
    for (int i = 0; i < 2; ++i) ratio[i] += own[i] / (double)count;
    fprintf(out, ",%.2f,%.3f,%.3f\n", off, own[0], own[1]);
    sonde_limb_destroy(limb);
  }
  int full = fclose(out) != 0;
  printf("%ld limbs, %lu places: walls %lu, bone %lu, lumen in bone %lu, fascia %lu, eye %lu\n",
         count, places, sum[0], sum[1], sum[2], sum[3], sum[4]);
  for (int i = 0; i < LIMB_VIEWS; ++i)
    printf("V%d: true %.1f %%, depth within 5 mm of its band %.1f %%\n", i + 1,
           100.0 * (double)kept[i] / (double)count, 100.0 * (double)within[i] / (double)count);
  printf("common femoral vein against its rule: mean %.2f mm, RMS %.2f mm\n", error, sqrt(square));
  printf("volume of labelled muscle against its rule: thigh %.3f, calf %.3f\n", ratio[0], ratio[1]);
  if (full) fprintf(stderr, "bench_limb: %s could not be written\n", argv[1]);
  return full || sum[0] + sum[1] + sum[3] + sum[4] > 0;
}
