// No page says more than it knows. Every page of the list of routes is opened, read on a phone and on paper, while its
// server freezes, dies and comes back. The page's clock is turned forward where it has to wait, so that no step depends
// on how fast the machine is.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { checkAxe, checkWidth, open } from "./browser.mjs";
import { serve } from "./server.mjs";

const { FOLDER, SHOTS } = process.env;
const SOURCE = readFileSync(new URL("../src/routes.ts", import.meta.url), "utf8");
const ROUTES = [...SOURCE.matchAll(/^ {2}"([^"]+)",$/gm)].map(([, route]) => route);
const { browser, page, errors } = await open();

async function step(name, work) {
  const begun = Date.now();
  await work();
  const bad = errors.filter((text) => !/Failed to load resource|ERR_|Failed to fetch/.test(text));
  assert.deepEqual(bad, [], `errors in the console while: ${name}`);
  errors.length = 0;
  console.log(`   ${name} (${((Date.now() - begun) / 1000).toFixed(1)} s)`);
}

let server;
const ids = {};
await step("a server with something for every page", async () => {
  server = await serve("away");
  for (const name of ["mug", "gear"]) server.palpate("objects", "add", name, "--mesh", `${FOLDER}/meshes/${name}.stl`, "--unit", "mm");
  server.palpate("train", "--readings-per-object", 100);
  ids.job = (await server.json("/v1/jobs")).items[0].id;
  server.touch("mug", 4, 5);
  server.touch("gear", 4, 6);
  [ids.one, ids.other] = (await server.json("/v1/sessions?order=newest")).items.map((one) => one.id);
  const webhook = { url: "https://receiver.invalid/touch", events: ["session.decided"] };
  ids.webhook = (await server.json("/v1/webhooks", "POST", webhook)).webhook.id;
});

/** The address of a page of each route, and what is there once it has loaded. */
const PAGES = {
  fleet: ["fleet", ".fleet-row"],
  sessions: ["sessions", "tbody tr"],
  "sessions/:id": [`sessions/${ids.one}`, '.stage[data-state="ready"]'],
  "sessions/:id/at/:revision": [`sessions/${ids.one}/at/2`, '.stage[data-state="ready"]'],
  "compare/:id/:id": [`compare/${ids.one}/${ids.other}`, ".panel-posterior canvas"],
  objects: ["objects", ".card"],
  "objects/:name": ["objects/mug", '.stage[data-state="ready"]'],
  models: ["models", "tbody tr"],
  "models/:catalogue/:version": ["models/default/1", "tbody tr"],
  jobs: ["jobs", "tbody tr"],
  "jobs/:id": [`jobs/${ids.job}`, "main a[href*=models]"],
  sensors: ["sensors", "tbody tr"],
  "sensors/:name": ["sensors/digitacts-6x6", ".chart canvas"],
  keys: ["keys", ".note-empty"],
  audit: ["audit", "tbody tr"],
  snapshots: ["snapshots", "pre"],
  webhooks: ["webhooks", "tbody tr"],
  "webhooks/:id": [`webhooks/${ids.webhook}`, ".facts"],
  health: ["health", ".stat"],
};
assert.deepEqual(Object.keys(PAGES), ROUTES, "every page has its row here");

const has = (sign) => page.locator(sign).first().waitFor();
const isHeard = () => page.waitForFunction(() => document.querySelector(".silence") === null);
async function shot(name) {
  if (SHOTS) await page.screenshot({ path: `${SHOTS}/away-${name.replaceAll(/[/:]+/g, "-")}.png` });
}

/** Freezes the server when what it sent has arrived: an answer that was on its way would still be news. */
async function freeze() {
  await page.waitForTimeout(300);
  server.freeze();
  await page.waitForTimeout(300);
}

/** Asserts that nothing on the page claims to be so now. */
async function checkSilent(name) {
  await page.locator(".silence").waitFor();
  const said = await page.evaluate(() => ({
    bars: [...document.querySelectorAll(".silence")].map((one) => one.textContent),
    isFaded: document.querySelector("#main > .old") !== null,
    alerts: [...document.querySelectorAll("[role=alert]")].map((one) => one.textContent),
    states: [...document.querySelectorAll(".badge:not(.badge-past)")].map((one) => one.textContent).filter((text) => !/, \d+ \w+ ago$/.test(text)),
    text: document.querySelector("#main > div:last-child").textContent,
    title: document.title,
  }));
  assert.equal(said.bars.length, 1, `${name} says once that the server is silent`);
  assert.match(said.bars[0], /does not answer.*Last heard \d+ \w+ ago.*as of \d\d:\d\d:\d\d/, name);
  assert.ok(said.isFaded, `${name} is faded`);
  assert.deepEqual(said.alerts, [], `${name} repeats what the bar says`);
  assert.deepEqual(said.states, [], `${name} shows states without their age`);
  assert.doesNotMatch(said.text, /\blive\b|\blistening\b|readings arrive/i, name);
  assert.match(said.title, /^\(no answer\) .+ · Palpate$/, name);
}

