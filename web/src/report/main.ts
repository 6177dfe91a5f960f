// A report: the document holds its data as JSON, whose member "kind" names the view that draws them.

import { exam } from "./exam";
import { fit } from "./fit";
import { h } from "./dom";
import { paper } from "./paper";
import { plain } from "./plain";
import { scene } from "./scene";
import { inEnglish } from "./number";
import { t } from "../words/language";

const VIEWS: Record<string, (data: unknown) => void> = { fit, scene, exam, paper };

try {
  const data = JSON.parse(document.getElementById("report")?.textContent ?? "") as { kind?: string };
  if (data.kind !== "exam") inEnglish();
  (VIEWS[data.kind ?? ""] ?? plain)(data);
} catch (error) {
  document.body.append(h("p", { class: "notes" }, t("report.cannot", { error: String(error) })));
  throw error;
}
