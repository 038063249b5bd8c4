// The story of an operator, worked in a real browser on the servers that tests/dashboard started.
import assert from "node:assert/strict";
import { spawn, execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { checkAxe, checkShift, checkWidth, open } from "./browser.mjs";
import { workDenseFleet } from "./fleet.mjs";
import { VIEW, workSession } from "./session.mjs";

const { PALPATE, FOLDER, SHOTS, GUARDED, ADMIN_KEY, PALPATE_SERVER: SERVER } = process.env;
const mesh = (name) => `${FOLDER}/meshes/${name}.stl`;
const { browser, page, errors, urls, expected } = await open();
const palpate = (...args) => execFileSync(PALPATE, args, { stdio: "pipe" });
const json = async (path) => (await fetch(SERVER + path)).json();

async function step(name, work) {
  const begun = Date.now();
  await work();
  assert.deepEqual(errors, [], `errors in the console while: ${name}`);
  expected.clear();
  console.log(`   ${name} (${((Date.now() - begun) / 1000).toFixed(1)} s)`);
}

async function visit(path) {
  await page.goto(`${SERVER}/#/${path}`);
}

async function shot(name, fullPage = false) {
  if (!SHOTS) return;
  await page.evaluate(() => scrollTo(0, 0));
  await page.screenshot({ path: `${SHOTS}/dashboard-${name}.png`, fullPage });
}

/** A simulated robot that touches a mesh; resolves when it is done. */
function robot(object, file, readings, seed, pace, ...more) {
  const args = ["touch", "--object", object, "--mesh", mesh(file), "--readings", readings, "--seed", seed, "--pace", pace, ...more];
  const child = spawn(PALPATE, args.map(String), { stdio: "ignore" });
  return new Promise((resolve) => child.on("exit", resolve));
}

async function openSessions() {
  return (await json("/v1/fleet")).sessions;
}

await step("an empty server says what would bring something", async () => {
  await visit("fleet");
  await page.getByText("No open sessions").waitFor();
  await checkAxe(page, "the empty fleet");
  await visit("objects");
  await page.getByText("No objects yet").waitFor();
  await visit("models");
  await page.getByText("No trained versions yet").waitFor();
});

async function describeMesh(name) {
  const add = page.getByRole("button", { name: "Add", exact: true });
  assert.equal(await page.getByLabel("Name").inputValue(), name);
  assert.ok(await add.isDisabled(), "the unit is mandatory");
  await page.getByLabel("a millimetre (CAD)").check();
  await add.click();
  await page.getByText(`${name} has its mesh`).waitFor();
  await page.getByRole("button", { name: "Done" }).click();
  await page.getByRole("link", { name, exact: true }).waitFor();
}

await step("meshes are uploaded: chosen and dropped, the unit said", async () => {
  await visit("objects");
  for (const name of ["mug", "gear"]) {
    await page.getByLabel("Mesh file").setInputFiles(mesh(name));
    await describeMesh(name);
  }
  const bytes = readFileSync(mesh("hammer")).toString("base64");
  await page.evaluate((base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([bytes], "hammer.stl"));
    const zone = document.querySelector(".drop");
    zone.dispatchEvent(new DragEvent("dragover", { dataTransfer, bubbles: true, cancelable: true }));
    zone.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
  }, bytes);
  await describeMesh("hammer");
  assert.equal((await json("/v1/objects")).items.length, 3);
});

await step("what the server refuses is told in its words", async () => {
  expected.add(409);
  await page.getByLabel("Mesh file").setInputFiles(mesh("mug"));
  await page.getByLabel("a metre (robotics)").check();
  await page.getByRole("button", { name: "Add", exact: true }).click();
  const note = page.getByRole("alert");
  await note.waitFor();
  assert.match(await note.textContent(), /409[\s\S]*mug/);
  await page.keyboard.press("Escape");
});

