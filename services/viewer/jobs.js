// The page of the operators: workers, queue, disk, networks, jobs, and why the last ones failed. It looks every few
// seconds while somebody sees it.

import { api } from "./api.js";
import { button, byId, element, problemOf, refill, showProblem } from "./dom.js";
import { t } from "./i18n.js";
import { jobLink, recipeLink } from "./joblinks.js";
import { byLabel, metricsOf, valueOf } from "./metrics.js";
import { titleOf } from "./problem_titles.js";
import { shell } from "./shell.js";

const EVERY_MS = 4000;
const FAILURES = 200; // jobs that are looked through for reasons
const STATES = ["queued", "succeeded", "failed", "cancelled"];
let [cursor, older] = [null, []];

async function look() {
  const parts = [showReadiness, showMetrics, showJobs, showFailures, showNetworks, showRecord].map((show) => show());
  const failed = (await Promise.allSettled(parts)).find(({ status }) => status === "rejected");
  showProblem(failed ? problemOf(failed.reason, "The service cannot be reached") : null);
}

async function showReadiness() {
  byId("version").value = (await api.json("version")).version;
  const problem = await api.json("readyz").then(() => null, (error) => problemOf(error));
  byId("ready").textContent = problem ? `${titleOf(problem)}: ${problem.detail}` : t("Ready: the queue answers and a worker is warm");
  byId("ready").className = problem ? "unsure" : "sure";
}

async function showMetrics() {
  const metrics = metricsOf(await (await api.fetch("metrics")).text());
  figures("workers", byLabel(metrics, "dlo_workers", "state"), t("no worker"));
  figures("queues", byLabel(metrics, "dlo_queue_depth", "queue"), t("nothing waits"));
  const rows = {};
  for (const { labels: { kind, state }, value } of metrics.filter(({ name }) => name === "dlo_jobs_total")) {
    (rows[kind] ??= {})[state] = value;
  }
  const cells = Object.entries(rows).map(([kind, by]) => [kind, ...STATES.map((state) => by[state] ?? 0)]);
  fillTable("counts", cells.sort(), (_, i) => i > 0);
  showDisk(valueOf(metrics, "dlo_disk_bytes"), valueOf(metrics, "dlo_disk_free_bytes"), valueOf(metrics, "dlo_disk_reserve_bytes"));
}

function figures(id, entries, none) {
  const parts = Object.entries(entries).map(([name, value]) => {
    const part = element("div");
    part.append(element("b", "", String(value)), element("span", "", t(name)));
    return part;
  });
  byId(id).replaceChildren(...(parts.length ? parts : [none]));
}

function showDisk(all, free, reserve) {
  if (!all) return void (byId("disk-text").textContent = t("This service does not measure its disk."));
  const gigabytes = (bytes) => `${(bytes / 1e9).toFixed(1)} GB`;
  byId("disk-free").value = t("{x} free", { x: gigabytes(free) });
  Object.assign(byId("disk"), { value: 1 - free / all, high: 0.9 * (1 - reserve / all), optimum: 0 });
  byId("disk-text").textContent = free < reserve
    ? t("Uploads are refused: less than {x} is free", { x: gigabytes(reserve) })
    : t("Uploads are accepted while {x} are free", { x: gigabytes(reserve) });
}

async function showJobs() {
  const state = byId("state").value;
  const page = await api.json(`v1/jobs?limit=50${state ? `&state=${state}` : ""}`);
  if (!older.length) cursor = page.next_cursor;
  byId("more").hidden = !cursor;
  const known = new Set(page.jobs.map(({ id }) => id));
  refill(byId("jobs"), [...page.jobs, ...older.filter(({ id }) => !known.has(id))].map(jobRow));
}

async function showOlder() {
  const state = byId("state").value;
  const page = await api.json(`v1/jobs?limit=50&cursor=${cursor}${state ? `&state=${state}` : ""}`);
  older.push(...page.jobs);
  cursor = page.next_cursor;
  await showJobs();
}

