// What has been: sessions searched, compared, labelled, saved and closed with the truth; a version
// tried on them; the audit log and snapshots. Runs on the servers of `tests/dashboard`, after
// `dashboard.mjs`.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { checkAxe, checkWidth, open } from "./browser.mjs";

const { PALPATE, FOLDER, SHOTS, GUARDED, ADMIN_KEY, PALPATE_SERVER: SERVER } = process.env;
const { browser, page, errors, expected } = await open();
const json = async (path) => (await fetch(SERVER + path)).json();
const palpate = (...args) => execFileSync(PALPATE, args.map(String), { stdio: ["ignore", "pipe", "pipe"] }).toString();

async function step(name, work) {
  const begun = Date.now();
  await work();
  assert.deepEqual(errors, [], `errors in the console while: ${name}`);
  expected.clear();
  console.log(`   ${name} (${((Date.now() - begun) / 1000).toFixed(1)} s)`);
}

async function shot(name) {
  if (SHOTS) await page.screenshot({ path: `${SHOTS}/dashboard-${name}.png`, fullPage: true });
}

/** Touches a mesh nine times; the id of the session. The answer may be wrong, which is exit 4. */
function touch(mesh, seed, object = mesh) {
  const args = ["touch", "--object", object, "--mesh", `${FOLDER}/meshes/${mesh}.stl`, "--readings", 9, "--seed", seed, "--json"];
  try {
    return JSON.parse(palpate(...args)).session;
  } catch (error) {
    return JSON.parse(error.stdout).session;
  }
}

const mug = touch("mug", 21);
const hammer = touch("hammer", 22);
const rowOf = (id) => page.locator("tbody tr", { hasText: id.slice(-8) });

await step("sessions are listed newest first and searched", async () => {
  await page.goto(`${SERVER}/#/sessions`);
  await rowOf(mug).waitFor();
  const first = await page.locator("tbody tr").first().textContent();
  assert.ok(first.includes(hammer.slice(-8)), `the newest is first: ${first}`);
  const best = (await json(`/v1/sessions/${mug}`)).latest.best.name;
  const shown = () => page.locator("tbody tr").count();
  const all = await shown();
  await page.getByLabel("Robot").pressSequentially("simu");
  await page.waitForFunction(() => location.hash === "#/sessions?robot=simu");
  await page.getByLabel("Robot").fill("nobody");
  await page.getByText("No session fits").waitFor();
  // The filter is a link, survives a reload, and is there on the way back.
  await page.reload();
  await page.getByText("No session fits").waitFor();
  assert.equal(await page.getByLabel("Robot").inputValue(), "nobody");
  await page.getByRole("navigation").getByRole("link", { name: "Jobs" }).click();
  await page.getByRole("heading", { name: "Jobs", exact: true }).waitFor();
  await page.goBack();
  await page.getByText("No session fits").waitFor();
  await page.getByRole("button", { name: "Clear filters" }).click();
  await rowOf(mug).waitFor();
  assert.equal(await shown(), all);
  await page.getByLabel("Object").selectOption(best);
  await page.waitForFunction((name) => [...document.querySelectorAll("tbody tr")].every((row) => row.textContent.includes(name)), best);
  await page.getByLabel("Labels").fill("site=oslo");
  // The list is read again meanwhile, which must not take back what is typed.
  await page.waitForTimeout(6000);
  await page.getByLabel("Labels").press("Enter");
  await page.getByText("No session fits").waitFor();
  await page.getByRole("button", { name: "Show all sessions" }).click();
  await rowOf(hammer).waitFor();
  await checkAxe(page, "the sessions");
  await shot("sessions");
});

await step("two sessions are compared side by side", async () => {
  for (const id of [mug, hammer]) await page.getByLabel(`Compare session ${id.slice(-8)}`).check();
  await page.getByRole("button", { name: "Compare two" }).click();
  await page.getByRole("heading", { name: `Session ${mug.slice(-8)}`, exact: true }).waitFor();
  await page.getByRole("heading", { name: `Session ${hammer.slice(-8)}`, exact: true }).waitFor();
  await page.waitForFunction(() => document.querySelectorAll(".panel-posterior canvas").length >= 4);
  await checkAxe(page, "a comparison of sessions");
  await shot("compare");
});