await step("a training is started, and its progress followed", async () => {
  await page.getByRole("button", { name: "Train …" }).click();
  await page.getByLabel("Simulated touches per mesh").fill("200");
  await page.getByLabel("Touches for its surface").fill("200");
  await page.getByLabel("solid").check();
  // The robots of this story have exactly the described sensor.
  await page.locator("#train-knowledge").selectOption("measured");
  await page.getByRole("button", { name: "Start training" }).click();
  await page.locator("progress").first().waitFor();
  await page.getByRole("link", { name: "default version 1" }).waitFor({ timeout: 90_000 });
  assert.equal((await json("/v1/catalogues/default/current")).version, 1);
});

await step("an object shows its surface, classes, what a touch tells and its map of contact", async () => {
  await page.getByRole("link", { name: "mug", exact: true }).click();
  await page.locator('.stage[data-state="ready"]').waitFor();
  // A touch in a hundred may touch nothing.
  await page.getByText(/^(19\d|200) touches$/).waitFor();
  await page.getByRole("button", { name: "Appearance classes" }).click();
  await page.getByText(/classes of 25 here/).waitFor();
  const tells = page.getByRole("button", { name: "What a touch tells" });
  await tells.focus();
  await page.keyboard.press("Enter");
  await page.getByText(/about which of 3 objects it is, of at most 1.58 bit/).waitFor({ timeout: 30_000 });
  const interest = await json("/v1/catalogues/default/versions/1/objects/mug/interest");
  await page.getByText("Information as tables").click();
  const best = Math.max(...interest.places.map((place) => place.bits)).toFixed(2);
  assert.equal(await page.getByRole("region", { name: "Places that tell most" }).locator("td").first().textContent(), best);
  await page.getByRole("img", { name: /mug, what a touch tells over its surface/ }).waitFor();
  await checkAxe(page, "what a touch tells");
  await shot("interest");
  await page.getByText("Information as tables").click();
  await page.getByRole("button", { name: "Appearance classes" }).click();
  const slice = page.getByLabel(/^Slice/);
  await slice.focus();
  const before = await page.locator("img.heatmap").getAttribute("src");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction((src) => document.querySelector("img.heatmap").src !== src, before);
  await page.waitForTimeout(600);
  await checkAxe(page, "an object");
  await shot("object");
});

/** Enough that the robot is still at work when the page has been turned to its session. */
const TOUCHES = 24;
let session;
await step("the belief moves in the fleet while a robot touches", async () => {
  await visit("fleet");
  const done = robot("mug", "mug", TOUCHES, 5, 400);
  const row = page.locator(".fleet-row").first();
  await row.waitFor({ timeout: 20_000 });
  const seen = new Set();
  for (let i = 0; i < 12; i += 1) {
    seen.add(await row.locator(".fleet-who .faint").textContent());
    await page.waitForTimeout(200);
  }
  assert.ok(seen.size >= 3, `readings are counted live: ${[...seen]}`);
  session = (await openSessions())[0].session.id;
  await row.getByRole("link").click();
  const slider = page.getByRole("slider", { name: "Revision" });
  const first = Number(await slider.inputValue());
  await page.waitForFunction((n) => Number(document.querySelector(".replay input").value) >= n + 2, first);
  await done;
  await page.waitForFunction((n) => Number(document.querySelector(".replay input").max) >= n, TOUCHES);
  await page.locator('.stage[data-state="ready"]').waitFor();
  const belief = await json(`/v1/sessions/${session}/belief`);
  await page.getByText(`${belief.n_readings} readings`).first().waitFor();
  assert.equal(await page.locator(".bar-best .bar-name").first().textContent(), belief.objects[0].name);
  assert.equal(belief.objects[0].name, "mug");
  const title = await page.getByRole("heading", { level: 1 }).textContent();
  assert.match(title, /^mug, (>99\.9|100|9\d\.\d) % — simulated$/, "the title states what is believed");
  assert.equal(await page.title(), `${title} · Palpate`);
});