/** Asserts what holds on a page that has loaded: its title, the units of its charts, on a phone and on paper. */
async function checkLoaded(name) {
  const { heads, title, axes, charts } = await page.evaluate(() => ({
    heads: [...document.querySelectorAll("h1")].map((one) => one.textContent.trim()),
    title: document.title,
    charts: document.querySelectorAll(".chart").length,
    axes: [...document.querySelectorAll(".chart .axis")].map((one) => one.textContent),
  }));
  assert.equal(heads.length, 1, `${name} has one heading`);
  assert.equal(title.replace(/^\(\d+\) /, ""), `${heads[0]} · Palpate`, `the tab of ${name} has its heading`);
  assert.equal(axes.length, 2 * charts, `both axes of the charts of ${name} have labels`);
  for (const axis of axes) assert.match(axis, /\((mm|kPa|%|bit|number)\)$/, `an axis of ${name} has its unit`);
  await page.setViewportSize({ width: 390, height: 844 });
  // The browser says when it has another width; the page's clock runs only here.
  const unfolded = page.locator("details.filters-fold[open]");
  for (let tries = 0; tries < 100; tries += 1) {
    await page.clock.runFor(300);
    if ((await unfolded.count()) === 0) break;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  await checkWidth(page, `${name} on a phone`);
  const phone = await page.evaluate(() => ({
    head: document.querySelector(".top").getBoundingClientRect().height,
    cut: [...document.querySelectorAll(".scroll > table.cards")].filter((one) => one.scrollWidth > one.parentElement.clientWidth + 1).map((one) => one.parentElement.ariaLabel),
    unfolded: document.querySelectorAll("details.filters-fold[open]").length,
  }));
  assert.ok(phone.head <= 56, `the pages are in one row, not in ${phone.head} pixels`);
  assert.deepEqual(phone.cut, [], `tables of ${name} are cut on a phone`);
  assert.equal(phone.unfolded, 0, `filters of ${name} are folded on a phone`);
  await shot(`phone-${name}`);
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.emulateMedia({ media: "print" });
  const printed = await page.evaluate(() => [...document.querySelectorAll("button, nav, form, .filters")].filter((one) => one.checkVisibility()).map((one) => one.textContent));
  assert.deepEqual(printed, [], `${name} prints what nobody can press on paper`);
  await page.emulateMedia({ media: "screen" });
}

await page.clock.install();
for (const [route, [path, sign]] of Object.entries(PAGES)) {
  await step(`${route}: whole, frozen, dead, and opened on a frozen server`, async () => {
    await page.goto(`${server.address}/?${encodeURIComponent(route)}#/${path}`);
    await has(sign);
    await page.clock.runFor(500);
    await checkLoaded(route);

    await freeze();
    await page.clock.runFor(7000);
    await checkSilent(`${route}, frozen,`);
    await page.clock.runFor(500);
    await checkAxe(page, `${route} of a frozen server`);
    await shot(`frozen-${route}`);
    server.thaw();
    await page.clock.runFor(1500);
    await isHeard();

    // Another page is there; this one is opened on a frozen server, and says so within two seconds.
    await page.evaluate((hash) => (location.hash = hash), path === "keys" ? "#/snapshots" : "#/keys");
    await page.getByRole("heading", { name: path === "keys" ? "Snapshots" : "Keys", exact: true }).waitFor();
    await has(path === "keys" ? "pre" : ".note-empty");
    await freeze();
    await page.evaluate((hash) => (location.hash = hash), `#/${path}`);
    await page.waitForFunction((hash) => location.hash === hash && document.querySelector("#main h1") !== null, `#/${path}`);
    await page.clock.runFor(2000);
    assert.equal(await page.locator(".silence").count(), 1, `${route} says within two seconds that nothing answers`);
    await checkSilent(`${route}, opened on a frozen server,`);
    await shot(`opened-${route}`);
    server.thaw();
    await page.clock.runFor(1500);
    await has(sign);
    await isHeard();

    await server.stop("SIGKILL");
    await page.clock.runFor(7000);
    await checkSilent(`${route}, dead,`);
    await shot(`dead-${route}`);
    await server.start();
    await page.clock.runFor(6000);
    await isHeard();
    await has(sign);
    await page.waitForFunction(() => document.querySelector("#main > .old, [role=alert]") === null);
  });
}

await step("figures of the store come from the store, also after a restart", async () => {
  await page.goto(`${server.address}/?figures#/health`);
  const figure = (name) => page.locator(".stat", { hasText: name }).locator("b").textContent();
  await has(".panel-storage .stat");
  const { n_readings: n } = await server.json("/v1/storage");
  const sent = await Promise.all([ids.one, ids.other].map(async (id) => (await server.json(`/v1/sessions/${id}`)).n_readings));
  assert.equal(n, sent[0] + sent[1], "the readings of all sessions");
  assert.equal(await figure("readings stored"), String(n));
  assert.equal(await figure("readings taken"), "0", "this process took none");
  const checks = await page.locator(".panel-checks td").allTextContents();
  assert.ok(checks.some((text) => /^[\d.]+ (kB|MB), [\d.]+ (kB|MB) live$/.test(text)), `bytes are in decimal units: ${checks}`);
  assert.ok(checks.every((text) => !/\d{7}/.test(text)), `no bare number of bytes: ${checks}`);
});

await step("an address that names no page has a heading and a title", async () => {
  await page.goto(`${server.address}/?nowhere#/no/such/page`);
  await page.getByRole("heading", { name: "Page not found", level: 1 }).waitFor();
  assert.equal(await page.title(), "Page not found · Palpate");
  await checkAxe(page, "no page");
});

await browser.close();
console.log("no page says more than it knows");
process.exit(0);