await step("a session is labelled, saved, and linked to at a revision", async () => {
  await page.goto(`${SERVER}/#/sessions/${mug}`);
  await page.getByRole("button", { name: "Edit" }).click();
  await page.getByLabel(/Keys and values/).fill("site=oslo, shift = night");
  await page.getByRole("button", { name: "Set labels" }).click();
  await page.getByText("shift=night").waitFor();
  assert.deepEqual((await json(`/v1/sessions?labels=site:oslo`)).items.map((one) => one.id), [mug]);
  const saved = async (name) => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name }).click()]);
    return readFileSync(await download.path(), "utf8");
  };
  const whole = JSON.parse(await saved("Save as JSON"));
  assert.deepEqual([whole.session.id, whole.readings.length, whole.replay.steps.length], [mug, 9, 9]);
  // Small numbers are written in two ways.
  const cells = (text) => text.trimEnd().split("\n").map((line) => line.split(",").map((cell) => (cell === "" || Number.isNaN(Number(cell)) ? cell : Number(cell))));
  const table = await saved("Save as CSV");
  assert.deepEqual(cells(table), cells(palpate("sessions", "export", mug, "--format", "csv")), "the command writes the same");
  await page.getByRole("slider", { name: "Revision" }).focus();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => location.hash.endsWith("/at/2"));
  await page.reload();
  await page.getByText("as of revision 2").waitFor();
  // A revision that the session does not have is the newest, also in the address.
  await page.goto(`${SERVER}/?moment#/sessions/${mug}/at/99`);
  await page.getByText("newest", { exact: true }).waitFor();
  await page.waitForFunction((hash) => location.hash === hash, `#/sessions/${mug}`);
});

await step("any reading can be retracted and put back, and the truth told at the end", async () => {
  await page.goto(`${SERVER}/#/sessions/${mug}`);
  const contributions = page.getByRole("region", { name: "Contributions of readings" });
  await contributions.getByRole("button", { name: /^4/ }).click();
  await contributions.getByRole("button", { name: "Retract" }).first().click();
  await page.waitForFunction(() => document.querySelector(".replay input").max === "10");
  assert.equal((await json(`/v1/sessions/${mug}`)).n_retracted, 1);
  await page.getByText(/^Revision 10, a reading was retracted \(8 readings\)/).waitFor();
  const row = contributions.getByRole("row", { name: /^4/ });
  await row.getByText("retracted").waitFor();
  const before = (await json(`/v1/sessions/${mug}/belief?at=9`)).objects;
  await row.getByRole("button", { name: "Put back" }).click();
  await row.getByText("put back as 11").waitFor();
  await page.getByText(/^Revision 11, a reading arrived \(9 readings\)/).waitFor();
  const after = (await json(`/v1/sessions/${mug}/belief`)).objects;
  for (const [i, { name, probability }] of before.slice(0, 2).entries()) {
    assert.equal(after[i].name, name);
    assert.ok(Math.abs(after[i].probability - probability) < 1e-6, `${name} is as likely as before: ${after[i].probability}, ${probability}`);
  }
  // What the readings changed when they came adds up to all that was learnt.
  const prior = (await json(`/v1/sessions/${mug}/belief?at=0`)).objects.find((one) => one.name === after[0].name).probability;
  const came = await contributions.locator("tbody tr td:nth-of-type(2)").allTextContents();
  const bits = came.reduce((sum, text) => sum + Number(text.replace("−", "-")), 0);
  const at = async (revision) => (await json(`/v1/sessions/${mug}/belief?at=${revision}`)).objects.find((one) => one.name === after[0].name).probability;
  const learnt = Math.log2((await at(9)) / prior) + Math.log2((await at(11)) / (await at(10)));
  assert.ok(Math.abs(bits - learnt) < 0.01 * came.length, `${bits} of ${learnt} bits`);
  await page.getByRole("button", { name: "Close session …" }).click();
  await page.getByLabel("It was").selectOption("mug");
  await checkAxe(page, "closing a session");
  await page.getByRole("dialog").getByRole("button", { name: "Close session" }).click();
  await page.getByText("closed", { exact: true }).waitFor();
  assert.equal((await json(`/v1/sessions/${mug}`)).truth.name, "mug");
});