await step("the session explains itself, and says that nothing is left to learn", async () => {
  await page.getByRole("region", { name: "Contributions of readings" }).waitFor();
  assert.equal(await page.getByRole("list", { name: "Readings" }).getByRole("listitem").count(), TOUCHES);
  await page.getByText("Nothing left to learn").waitFor();
  await page.locator(".strip button").nth(3).click();
  await page.locator(".explain .chosen").waitFor();
  // A part that is loading is pale.
  await page.waitForFunction(() => document.querySelector(".stale") === null);
  await page.waitForTimeout(500);
  await checkAxe(page, "a session");
  await shot("session", true);
});

await workSession({ page, step, shot, json, session, nTouches: TOUCHES });

await step("the slider replays what was believed, by keyboard", async () => {
  const slider = page.getByRole("slider", { name: "Revision" });
  await slider.focus();
  await page.keyboard.press("Home");
  await page.getByText("Before the first reading.").waitFor();
  for (let i = 0; i < 3; i += 1) await page.keyboard.press("ArrowRight");
  await page.getByText("as of revision 3").waitFor();
  const then = await json(`/v1/sessions/${session}/belief?at=3`);
  await page.waitForFunction((n) => [...document.querySelectorAll(".facts dd")].some((dd) => dd.textContent === n), "3 readings");
  assert.equal(await page.locator(".bar-best .bar-name").first().textContent(), then.objects[0].name);
  await page.waitForFunction((uncertainty) => document.querySelector(".replay-say").textContent.includes(uncertainty), `${then.entropy_bits.toFixed(2)} bit`);
  await page.keyboard.press("End");
  await page.getByText("newest", { exact: true }).waitFor();
  await page.getByRole("button", { name: "Play" }).click();
  await page.getByText(/Revision 2, a reading arrived/).waitFor();
  await page.getByRole("button", { name: "Pause" }).click();
});

await step("the 3-D view turns by arrow keys, and everything is reached by Tab", async () => {
  await page.getByRole("button", { name: "Newest" }).click();
  const canvas = page.locator(VIEW);
  await canvas.focus();
  const before = await canvas.screenshot();
  for (let i = 0; i < 4; i += 1) await page.keyboard.press("ArrowRight");
  await page.waitForTimeout(300);
  assert.ok(!before.equals(await canvas.screenshot()), "arrow keys turn the view");
  await page.goto(`${SERVER}/?tab#/fleet`);
  await page.locator(".fleet-row").first().waitFor();
  const stops = [];
  for (let i = 0; i < 20; i += 1) {
    await page.keyboard.press("Tab");
    stops.push(await page.evaluate(() => document.activeElement.textContent.trim() || document.activeElement.getAttribute("aria-label")));
  }
  assert.equal(stops[0], "Skip to the content");
  assert.deepEqual(stops.slice(2, 13), ["Fleet", "Sessions", "Objects", "Models", "Jobs", "Sensors", "Keys", "Audit", "Snapshots", "Webhooks", "Health"]);
  assert.ok(stops.some((stop) => /^mug, .+ % — simulated$/.test(stop)), `sessions are reached: ${stops}`);
  assert.equal(await page.locator("[aria-live=polite]").count(), 1);
});

await step("who needs somebody comes first: a thing that nobody has taught", async () => {
  await robot("mug", "hand", 9, 7, 0);
  await robot("gear", "gear", 8, 3, 0);
  await page.waitForFunction(() => document.querySelectorAll(".fleet-row").length === 3);
  await page.waitForFunction(() => document.querySelector(".fleet-row").classList.contains("level-surprising"));
  await page.waitForTimeout(400);
  const grey = await page.locator(".bar-unknown").evaluateAll((all) => [...new Set(all.map((one) => getComputedStyle(one).fill))]);
  assert.equal(grey.length, 1, `"none of these" has no object's colour, also in the lead: ${grey}`);
  await shot("fleet");
});

