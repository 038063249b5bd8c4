// The part of the operator's story that is told by a large fleet.
import assert from "node:assert/strict";
import { checkAxe } from "./browser.mjs";

/** Opens twenty-five sessions with the readings of a sure one, and looks at the fleet, which is open. */
export async function workDenseFleet({ page, step, shot, json, server, session }) {
  await step("twenty-five sure sessions are on one screen, and bars only where somebody is unsure", async () => {
    const send = async (path, body) => {
      const answer = await fetch(server + path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });
      assert.ok(answer.ok, await answer.clone().text());
      return answer.json();
    };
    const { items } = await json(`/v1/sessions/${session}/readings?limit=8`);
    for (let arm = 1; arm <= 25; arm += 1) {
      const { id } = await send("/v1/sessions", {});
      const readings = items.map(({ image, pose, sensor }, seq) => ({ image, pose, sensor, robot: `arm-${arm}`, seq }));
      await send(`/v1/sessions/${id}/readings`, { readings });
    }
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.waitForFunction(() => document.querySelectorAll(".fleet-row").length === 28);
    const sure = page.locator(".fleet-line", { hasText: /— arm-\d+/ });
    await page.waitForFunction(() => document.querySelectorAll(".fleet-line").length >= 25);
    assert.equal(await sure.locator(".bar").count(), 0);
    assert.ok((await page.locator(".fleet-row:not(.fleet-line) .bar").count()) > 0, "what is unsure is compared");
    const heights = await sure.evaluateAll((rows) => rows.map((row) => row.nextElementSibling ? row.nextElementSibling.getBoundingClientRect().top - row.getBoundingClientRect().top : 0));
    const head = await page.locator(".fleet").evaluate((list) => list.getBoundingClientRect().top + scrollY);
    assert.ok(head + 25 * Math.max(...heights) <= 900, `25 rows of ${Math.max(...heights)} pixels end at ${head + 25 * Math.max(...heights)}`);
    const places = (row) => page.locator(row).first().locator("> *").evaluateAll((cells) => cells.map((cell) => Math.round(cell.getBoundingClientRect().left)).slice(3, 6));
    assert.deepEqual(await places(".fleet-head"), await places(".fleet-row:not(.fleet-line)"), "heads stand over their columns");
    await checkAxe(page, "a dense fleet");
    await shot("dense");
    await page.setViewportSize({ width: 1280, height: 900 });
  });
}
