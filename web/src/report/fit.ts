// The report of an estimation: what it found, how large its errors are and how well the data determine it.

import { h, keys, Page, paragraph } from "./dom";
import { fitCurves } from "./fit_curves";
import { type Errors, type FitReport, pointsOf } from "./fit_data";
import { CORRIDOR_PERCENT, fitErrors, fitErrorTables } from "./fit_errors";
import { fitCorrelation, fitIdentifiability, fitParameters, fitProfiles } from "./fit_estimates";
import { fitMaps } from "./fit_maps";
import { fixed, grouped, isKnown, real, short, signed, significant } from "./number";
import { columns } from "./table";

const SYNTHETIC = "The data are synthetic: they were computed, not measured on a person. \u201cMeasured\u201d below means \u201cin the data\u201d, and agreement is agreement with that computation.";

/** The depths at which a probe's bias leaves the corridor. */
function corridor(report: FitReport, probe: number): string {
  const known = report.errors!.depths.slice(1).filter((d) => d.probes[probe]);
  const outside = known.filter((d) => Math.abs(real(d.probes[probe]!.bias_percent)) > CORRIDOR_PERCENT);
  const places = outside.map((d) => `${short(d.depth_mm)}\u00a0mm (${signed(d.probes[probe]!.bias_percent, 1)}\u00a0%)`);
  if (places.length) return `; its bias leaves the corridor of \u00b18\u00a0% at ${places.join(", ")}`;
  return known.length ? "; its bias stays within \u00b18\u00a0% at every depth" : "";
}

function summary(page: Page, report: FitReport): void {
  const all = report.errors?.all;
  const main = report.stages?.find((stage) => stage.main);
  if (!all || !main) return;
  const section = page.section("summary", "Summary");
  const n = (v: Errors[keyof Errors], digits = 3): string => significant(v, digits);
  section.append(keys([`${n(all.mae_n)} N`, "mean absolute error"], [`${n(all.percent_of_mean)} %`, "of the mean force"], [`${n(all.sd_n)} N`, "standard deviation of the error"], [`${n(all.p95_abs_n)} N`, "95 % of errors are smaller"]));
  const parameters = main.parameters ? ` (${main.parameters} parameters)` : "";
  const missing = main.missing ? ` For ${grouped(main.missing)} measurements the model has no force; they are left out.` : "";
  section.append(
    paragraph(
      `The model of \u201c${main.name}\u201d${parameters} was compared with ${grouped(all.count)} forces measured at ${report.sites.length} sites under ${report.probes.length} probe${report.probes.length === 1 ? "" : "s"}. On average it misses a force by ${n(all.mae_n)}\u00a0N (mean absolute error, MAE), which is ${n(all.percent_of_mean)}\u00a0% of the mean force of ${n(all.mean_n)}\u00a0N. Half of the errors are below ${n(all.median_abs_n)}\u00a0N, 95\u00a0% below ${n(all.p95_abs_n)}\u00a0N; the largest is ${n(all.max_abs_n)}\u00a0N. Errors scatter by ${n(all.sd_n)}\u00a0N (standard deviation, SD) about a bias of ${n(all.bias_n, 2)}\u00a0N. An error is model minus measurement throughout.${missing}`,
    ),
  );
  const probes = report.probes.flatMap((name, p) => {
    const e = report.errors!.probes[p];
    return e ? [h("li", {}, "Probe ", h("b", {}, name), `: ${n(e.mae_n)}\u00a0N, ${n(e.percent_of_mean)}\u00a0% of its mean force${corridor(report, p)}.`)] : [];
  });
  section.append(h("ul", {}, ...probes));
  const worst = report.holdouts.reduce((a, b) => (real(b.percent) > real(a?.percent) || !isKnown(a?.percent) ? b : a), report.holdouts[0]);
  if (worst) section.append(paragraph(`On data it had not seen, the largest error is ${n(worst.percent)}\u00a0% of the mean force (left out: ${worst.left_out ?? ""}${worst.probe ? `; seen under probe ${worst.probe}` : ""}).`));
}

function stages(page: Page, report: FitReport): void {
  const list = report.stages ?? [];
  if (!list.length) return;
  const missing = list.some((stage) => stage.missing);
  const pooled = report.probes.length > 1;
  const cells = (e: Errors | null | undefined): string[] => [fixed(e?.mae_n, 3), fixed(e?.sd_n, 3), fixed(e?.percent_of_mean, 2)];
  const groups = [...report.probes, ...(pooled ? ["all probes"] : [])];
  page.table(page.section("stages", "Stages of the estimation"), {
    caption: `Errors of every stage against the same measurements. %: MAE over the mean force of the probe. ${missing ? "No force: measurements for which the model found no equilibrium, left out of that row. " : ""}The figures show the marked row.`,
    groups: [{ head: "", span: 2 }, ...groups.map((head) => ({ head, span: 3 })), ...(missing ? [{ head: "", span: 1 }] : [])],
    columns: columns("<Model", "Parameters", ...groups.flatMap(() => ["MAE, N", "SD, N", "%"]), ...(missing ? ["No force"] : [])),
    rows: list.map((stage) => ({
      strong: stage.main,
      cells: [stage.name, stage.parameters ? grouped(stage.parameters) : "", ...stage.probes.flatMap(cells), ...(pooled ? cells(stage.all) : []), ...(missing ? [grouped(stage.missing)] : [])],
    })),
  });
}

function holdouts(page: Page, report: FitReport): void {
  if (!report.holdouts.length) return;
  page.table(page.section("holdout", "Data that were held out"), {
    caption: "Errors on data that the estimation did not see. %: MAE over the mean force of the same data. A ratio near 1 says that the model predicts as well as it fits.",
    columns: columns("<Left out", "<Probe", "MAE, N", "SD, N", "MAE, %", "MAE of seen data, %", "Ratio"),
    rows: report.holdouts.map((o) => ({
      cells: [o.left_out ?? "", o.probe ?? "", fixed(o.mae_n, 3), fixed(o.sd_n, 3), fixed(o.percent, 2), fixed(o.training_percent, 2), fixed(real(o.training_percent) > 0 ? real(o.percent) / real(o.training_percent) : NaN, 2)],
    })),
  });
}

function timing(page: Page, report: FitReport): void {
  const list = report.timings;
  if (!list.length) return;
  const together = { strong: true, cells: ["together", fixed(list.reduce((sum, t) => sum + real(t.seconds), 0), 2)] };
  page.table(page.section("timing", "Time"), {
    caption: "Elapsed time on the machine that made this report.",
    columns: columns("<Step", "Seconds"),
    rows: [...list.map((t) => ({ cells: [t.name ?? "", fixed(t.seconds, 2)] })), ...(list.length > 1 ? [together] : [])],
  });
}

export function fit(data: unknown): void {
  const report = data as FitReport;
  const page = new Page(report.title ?? "Estimation report");
  page.facts([["Model", report.model], ["Data", report.provenance], ["Date", report.date], ["Version", report.version], ["Command", report.command_line, "code"]]);
  page.notes([...(report.synthetic ? [SYNTHETIC] : []), ...report.notes]);
  const points = pointsOf(report);
  summary(page, report);
  stages(page, report);
  fitCurves(page, report, points);
  fitErrors(page, report, points);
  fitErrorTables(page, report);
  fitMaps(page, report);
  fitParameters(page, report);
  fitCorrelation(page, report);
  fitProfiles(page, report);
  fitIdentifiability(page, report);
  holdouts(page, report);
  timing(page, report);
  page.show();
}