await step("an alarm that somebody has seen needs nobody any more", async () => {
  assert.match(await page.title(), /^\(\d+\) Fleet/, "the tab counts the sessions that need attention");
  await page.getByRole("button", { name: "Select all that need attention" }).click();
  await page.getByRole("button", { name: "Seen", exact: true }).click();
  await page.locator(".fleet-row.level-seen").first().waitFor();
  await page.waitForFunction(() => document.querySelectorAll(".level-surprising, .level-stuck").length === 0);
  await page.waitForFunction(() => document.title === "Fleet · Palpate");
  await page.getByText("0 sessions selected").waitFor();
});

await workDenseFleet({ page, step, shot, json, server: SERVER, session });

await step("a calibration shows the dead taxel", async () => {
  palpate("sensors", "add", "finger", "--preset", "digitacts-6x6");
  palpate("sensors", "indent", "finger", "--out", `${FOLDER}/indentation.json`, "--seed", "3");
  palpate("sensors", "calibrate", "finger", "--file", `${FOLDER}/indentation.json`);
  await visit("sensors");
  await page.getByText("2 taxels unusable").waitFor();
  await page.getByRole("link", { name: "finger", exact: true }).click();
  await page.getByText("1 dead").waitFor();
  assert.equal(await page.locator(".taxel-dead").count(), 1);
  await shot("sensor");
});

const VIEWS = [
  ["fleet", ".fleet-row"],
  [() => `sessions/${session}`, ".explain"],
  ["sessions", "tbody tr"],
  ["objects", ".card"],
  ["objects/gear", "img.heatmap"],
  ["models", "tbody tr"],
  ["models/default/1", ".matrix"],
  ["jobs", "tbody tr"],
  ["sensors", "tbody tr"],
  ["sensors/finger", ".taxel"],
  ["keys", ".note-empty"],
  ["audit", "tbody tr"],
  ["snapshots", "pre"],
  ["webhooks", ".note-empty"],
  ["health", ".stat"],
];

const SWEEPS = [
  ["light", 1280, VIEWS],
  ["dark", 390, VIEWS],
  ["light", 390, VIEWS.slice(0, 2)],
  ["dark", 1280, VIEWS.slice(0, 2)],
];

for (const [scheme, width, views] of SWEEPS) {
  await step(`${views.length} views at ${width} pixels, ${scheme}: no overflow, no jump, accessible`, async () => {
    await page.emulateMedia({ colorScheme: scheme });
    await page.setViewportSize({ width, height: 900 });
    for (const [at, sign] of views) {
      const path = typeof at === "string" ? at : at();
      // Another address before `#` loads the page anew, so that jumps while loading count.
      await page.goto(`${SERVER}/?${scheme}-${width}-${encodeURIComponent(path)}#/${path}`);
      await page.locator(sign).first().waitFor();
      await page.waitForTimeout(250);
      const name = `${path} at ${width} pixels, ${scheme}`;
      await checkWidth(page, name);
      await checkShift(page, name);
      await checkAxe(page, name);
      if (path === "models/default/1" && width === 1280) await shot("version");
      if (path === "fleet" && width === 390 && scheme === "dark") await shot("narrow");
      if (path.startsWith("sessions") && width === 1280 && scheme === "dark") await shot("dark");
    }
    const ground = await page.evaluate(() => getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number));
    const brightness = (ground[0] + ground[1] + ground[2]) / 3;
    assert.ok(scheme === "dark" ? brightness < 60 : brightness > 200, `the ground is ${ground}`);
  });
}
await page.emulateMedia({ colorScheme: "light" });
await page.setViewportSize({ width: 1280, height: 900 });

