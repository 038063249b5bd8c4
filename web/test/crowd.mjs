// The dashboard with a crowd: 125 open sessions, of which some need somebody, and 2,000 objects.
// Measures requests, bytes and the renderer's memory of each page; `OUT=FILE` keeps the figures.
// With `PAGES=FOLDER` the pages are those of another build of the dashboard, for comparison: then
// nothing is asserted, and pages that it lacks have no figures.
import assert from "node:assert/strict";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { open } from "./browser.mjs";

const { PALPATE_SERVER: SERVER, OUT, PAGES } = process.env;
const N_OBJECTS = Number(process.env.N_OBJECTS ?? 2000);
const N_SESSIONS = 125;
const N_STUCK = 7;
/** Undecided sessions without a reading for this long need somebody. */
const STUCK_MS = 60_000;
/** Most memory of the renderer that a page may keep, MB; the pages are far below it. */
const MEMORY_MAX_MB = 300;
/** Requests at once. */
const AT_ONCE = 8;

const json = async (path) => (await fetch(SERVER + path)).json();

async function send(method, path, body, type = "application/json") {
  const content = type === "application/json" ? JSON.stringify(body) : body;
  const answer = await fetch(SERVER + path, { method, headers: { "content-type": type }, body: content });
  assert.ok(answer.ok, `${method} ${path}: ${answer.status} ${answer.ok ? "" : await answer.text()}`);
  return answer.json();
}

/** Does something `n` times, a few at once. */
async function times(n, work) {
  let next = 0;
  const one = async () => {
    while (next < n) await work(next++);
  };
  await Promise.all(Array.from({ length: AT_ONCE }, one));
}

