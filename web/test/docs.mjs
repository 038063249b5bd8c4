// The API's documentation at /docs, in light and dark, wide and narrow: it looks like the dashboard,
// is accessible, leads back, and an example that it shows runs.
import assert from "node:assert/strict";
import { checkAxe, checkWidth, open } from "./browser.mjs";

const { SHOTS, PALPATE_SERVER: SERVER } = process.env;
const { browser, page, errors, urls } = await open();

async function operation(id) {
  const block = page.locator(`#operations [id$="-${id}"]`);
  await block.locator(".opblock-summary-control").click();
  await block.locator(".responses-table").first().waitFor();
  return block;
}

const served = await (await fetch(`${SERVER}/docs/`)).text();
assert.ok(!served.includes("--features swagger"), "the server was built without --features swagger");

for (const colorScheme of ["light", "dark"]) {
  await page.emulateMedia({ colorScheme });
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.goto(`${SERVER}/docs/`);
  await page.locator(".opblock").first().waitFor();
  assert.equal(await page.title(), "API · Palpate");
  assert.equal(await page.locator(".topbar, .download-url-input").count(), 0, "a foreign bar");
  await checkAxe(page, `the ${colorScheme} list of operations`);
  if (SHOTS) await page.screenshot({ path: `${SHOTS}/docs-${colorScheme}.png` });

  const block = await operation("create_object");
  await checkAxe(page, `an open operation, ${colorScheme}`);
  const example = JSON.parse(await block.locator("textarea").inputValue());
  await block.locator("textarea").fill(JSON.stringify({ ...example, name: `docs-${colorScheme}` }));
  await block.getByRole("button", { name: "Execute" }).click();
  const answer = block.locator(".live-responses-table");
  await answer.getByText("201", { exact: true }).first().waitFor();
  await checkAxe(page, `an answer, ${colorScheme}`);
  if (SHOTS) await page.screenshot({ path: `${SHOTS}/docs-operation-${colorScheme}.png` });

  await page.setViewportSize({ width: 390, height: 844 });
  await checkWidth(page, `the ${colorScheme} documentation on a phone`);
}

// Without a method the server takes its default, and so does the example.
await page.goto(`${SERVER}/docs/`);
await page.locator(".opblock").first().waitFor();
const session = await operation("create_session");
assert.ok(!("method" in JSON.parse(await session.locator("textarea").inputValue())));

await page.getByRole("link", { name: "Dashboard" }).click();
await page.getByRole("link", { name: "Palpate, fleet" }).waitFor();
assert.deepEqual(errors, []);
assert.ok(urls.every((url) => url.startsWith(SERVER) || url.startsWith("data:") || url.startsWith("blob:")));
console.log("   the documentation runs its examples");
await browser.close();