await step("a new alarm is notified once, and an old one is not", async () => {
  await page.context().grantPermissions(["notifications"], { origin: SERVER });
  await page.addInitScript(() => {
    window.notified = [];
    const Recorded = class {
      constructor(title, options) {
        window.notified.push({ title, ...options });
      }
    };
    Recorded.permission = "granted";
    Recorded.requestPermission = async () => "granted";
    window.Notification = Recorded;
  });
  touch("hand", 23, "mug");
  await page.goto(`${SERVER}/?notify#/fleet`);
  await page.locator(".fleet-row").first().waitFor();
  await page.getByRole("button", { name: "Notify me" }).click();
  const alarmed = touch("hand", 7, "mug");
  await page.waitForFunction((id) => window.notified.some((one) => one.tag === id), alarmed);
  await page.waitForTimeout(4000);
  const tags = await page.evaluate(() => window.notified.map((one) => one.tag));
  assert.deepEqual(tags, [alarmed]);
});

await step("a version is tried on what was recorded before it becomes current", async () => {
  const training = { objects: ["mug", "gear"], readings_per_object: 60, n_classes: 8, activate: false };
  const body = JSON.stringify(training);
  const headers = { "content-type": "application/json" };
  const job = await (await fetch(`${SERVER}/v1/catalogues/default/trainings`, { method: "POST", headers, body })).json();
  let version;
  while (typeof version !== "number") {
    await page.waitForTimeout(500);
    ({ version } = await json(`/v1/jobs/${job.id}`));
  }
  await page.goto(`${SERVER}/#/models`);
  const row = page.locator("tbody tr", { hasText: `Version ${version}` });
  await row.getByRole("button", { name: "Make candidate" }).click();
  await row.getByText("candidate", { exact: true }).waitFor();
  await row.getByRole("button", { name: "Compare" }).click();
  await page.getByRole("heading", { name: "Both versions on the same sessions" }).waitFor({ timeout: 90_000 });
  await page.getByRole("rowheader", { name: "Touches until the decision" }).waitFor();
  await checkAxe(page, "a comparison of versions");
  await checkWidth(page, "a comparison of versions");
  await shot("shadow");
});

await step("an admin reads the audit log and takes a snapshot", async () => {
  expected.add(401);
  await page.goto(`${GUARDED}/#/audit`);
  await page.getByLabel("API key").fill(ADMIN_KEY);
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { name: "Audit" }).waitFor();
  await page.goto(`${GUARDED}/#/snapshots`);
  const take = page.getByRole("button", { name: "Take a snapshot" });
  const [download] = await Promise.all([page.waitForEvent("download"), take.click()]);
  const path = `${FOLDER}/page.snapshot`;
  await download.saveAs(path);
  palpate("snapshot", "verify", path);
  await page.getByRole("region", { name: "Snapshots taken" }).getByRole("rowheader").first().waitFor();
  await checkAxe(page, "snapshots");
  // Typed before the page has drawn itself, which must not take it back.
  await page.evaluate(() => {
    new MutationObserver((_, observer) => {
      const field = document.querySelector("#audit-operation");
      if (!field) return;
      observer.disconnect();
      field.value = "take_";
      field.dispatchEvent(new Event("input", { bubbles: true }));
    }).observe(document.body, { childList: true, subtree: true });
  });
  await page.goto(`${GUARDED}/#/audit`);
  await page.waitForTimeout(500);
  assert.equal(await page.getByLabel("Operation").inputValue(), "take_");
  await page.getByLabel("Operation").press("End");
  await page.getByLabel("Operation").pressSequentially("snapshot");
  await page.getByLabel("Operation").press("Enter");
  await page.waitForFunction(() => [...document.querySelectorAll("tbody tr")].length === 1 && document.querySelector("tbody").textContent.includes("take_snapshot"));
  await checkAxe(page, "the audit log");
  await shot("audit");
});

await step("an admin makes a webhook, tests it and reads its history", async () => {
  await page.goto(`${GUARDED}/#/webhooks`);
  await page.getByRole("button", { name: "New webhook …" }).click();
  await page.getByLabel("URL").fill("https://receiver.invalid/touch");
  await checkAxe(page, "a new webhook");
  await page.getByRole("button", { name: "Create webhook" }).click();
  await page.getByText("whsec_").waitFor();
  await page.getByRole("button", { name: "Done" }).click();
  await page.getByRole("button", { name: "Test receiver.invalid" }).click();
  await page.getByText("test abandoned").waitFor();
  await checkAxe(page, "webhooks");
  await checkWidth(page, "webhooks");
  await page.getByRole("link", { name: "receiver.invalid" }).click();
  await page.getByRole("button", { name: /^Details of ping/ }).click();
  await page.getByText('"type": "ping"').waitFor();
  await checkAxe(page, "a webhook");
  await checkWidth(page, "a webhook");
  await shot("webhook");
});

await browser.close();
console.log("what has been is found");
