// What the page says is so: of lost streams and answers, in every order, for every role. `away.mjs` has the silent server.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, symlinkSync } from "node:fs";
import { checkAxe, checkWidth, open } from "./browser.mjs";
import { serve } from "./server.mjs";

const { PALPATE, FOLDER, SHOTS } = process.env;
const { browser, page, errors } = await open();
const context = page.context();

async function step(name, work) {
  const begun = Date.now();
  await work();
  // A server that is away, and what a role may not do, are errors to the browser.
  const bad = errors.filter((text) => !/Failed to load resource|ERR_|Failed to fetch/.test(text));
  assert.deepEqual(bad, [], `errors in the console while: ${name}`);
  errors.length = 0;
  console.log(`   ${name} (${((Date.now() - begun) / 1000).toFixed(1)} s)`);
}

async function shot(name) {
  if (SHOTS) await page.screenshot({ path: `${SHOTS}/truth-${name}.png` });
}

const OBJECTS = ["mug", "hammer", "gear", "hand"];
const TOUCHES = 7;
let server;
let session;
await step("a server with four objects and a session", async () => {
  server = await serve("truth");
  for (const name of OBJECTS) server.palpate("objects", "add", name, "--mesh", `${FOLDER}/meshes/${name}.stl`, "--unit", "mm");
  server.palpate("train", "--readings-per-object", 100);
  server.touch("mug", TOUCHES, 5);
  session = (await server.json("/v1/fleet")).sessions[0].session.id;
});

const says = (at, pattern, timeout = 60_000) => at.locator(".view-head .live").filter({ hasText: pattern }).waitFor({ timeout });

await step("a stream without keep-alives is opened anew", async () => {
  const page = await context.newPage();
  // Its bytes are lost, the server answers everything else: a network that forgot the connection.
  await page.addInitScript(() => {
    const real = window.fetch;
    window.streams = 0;
    window.fetch = async (path, init) => {
      if (!String(path).endsWith("/events")) return real(path, init);
      window.streams += 1;
      if (window.streams > 1) return real(path, init);
      const body = new ReadableStream({
        start: (controller) => init.signal.addEventListener("abort", () => controller.error(init.signal.reason)),
      });
      return new Response(body, { headers: { "content-type": "text/event-stream" } });
    };
  });
  await page.goto(`${server.address}/?lost#/sessions/${session}`);
  await says(page, /^last heard \d+ s ago$/);
  await page.waitForFunction(() => window.streams === 2, undefined, { timeout: 45_000 });
  await says(page, /^live$/);
  await page.close();
});

await step("a request that is not answered ends", async () => {
  const page = await context.newPage();
  await page.clock.install();
  await page.goto(`${server.address}/?late#/models`);
  await page.locator("tbody tr").first().waitFor();
  await page.route("**/v1/sensors*", () => {});
  await page.evaluate(() => (location.hash = "#/sensors"));
  await page.locator(".skeleton").first().waitFor();
  await page.clock.runFor(31_000);
  await page.getByRole("alert").filter({ hasText: "no answer within 30 s" }).waitFor();
  await page.unroute("**/v1/sensors*");
  await page.clock.runFor(4000);
  await page.getByText("No sensors").or(page.locator("tbody tr")).first().waitFor();
  await page.close();
});

await step("a belief is shown under its own revision", async () => {
  const route = "**/belief?at=*";
  await page.goto(`${server.address}/?revision#/sessions/${session}`);
  await says(page, /^live$/);
  await page.locator('.stage[data-state="ready"]').waitFor();
  const panel = page.getByRole("region", { name: "Belief", exact: true });
  const readings = (n) => panel.locator("dd").filter({ hasText: new RegExp(`^${n} readings?$`) });
  await readings(TOUCHES).waitFor();
  // The answer is lost at first, then comes without anybody asking again.
  await page.route(route, (asked) => asked.abort());
  await page.getByRole("slider", { name: "Revision" }).focus();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  await panel.getByText(`still revision ${TOUCHES}`).waitFor();
  await panel.getByText("revision 1 is loading").waitFor();
  await readings(TOUCHES).waitFor();
  assert.equal(await panel.getByText("as of revision 1").count(), 0);
  assert.ok((await page.locator(".stale").count()) >= 2, "belief and pose are faded");
  await page.waitForTimeout(300);
  await shot("stale");
  await page.unroute(route);
  await panel.getByText("as of revision 1").waitFor();
  await readings(1).waitFor();
  await page.waitForFunction(() => document.querySelector(".stale") === null && document.querySelector("[role=alert]") === null);
});

