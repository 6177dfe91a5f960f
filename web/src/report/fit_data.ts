// What src/sonde-fit/fit/report.c writes, and the measurements sorted out into points.

import { type Real, real } from "./number";

/** Errors (model minus measurement) of some measurements. */
export interface Errors {
  count: number;
  mean_n: Real;
  mae_n: Real;
  sd_n: Real;
  sd_abs_n: Real;
  rmse_n: Real;
  bias_n: Real;
  median_abs_n: Real;
  p95_abs_n: Real;
  max_abs_n: Real;
  percent_of_mean: Real;
  percent_of_range: Real;
  percent_of_largest: Real;
  /** summed errors over summed forces */
  bias_percent: Real;
  /** quartiles of the single relative errors */
  low_percent: Real;
  high_percent: Real;
}

export interface Stage {
  name: string;
  parameters: number;
  missing: number;
  main: boolean;
  probes: (Errors | null)[];
  all?: Errors;
}

export interface Distribution {
  name: string;
  centre_n: Real;
  scale_n: Real;
  freedom?: Real;
  log_likelihood: Real;
  aic: Real;
  share_per_bar: Real[];
}

export interface Histogram {
  from_n: number;
  step_n: number;
  count: number[];
  outside: number;
  distributions: Distribution[];
}

export interface Site {
  id: number;
  position_mm: Real[];
  normal: Real[];
  along: Real[];
  fat_mm: Real;
}

export interface Interval {
  value: Real;
  lower: Real;
  upper: Real;
  bootstrap_lower: Real;
  bootstrap_upper: Real;
}

export interface SiteParameters {
  site: number;
  k0_kpa_mm: Interval;
  xm_mm: Interval;
  shear_n_m?: Interval;
  shear_limit?: Interval;
}

export interface Profile {
  name?: string;
  unit?: string;
  x: Real[];
  rise: Real[];
  quadratic?: Real[];
  estimate: Real;
  threshold: number;
  lower: Real;
  upper: Real;
}

export interface FitReport {
  title?: string;
  model?: string;
  provenance?: string;
  date?: string;
  version?: string;
  command_line?: string;
  synthetic: boolean;
  notes: string[];
  probes: string[];
  sites: Site[];
  rows?: { site: number[]; probe: number[]; depth_mm: number[]; force_n: number[]; model_n?: Real[]; band_n?: Real[] };
  stages?: Stage[];
  errors?: { all?: Errors; probes: (Errors | null)[]; bin_mm: number; depths: { depth_mm: number; probes: (Errors | null)[] }[]; sites: (Errors & { site: number })[]; histogram?: Histogram };
  skin?: { position_mm: Real[]; face: number[]; k0_kpa_mm: Real[]; xm_mm: Real[]; shear_n_m?: Real[]; shear_limit?: Real[]; muscle_depth_mm?: Real[]; fat_correlates_with_k0: Real; fat_correlates_with_xm: Real };
  parameters: { name?: string; unit?: string; note?: string; estimate: Interval }[];
  site_parameters: SiteParameters[];
  correlation?: { names: string[]; values: Real[] };
  profiles: Profile[];
  identifiability: { parameter?: string; data?: string; relative_sd: Real }[];
  holdouts: { left_out?: string; probe?: string; mae_n: Real; sd_n: Real; percent: Real; training_percent: Real }[];
  timings: { name?: string; seconds: Real }[];
}

/** A measurement; NaN where the model has no force or no band. */
export interface Point {
  site: number;
  probe: number;
  depth_mm: number;
  force_n: number;
  model_n: number;
  band_n: number;
}

export function pointsOf(report: FitReport): Point[] {
  const rows = report.rows;
  if (!rows) return [];
  return rows.site.map((site, i) => ({ site, probe: rows.probe[i]!, depth_mm: rows.depth_mm[i]!, force_n: rows.force_n[i]!, model_n: real(rows.model_n?.[i]), band_n: real(rows.band_n?.[i]) }));
}