/** A ball of about ten thousand triangles with a size of its own, as a binary STL in millimetres. */
function ball(radius) {
  const [rows, cols] = [72, 72];
  const point = (i, j) => {
    const [a, b] = [(Math.PI * i) / rows, (2 * Math.PI * j) / cols];
    return [radius * Math.sin(a) * Math.cos(b), radius * Math.sin(a) * Math.sin(b), radius * Math.cos(a)];
  };
  const triangles = [];
  for (let i = 0; i < rows; i += 1) {
    for (let j = 0; j < cols; j += 1) {
      const [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
      if (i < rows - 1) triangles.push([a, b, c]);
      if (i > 0) triangles.push([a, c, d]);
    }
  }
  const file = Buffer.alloc(84 + 50 * triangles.length);
  file.writeUInt32LE(triangles.length, 80);
  for (const [n, corners] of triangles.entries()) {
    for (const [k, value] of corners.flat().entries()) file.writeFloatLE(value, 84 + 50 * n + 12 + 4 * k);
  }
  return file;
}

const nothing = (seq) => ({
  sensor: "digitacts-6x6", robot: "arm", seq, image: Array(36).fill(0),
  pose: { position: [0, 0, 0.1], orientation: [0, 0, 0, 1] },
});

await send("POST", "/v1/objects", { name: "first" });
await send("PUT", "/v1/objects/first/mesh?unit=mm", ball(30), "model/stl");
await send("POST", "/v1/objects", { name: "second" });
await send("PUT", "/v1/objects/second/mesh?unit=mm", ball(45), "model/stl");
const job = await send("POST", "/v1/catalogues/default/trainings", { readings_per_object: 60, n_classes: 8 });
while ((await json(`/v1/jobs/${job.id}`)).state !== "succeeded") await new Promise((done) => setTimeout(done, 500));
const touched = async (n) => {
  const { id } = await send("POST", "/v1/sessions", { labels: { n: String(n) } });
  await send("POST", `/v1/sessions/${id}/readings?belief=none`, { readings: [nothing(n)] });
  return id;
};
const stuck = new Set();
await times(N_STUCK, async (n) => stuck.add(await touched(n)));
const since = Date.now();
const mesh = ball(40);
await times(N_OBJECTS - 2, async (n) => {
  const name = `thing-${String(n).padStart(4, "0")}`;
  await send("POST", "/v1/objects", { name });
  await send("PUT", `/v1/objects/${name}/mesh?unit=mm`, mesh, "model/stl");
});
await new Promise((done) => setTimeout(done, Math.max(0, since + STUCK_MS + 2000 - Date.now())));
await times(N_SESSIONS - N_STUCK, (n) => touched(N_STUCK + n));
console.log(`   ${N_OBJECTS} objects and ${N_SESSIONS} sessions are there`);

const { browser, page, errors, expected } = await open();
// A session without a touch cannot say where to touch next.
expected.add(409);
await page.setViewportSize({ width: 1440, height: 900 });
const devtools = await page.context().newCDPSession(page);
await devtools.send("Network.enable");
let traffic = { requests: 0, bytes: 0 };
devtools.on("Network.loadingFinished", ({ encodedDataLength }) => {
  traffic.requests += 1;
  traffic.bytes += encodedDataLength;
});

/** Whether a process was started by this one, at any remove. */
function isOurs(pid) {
  for (let at = pid; at > 1; at = Number(/^PPid:\s+(\d+)/m.exec(readFileSync(`/proc/${at}/status`, "utf8"))[1])) {
    if (at === process.pid) return true;
  }
  return false;
}

/** Proportional memory of this browser's renderers, MB. */
function renderersMb() {
  let kb = 0;
  for (const pid of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    try {
      const line = readFileSync(`/proc/${pid}/cmdline`, "utf8");
      if (!line.includes("--type=renderer") || !isOurs(Number(pid))) continue;
      kb += Number(/^Pss:\s+(\d+)/m.exec(readFileSync(`/proc/${pid}/smaps_rollup`, "utf8"))?.[1] ?? 0);
    } catch {
      // It ended meanwhile.
    }
  }
  return kb / 1024;
}

const figures = {};
async function measure(name, path, sign, then = async () => {}) {
  traffic = { requests: 0, bytes: 0 };
  const begun = Date.now();
  // Another address before `#` loads the page anew.
  await page.goto(`${SERVER}/?${name.replaceAll(" ", "-")}#/${path}`);
  try {
    await page.locator(sign).first().waitFor();
    await then();
  } catch (error) {
    if (!PAGES) throw error;
    console.log(`   ${name}: not as expected: ${String(error).split("\n")[0]}`);
    if ((await page.locator(sign).count()) === 0) return;
  }
  await page.waitForTimeout(4000);
  if (!PAGES) assert.deepEqual(errors, [], `errors in the console on: ${name}`);
  const before = renderersMb();
  // What nobody needs is freed late while there is room: a leak is what stays.
  await devtools.send("HeapProfiler.collectGarbage");
  await page.waitForTimeout(1000);
  const memory = renderersMb();
  figures[name] = { requests: traffic.requests, kilobytes: Math.round(traffic.bytes / 1000), renderer_mb: Math.round(memory), with_garbage_mb: Math.round(before) };
  console.log(`   ${name}: ${traffic.requests} requests, ${figures[name].kilobytes} kB, ${figures[name].renderer_mb} MB, ${figures[name].with_garbage_mb} MB with garbage (${((Date.now() - begun) / 1000).toFixed(1)} s)`);
  assert.ok(PAGES || memory <= MEMORY_MAX_MB, `${name} takes ${memory.toFixed(0)} MB of the renderer`);
}

await measure("fleet", "fleet", ".fleet-row", async () => {
  await page.getByText(`${N_SESSIONS} open sessions, ${N_STUCK} need attention`).waitFor();
  const links = await page.locator(".fleet-link").evaluateAll((all) => all.map((one) => one.getAttribute("href")));
  const first = links.slice(0, N_STUCK).map((href) => href.split("/").at(-1));
  assert.deepEqual(new Set(first), stuck, "those that need somebody come first");
  await page.getByRole("button", { name: "Show more" }).click();
  await page.waitForFunction((n) => document.querySelectorAll(".fleet-row").length === n, N_SESSIONS);
  if (PAGES) return;
  // The way back leads to the same rows at the same place; a reload as well.
  await page.evaluate(() => scrollTo(0, 2000));
  await page.waitForFunction(() => history.state?.scrolled === 2000);
  const isThere = () => page.waitForFunction(() => Math.abs(scrollY - 2000) < 2);
  // One that is in view, or the click would scroll.
  await page.evaluate(() => [...document.querySelectorAll(".fleet-link")].find((one) => one.getBoundingClientRect().top > 200).click());
  await page.locator(".stage").waitFor();
  await page.goBack();
  await isThere();
  await page.waitForTimeout(1500);
  await isThere();
  await page.reload();
  await isThere();
  // A search looks into all sessions, and its link finds the same.
  await page.getByLabel("Search", { exact: true }).fill("n=124");
  await page.waitForFunction(() => document.querySelectorAll(".fleet-row").length === 1);
  await page.reload();
  await page.waitForFunction(() => document.querySelectorAll(".fleet-row").length === 1);
  await page.getByLabel("Search", { exact: true }).fill("no such robot");
  await page.getByText("No open session fits").waitFor();
});
await measure("sessions", "sessions", "tbody tr");
const last = `thing-${String(N_OBJECTS - 3).padStart(4, "0")}`;
/** Waits until the page knows all objects, of which few are elements (an older dashboard made all). */
const allObjects = () => page.locator(`.card[aria-setsize="${N_OBJECTS}"], .card:nth-child(${N_OBJECTS})`).first().waitFor();
await measure("objects", "objects", ".card", allObjects);
await measure("objects scrolled to the end", "objects", ".card", async () => {
  await allObjects();
  const isAtEnd = () => page.evaluate(() => scrollY + innerHeight >= document.documentElement.scrollHeight - 2);
  while (!(await isAtEnd())) {
    await page.evaluate(() => scrollBy(0, 800));
    await page.waitForTimeout(60);
  }
  await page.locator(".card", { hasText: last }).locator("canvas[data-picture]").waitFor();
});
await measure("models", "models", "tbody tr");
await measure("jobs", "jobs", "tbody tr");
await measure("sensors", "sensors", "tbody tr");
await measure("health", "health", ".stat");
await measure("an object", "objects/first", ".stage");
await measure("a session", `sessions/${[...stuck][0]}`, ".stage");
await browser.close();
if (OUT) writeFileSync(OUT, `${JSON.stringify({ objects: N_OBJECTS, sessions: N_SESSIONS, pages: figures }, null, 2)}\n`);
console.log("the dashboard bears a crowd");