await step("the training dialog is searched, and chooses all or none", async () => {
  await page.goto(`${server.address}/?train#/objects`);
  await page.getByRole("button", { name: "Train …" }).click();
  const dialog = page.getByRole("dialog");
  const chosen = (n) => dialog.getByText(`${n} of ${OBJECTS.length}`).waitFor();
  await chosen(`${OBJECTS.length} objects`);
  await dialog.getByRole("button", { name: "None", exact: true }).click();
  await chosen("0 objects");
  assert.ok(await dialog.getByRole("button", { name: "Start training" }).isDisabled());
  await dialog.getByRole("searchbox", { name: "Search objects" }).fill("HA");
  assert.deepEqual(await dialog.locator(".train-objects label").allTextContents(), ["hammer", "hand"]);
  await dialog.getByRole("button", { name: "All 2 found" }).click();
  await dialog.getByLabel("hand").uncheck();
  await checkAxe(page, "the training dialog");
  await shot("train");
  await dialog.getByRole("searchbox").press("Enter");
  await dialog.getByRole("searchbox").fill("");
  await chosen("1 object");
  assert.deepEqual(await dialog.locator(".train-objects label").evaluateAll((all) => all.filter((one) => one.control.checked).map((one) => one.textContent)), ["hammer"]);
  let sent;
  await page.route("**/trainings", (asked) => {
    sent = asked.request().postDataJSON();
    return asked.abort();
  });
  await dialog.getByRole("button", { name: "Start training" }).click();
  await dialog.getByRole("alert").waitFor();
  const ids = new Map((await server.json("/v1/objects")).items.map(({ name, id }) => [name, id]));
  assert.deepEqual(sent.objects, [ids.get("hammer")]);
  await page.unroute("**/trainings");
});

await step("an object has one colour on every page and in every order", async () => {
  const colorsOf = (rows, name, dot, property) =>
    page.locator(rows).evaluateAll((all, [name, dot, property]) => Object.fromEntries(all.map((one) => [
      (name ? one.querySelector(name) : one).textContent.trim(), getComputedStyle(one.querySelector(dot))[property],
    ])), [name, dot, property]);
  await page.goto(`${server.address}/?colours#/objects`);
  await page.locator(".card").nth(3).waitFor();
  await page.waitForTimeout(700);
  const cards = await colorsOf(".card", "a", ".dot", "backgroundColor");
  assert.deepEqual(Object.keys(cards).sort(), [...OBJECTS].sort());
  assert.equal(new Set(Object.values(cards)).size, OBJECTS.length, "each object has its own");
  const same = async (where, rows, name, dot, property) => {
    const found = await colorsOf(rows, name, dot, property);
    const known = Object.keys(found).filter((one) => one in cards);
    assert.ok(known.length >= 2, `${where} shows objects: ${Object.keys(found)}`);
    for (const one of known) assert.equal(found[one], cards[one], `${one} in ${where}`);
    if (found["none of these"]) assert.ok(!Object.values(cards).includes(found["none of these"]));
  };
  // One touch leaves several objects probable, which are compared by bars.
  const send = (path, body) => fetch(server.address + path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) }).then((answer) => answer.json());
  const [{ image, pose, sensor }] = (await server.json(`/v1/sessions/${session}/readings?limit=1`)).items;
  const unsure = await send("/v1/sessions", {});
  await send(`/v1/sessions/${unsure.id}/readings`, { readings: [{ image, pose, sensor, robot: "unsure", seq: 0 }] });
  await page.goto(`${server.address}/?colours#/fleet`);
  await page.locator(".fleet-row .bar").first().waitFor();
  await page.waitForTimeout(700);
  await same("the fleet", ".fleet-row .bar", ".bar-name", "rect", "fill");
  const sure = page.locator(".fleet-line", { hasText: /mug, / }).locator(".fleet-link .dot");
  assert.equal(await sure.first().evaluate((dot) => getComputedStyle(dot).backgroundColor), cards.mug, "a sure row has its object's colour");
  await page.goto(`${server.address}/?colours#/sessions/${session}`);
  await page.locator(".panel-posterior .legend li").first().waitFor();
  for (const at of ["End", "Home"]) {
    await page.getByRole("slider", { name: "Revision" }).press(at);
    await page.waitForFunction(() => document.querySelector(".stale") === null);
    await same(`bars at ${at}`, ".session .bar", ".bar-name", "rect", "fill");
    await same(`the chart at ${at}`, ".panel-posterior figure:first-of-type .legend li", "", "line", "stroke");
  }
  await page.getByRole("slider", { name: "Revision" }).press("ArrowRight");
  await page.getByText("as of revision 1").waitFor();
  const ghosts = await page.locator(".layers .key:has(.dot)").evaluateAll((all) => all.map((one) => [one.textContent.trim().split(" ")[0], getComputedStyle(one.querySelector(".dot")).backgroundColor]));
  for (const [name, color] of ghosts) assert.equal(color, cards[name], `${name} as a ghost`);
  await shot("colours");
});

/** Runs what an empty page advises, in a shell of its own. */
async function runCommands(name) {
  const lines = await page.locator(".note-empty pre").textContent();
  execFileSync("bash", ["-euo", "pipefail", "-c", lines], {
    cwd: mkdtempSync(`${FOLDER}/shell-`),
    env: { ...process.env, PALPATE_SERVER: "http://127.0.0.1:9", PATH: `${FOLDER}/bin:${process.env.PATH}` },
    stdio: ["ignore", "ignore", "inherit"],
    timeout: 120_000,
  });
  console.log(`      ${name}: ${lines.split("\n").slice(1).join("; ")}`);
}

