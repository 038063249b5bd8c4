// The part of the operator's story that is told on a session's page: view, strip, tables and charts.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { checkAxe } from "./browser.mjs";

/** The canvas of the 3-D view. */
export const VIEW = ".stage canvas[role=img]";

/** Works the page of a sure session with so many touches, which is open. */
export async function workSession({ page, step, shot, json, session, nTouches }) {
  /** Waits until the strip shows a reading as the selected one. */
  const chosen = (n) => page.waitForFunction((wanted) => Number(/\d+/.exec(document.querySelector(".strip [aria-current] .key")?.textContent ?? "")?.[0]) === wanted, n);

  await step("a touch is selected in the view, the strip and the tables alike", async () => {
    const canvas = page.locator(VIEW);
    await page.locator(`${VIEW}[aria-label*=", ${nTouches} touches"]`).waitFor();
    await canvas.focus();
    await page.keyboard.press("Escape");
    await page.getByText("Click a touch to see what it says.").waitFor();
    await page.keyboard.press("n");
    await chosen(1);
    await page.keyboard.press("n");
    await chosen(2);
    await page.keyboard.press("p");
    await chosen(1);
    await page.locator(".explain .chosen").getByText("1", { exact: false }).first().waitFor();
    await page.getByText(/^Reading 1: [+−]?[\d.]+ bit lost without it, [+−]?[\d.]+ bit when it came, fit/).waitFor();
    // A touch is where the pointer becomes a hand.
    const place = await canvas.evaluate((view) => {
      const { left, top, width, height } = view.getBoundingClientRect();
      for (let y = top + 40; y < top + height - 40; y += 4) {
        for (let x = left + 40; x < left + width - 40; x += 4) {
          view.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y }));
          if (view.style.cursor === "pointer") return { x, y };
        }
      }
    });
    assert.ok(place, "a touch is in view");
    await page.keyboard.press("Escape");
    await page.mouse.click(place.x, place.y);
    const said = page.getByText(/^Reading \d+:/);
    await said.waitFor();
    const clicked = Number(/\d+/.exec(await said.textContent())[0]);
    await chosen(clicked);
    await page.getByText("Touches as a table").click();
    assert.equal(await page.getByRole("region", { name: "Touches", exact: true }).getByRole("button", { pressed: true }).textContent(), String(clicked));
    await page.getByText("Touches as a table").click();
    await page.mouse.click(place.x, place.y);
    // A second click selects nothing.
    await page.waitForFunction(() => document.querySelector(".strip [aria-current]") === null);
  });

  await step("layers show uncertainty and what was not touched, and hide touches", async () => {
    const canvas = page.locator(VIEW);
    const layer = (name) => page.getByRole("button", { name, exact: true }).click();
    const pictures = [await canvas.screenshot()];
    for (const name of ["Uncertainty", "Not touched", "Older ones faint", "Touches"]) {
      await layer(name);
      await page.waitForTimeout(300);
      pictures.push(await canvas.screenshot());
      assert.ok(!pictures.at(-1).equals(pictures.at(-2)), `${name} changes the picture`);
    }
    const share = await page.getByText(/farther than half a pad from every touch: [\d.]+ % of the surface/).textContent();
    const percent = Number(/([\d.]+) %/.exec(share)[1]);
    assert.ok(percent > 20 && percent < 99, `24 touches leave some of a mug untouched: ${share}`);
    assert.match(await canvas.getAttribute("aria-label"), /, 0 touches/);
    await checkAxe(page, "the layers");
    for (const name of ["Touches", "Older ones faint"]) await layer(name);
    await page.waitForTimeout(300);
    await shot("layers");
    for (const name of ["Not touched", "Uncertainty"]) await layer(name);
  });

  await step("the picture of the pose is saved", async () => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save picture" }).click()]);
    assert.equal(download.suggestedFilename(), `palpate-${session.slice(-8)}-${nTouches}.png`);
    const bytes = readFileSync(await download.path());
    assert.equal(bytes.subarray(1, 4).toString(), "PNG");
    assert.ok(bytes.length > 10_000, `a picture of ${bytes.length} bytes shows something`);
  });

  await step("the wheel scrolls the page over the view, until the view has the focus", async () => {
    const canvas = page.locator(VIEW);
    const top = () => page.evaluate(() => scrollY);
    await canvas.blur();
    await page.evaluate(() => scrollTo(0, 0));
    const { x, y, width, height } = await canvas.boundingBox();
    await page.mouse.move(x + width / 2, y + height / 2);
    const before = await canvas.screenshot();
    await page.mouse.wheel(0, 60);
    await page.waitForFunction(() => scrollY > 20);
    await page.evaluate(() => scrollTo(0, 0));
    assert.ok(before.equals(await canvas.screenshot()), "scrolling does not zoom");
    await canvas.focus();
    await page.mouse.wheel(0, 60);
    await page.waitForTimeout(400);
    assert.equal(await top(), 0, "the focused view keeps the wheel");
    assert.ok(!before.equals(await canvas.screenshot()), "the focused view zooms");
    await page.keyboard.press("0");
  });

  await step("on a phone one finger scrolls the page, and two turn the view", async () => {
    await page.setViewportSize({ width: 390, height: 844 });
    const canvas = page.locator(VIEW);
    await canvas.evaluate((view) => view.scrollIntoView({ block: "center" }));
    await page.waitForTimeout(400);
    const fingers = await page.context().newCDPSession(page);
    const { x, y, width, height } = await canvas.boundingBox();
    const touch = (type, ...places) => fingers.send("Input.dispatchTouchEvent", { type, touchPoints: places.map(([dx, dy], id) => ({ x: x + width / 2 + dx, y: y + height / 2 + dy, id })) });
    const drag = async (...starts) => {
      await touch("touchStart", ...starts);
      for (let i = 1; i <= 10; i += 1) await touch("touchMove", ...starts.map(([dx, dy]) => [dx, dy - 10 * i]));
      await touch("touchEnd");
      await page.waitForTimeout(500);
    };
    const top = () => page.evaluate(() => scrollY);
    const [before, from] = [await canvas.screenshot(), await top()];
    await drag([-40, 50], [40, 50]);
    assert.equal(await top(), from, "two fingers do not scroll");
    assert.ok(!before.equals(await canvas.screenshot()), "two fingers turn the view");
    const cue = await page.locator(".explain").evaluate((table) => getComputedStyle(table).backgroundImage);
    assert.match(cue, /radial-gradient/, "a table that is cut shows it");
    await drag([0, 50]);
    assert.ok((await top()) > from + 40, "one finger scrolls");
    await fingers.detach();
    await page.setViewportSize({ width: 1280, height: 900 });
  });

  await step("the posterior begins at the prior, and a drawn range is shown larger", async () => {
    const panel = page.getByRole("region", { name: "Posterior over readings" });
    await panel.getByText("Numbers").first().click();
    const first = panel.getByRole("region", { name: "Probability of each object after each revision, numbers" }).locator("tbody tr").first();
    const prior = await json(`/v1/sessions/${session}/belief?at=0`);
    assert.deepEqual(await first.locator("th, td").allTextContents().then((cells) => cells.slice(0, 2)), ["0", `${(prior.objects[0].probability * 100).toFixed(1)} %`]);
    await panel.getByText("Numbers").first().click();
    const whole = panel.getByRole("button", { name: "All revisions" });
    assert.ok(await whole.isDisabled());
    const plot = panel.locator(".u-over").first();
    await plot.scrollIntoViewIfNeeded();
    const { x, y, width } = await plot.boundingBox();
    const ticks = () => panel.locator("canvas").nth(1).screenshot();
    const before = await ticks();
    await page.mouse.move(x + 2, y + 40);
    await page.mouse.down();
    await page.mouse.move(x + width / 3, y + 50, { steps: 6 });
    await page.mouse.up();
    await page.waitForFunction(() => [...document.querySelectorAll("button")].some((one) => one.textContent === "All revisions" && !one.disabled));
    await page.mouse.move(0, 0);
    assert.ok(!before.equals(await ticks()), "the chart of uncertainty shows the same range");
    assert.equal(await page.getByRole("slider", { name: "Revision" }).inputValue(), String(nTouches), "drawing selects no revision");
    await whole.click();
    await page.mouse.move(0, 0);
    await page.waitForTimeout(200);
    assert.ok(before.equals(await ticks()), "all revisions are shown again");
    await panel.getByRole("button", { name: "Zoom in" }).press("Enter");
    assert.ok(await whole.isEnabled());
    await whole.press("Enter");
  });

  await step("the strip shows the newest reading, and how well each fits", async () => {
    const strip = page.getByRole("list", { name: "Readings" });
    const [list, last] = [await strip.boundingBox(), await strip.getByRole("listitem").last().boundingBox()];
    assert.ok(last.x + last.width <= list.x + list.width + 4, "the newest is in view");
    const shown = await strip.locator(".num").evaluateAll((all) => all.map((one) => one.firstChild.textContent.trim()));
    assert.ok(shown.filter((text) => /^[+−]\d+\.\d\d$/.test(text)).length > nTouches / 2, `fits are shown: ${shown}`);
    const left = (at) => page.locator(at).first().evaluate((cell) => {
      const text = document.createRange();
      text.selectNodeContents(cell);
      return Math.round(text.getBoundingClientRect().left);
    });
    assert.equal(await left(".explain tbody th button"), await left(".explain thead th"), "columns are aligned");
  });
}