function jobRow(job) {
  const made = element("tr");
  const seconds = (from, to) => (from && to ? `${((new Date(to) - new Date(from)) / 1000).toFixed(1)} s` : "–");
  const link = element("td");
  link.append(jobLink(job));
  const percent = job.state === "running" ? ` ${Math.round(100 * job.progress)} %` : "";
  made.append(
    link, element("td", "", job.kind), element("td", job.state === "failed" ? "unsure" : "", t(job.state) + percent),
    element("td", "", new Date(job.created_at).toLocaleString()), element("td", "number", seconds(job.created_at, job.started_at)),
    element("td", "number", seconds(job.started_at, job.ended_at)), reasonCell(job.problem), doCell(job),
  );
  return made;
}

/** Why a job failed: its problem in the page's language, and what the service writes of it. */
function reasonCell(problem) {
  const cell = element("td", "", problem ? titleOf(problem) : "");
  if (problem) cell.append(element("p", "hint", problem.detail, { lang: "en" }));
  return cell;
}

/** What can be done with a job: one on its way is cancelled, one that succeeded becomes a recipe. */
function doCell(job) {
  const cell = element("td");
  const going = job.state === "queued" || job.state === "running";
  const act = going ? button(t("Cancel"), () => api.cancel(job.id).then(look, (error) => showProblem(problemOf(error)))) : recipeLink(job);
  if (act) cell.append(act);
  return cell;
}

async function showFailures() {
  const { jobs } = await api.json(`v1/jobs?state=failed&limit=${FAILURES}`);
  const reasons = Map.groupBy(jobs, ({ problem }) => problem?.code ?? "unknown");
  const rows = [...reasons].map(([code, all]) => {
    const made = element("tr");
    const reason = reasonCell(all[0].problem);
    reason.prepend(element("code", "", code), " ");
    const link = element("td");
    link.append(jobLink(all[0]));
    made.append(reason, element("td", "number", String(all.length)), element("td", "", new Date(all[0].ended_at).toLocaleString()), link);
    return made;
  });
  refill(byId("failures"), rows.length ? rows : [emptyRow(4, t("no job has failed"))]);
}

/** The record of the job that the address names, and in words why it failed. */
async function showRecord() {
  const id = new URLSearchParams(location.search).get("job");
  byId("record").hidden = !id;
  if (!id) return;
  byId("record-id").value = id;
  const job = await api.json(`v1/jobs/${encodeURIComponent(id)}`);
  byId("record-state").textContent = `${job.kind}, ${t(job.state)}`;
  showProblem(job.problem, byId("record-problem"));
  const text = JSON.stringify(job, null, 2);
  if (byId("record-json").textContent !== text) byId("record-json").textContent = text; // a selection in it stays
}

async function showNetworks() {
  const networks = await api.networks();
  byId("network-count").value = networks.length;
  const cells = networks.map(({ name, version, task, default: taken, warm, bytes }) => [
    `${name} ${version}`, task, t(taken ? "yes" : "no"), t(warm ? "yes" : "when asked for"), (bytes / 1e6).toFixed(1),
  ]);
  fillTable("networks", cells, (_, i) => i === 4);
}

function fillTable(id, rows, isNumber) {
  const made = rows.map((cells) => {
    const row = element("tr");
    row.append(...cells.map((value, i) => element("td", isNumber(value, i) ? "number" : "", String(value))));
    return row;
  });
  refill(byId(id), made);
}

function emptyRow(columns, text) {
  const row = element("tr");
  row.append(element("td", "hint", text, { colSpan: columns }));
  return row;
}

shell(look);
byId("state").addEventListener("change", () => {
  [cursor, older] = [null, []];
  look();
});
byId("more").addEventListener("click", () => showOlder().catch((error) => showProblem(problemOf(error))));
look();
setInterval(() => document.hidden || look(), EVERY_MS);