await step("a session says where to touch next, and the true object once it is told", async () => {
  await robot("gear", "gear", 2, 11, 0);
  const one = (await openSessions()).map((listed) => listed.session).sort((a, b) => b.created_at.localeCompare(a.created_at))[0];
  await visit(`sessions/${one.id}`);
  await page.locator(".panel-next tbody tr").first().waitFor();
  const body = JSON.stringify({ object: "hammer" });
  const closed = await fetch(`${SERVER}/v1/sessions/${one.id}/close`, { method: "POST", headers: { "content-type": "application/json" }, body });
  assert.equal((await closed.json()).truth.name, "hammer");
  await page.getByText("it was hammer").waitFor();
  assert.match(await page.getByText("it was hammer").getAttribute("class"), /badge-bad/, "it was believed to be a gear");
});
await step("a simulated robot closes with the truth, which is drawn beside the belief", async () => {
  await robot("mug", "mug", 6, 12, 0, "--close");
  const listed = await json("/v1/sessions?order=newest&state=closed&limit=1");
  const { id, truth } = listed.items[0];
  assert.ok(truth.position_error < 0.01, `${truth.position_error} m`);
  await visit(`sessions/${id}`);
  await page.getByText("off at its end").waitFor();
  const button = page.getByRole("button", { name: "Truth", exact: true });
  assert.equal(await button.getAttribute("aria-pressed"), "true");
  await page.getByText("net: the object where it truly is").waitFor();
  await page.waitForTimeout(1500);
  await shot("truth");
  await button.click();
  await page.getByText("net: the object where it truly is").waitFor({ state: "detached" });
});

await step("what is not there is said, with the server's reason", async () => {
  expected.add(404);
  await visit("sessions/01890a5d-ac96-774b-bcce-b302099a8057");
  const note = page.getByRole("alert");
  await note.waitFor();
  assert.match(await note.textContent(), /404/);
});

await step("keys: made, shown once, rotated and revoked", async () => {
  await visit("keys");
  await page.getByText("No keys").waitFor();
  const make = async (holder) => {
    await page.getByRole("button", { name: "New key …" }).click();
    await page.getByLabel("Name").fill(holder);
    await page.getByRole("button", { name: "Create key" }).click();
    const secret = await page.locator(".secret code").textContent();
    await page.getByRole("button", { name: "Done" }).click();
    return secret;
  };
  const secret = await make("operator");
  assert.match(secret, /^palpate_/);
  await page.getByRole("rowheader", { name: "operator" }).waitFor();
  assert.equal(await page.getByText(secret).count(), 0, "a secret is shown once");
  await make("arm-3");
  await page.getByRole("button", { name: "Rotate arm-3" }).click();
  assert.match(await page.locator(".secret code").textContent(), /^palpate_/);
  await page.getByRole("button", { name: "Done" }).click();
  await page.getByRole("button", { name: "Revoke arm-3" }).click();
  await page.getByText(/revoked 20/).waitFor();
});

await step("a server that asks for a key gets one, kept in this tab and in no address", async () => {
  expected.add(401);
  await page.goto(`${GUARDED}/#/keys`);
  await page.getByRole("heading", { name: "Sign in" }).waitFor();
  await checkAxe(page, "signing in");
  await page.getByLabel("API key").fill("palpate_wrong");
  await page.getByRole("button", { name: "Sign in" }).click();
  assert.match(await page.getByRole("alert").textContent(), /401/);
  await page.getByLabel("API key").fill(ADMIN_KEY);
  await page.keyboard.press("Enter");
  await page.getByRole("rowheader", { name: "admin" }).waitFor();
  await page.reload();
  await page.getByRole("rowheader", { name: "admin" }).waitFor();
  await page.goto(`${GUARDED}/#/fleet`);
  await page.getByText("No open sessions").waitFor();
  await page.getByRole("button", { name: "Sign out" }).click();
  await page.getByRole("heading", { name: "Sign in" }).waitFor();
  assert.equal(await page.evaluate(() => sessionStorage.length + localStorage.length), 0);
  assert.ok(urls.length > 50 && urls.every((url) => !url.includes(ADMIN_KEY)), "no key in an address");
});

await browser.close();
console.log("the dashboard works");