await step("an empty page shows commands that work there and then", async () => {
  const empty = await serve("empty");
  mkdirSync(`${FOLDER}/bin`, { recursive: true });
  symlinkSync(PALPATE, `${FOLDER}/bin/palpate`);
  for (const [path, sign] of [["objects", ".card"], ["models", "tbody tr"], ["fleet", ".fleet-row"]]) {
    await page.goto(`${empty.address}/?empty-${path}#/${path}`);
    await page.locator(".note-empty pre").waitFor();
    if (path === "fleet") {
      assert.doesNotMatch(await page.locator(".note-empty pre").textContent(), /train/, "something is trained already");
    }
    await shot(`empty-${path}`);
    await checkAxe(page, `empty ${path}`);
    await runCommands(path);
    await page.goto(`${empty.address}/?filled-${path}#/${path}`);
    await page.locator(sign).first().waitFor();
  }
});

await step("the empty fleet of a new server shows the way to a first session", async () => {
  const fresh = await serve("fresh");
  await page.goto(`${fresh.address}/?fresh#/fleet`);
  await page.locator(".note-empty pre").waitFor();
  await page.setViewportSize({ width: 390, height: 800 });
  await page.emulateMedia({ colorScheme: "dark" });
  await checkWidth(page, "the empty fleet");
  await shot("empty-narrow");
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.emulateMedia({ colorScheme: "light" });
  await runCommands("fleet");
  await page.locator(".fleet-row").first().waitFor();
});

const ROLES = {
  admin: { views: ["Fleet", "Sessions", "Objects", "Models", "Jobs", "Sensors", "Keys", "Audit", "Snapshots", "Webhooks", "Health"], train: true, close: true },
  trainer: { views: ["Fleet", "Sessions", "Objects", "Models", "Jobs", "Sensors", "Health"], train: true, close: false },
  viewer: { views: ["Fleet", "Sessions", "Objects", "Models", "Jobs", "Sensors", "Health"], train: false, close: false },
  robot: { views: ["Sessions", "Models", "Sensors"], train: false, close: true },
};
let guarded;
await step("a server that asks for keys, with one for each role", async () => {
  await server.stop();
  server.options.push("--access", "keys");
  await server.start();
  guarded = server;
  guarded.key = execFileSync("cat", [guarded.said.admin_key_file]).toString().trim();
  for (const role of Object.keys(ROLES)) {
    const made = await fetch(`${guarded.address}/v1/keys`, {
      method: "POST",
      headers: { authorization: `Bearer ${guarded.key}`, "content-type": "application/json" },
      body: JSON.stringify({ name: `one-${role}`, role }),
    });
    ROLES[role].secret = (await made.json()).secret;
  }
});

for (const [role, { views, train, close, secret }] of Object.entries(ROLES)) {
  await step(`who has the role ${role} is offered what it may do`, async () => {
    const page = await context.newPage();
    const denied = [];
    page.on("response", (answer) => answer.status() === 403 && denied.push(answer.url()));
    await page.addInitScript((key) => sessionStorage.setItem("palpate.key", key), secret);
    const visit = async (path, name) => {
      await page.goto(`${guarded.address}/?${role}-${path}#/${path}`);
      await page.getByText(`one-${role}`).first().waitFor();
      if (name) await page.getByRole("heading", { name, exact: true, level: 1 }).waitFor();
      await page.waitForTimeout(300);
    };
    await visit("models", "Models");
    await page.locator("tbody tr").first().waitFor();
    assert.deepEqual(await page.getByRole("navigation").getByRole("link").allTextContents(), views);
    for (const name of ROLES.admin.views.filter((name) => !views.includes(name))) {
      await visit(name.toLowerCase(), name);
      await page.getByText(/^Needs the role/).waitFor();
      assert.equal(await page.locator("main button").count(), 0);
    }
    await visit("keys", "Keys");
    assert.equal(await page.getByRole("button", { name: "New key …" }).count(), role === "admin" ? 1 : 0);
    if (views.includes("Objects")) {
      await visit("objects", "Objects");
      await page.locator(".card").first().waitFor();
      assert.equal(await page.getByRole("button", { name: "Train …" }).count(), train ? 1 : 0);
      assert.equal(await page.locator(".drop").count(), train ? 1 : 0);
    }
    await visit(`sessions/${session}`);
    await page.locator(".explain").waitFor();
    assert.equal(await page.getByRole("button", { name: "Close session" }).count(), close ? 1 : 0);
    assert.deepEqual(denied.filter((url) => !/\/v1\/objects\//.test(url)), [], "nothing is asked for that is refused");
    await page.close();
  });
}

await browser.close();
console.log("what the page says is so");
process.exit(0);
