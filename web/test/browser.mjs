// A headless Chromium and what the story asks of every page: no error, no jump, no overflow.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { chromium } from "playwright-core";

const FLAGS = [
  "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--use-gl=angle",
  "--use-angle=swiftshader", "--disable-background-networking", "--disable-component-update",
  "--disable-sync", "--no-first-run", "--disable-dev-shm-usage",
];
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
/** The largest sum of layout shifts that people do not notice (web.dev: "good"). */
const SHIFT_MAX = 0.1;

/** Opens a page that remembers every error, and every address that it asked for. */
export async function open() {
  const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: FLAGS });
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, colorScheme: "light" });
  if (process.env.PAGES) await replacePages(context, process.env.PAGES);
  const page = await context.newPage();
  // Pictures in 3-D are drawn without a graphics card here, on a machine that may be busy.
  page.setDefaultTimeout(90_000);
  const errors = [];
  const urls = [];
  /** Statuses that a step of the story provokes: the browser itself writes a line about each. */
  const expected = new Set();
  page.on("console", (message) => {
    if (message.type() !== "error" && message.type() !== "warning") return;
    const text = message.text();
    if ([...expected].some((status) => text.includes(`status of ${status}`))) return;
    if (!text.includes("GPU stall due to ReadPixels")) errors.push(text);
  });
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("request", (request) => urls.push(request.url()));
  page.on("dialog", (dialog) => void dialog.accept());
  await page.addInitScript(() => {
    window.shifts = [];
    new PerformanceObserver((list) => {
      for (const entry of list.getEntries()) if (!entry.hadRecentInput) window.shifts.push(entry);
    }).observe({ type: "layout-shift", buffered: true });
  });
  return { browser, page, errors, urls, expected };
}

/** Shows the pages of a folder, such as a new build, with the headers of those in the server. */
async function replacePages(context, folder) {
  const isPage = ({ pathname }) => pathname === "/" || pathname.startsWith("/assets/");
  await context.route(isPage, async (route) => {
    const { pathname } = new URL(route.request().url());
    try {
      const response = await route.fetch();
      const { "content-encoding": _, ...headers } = response.headers();
      await route.fulfill({ response, headers, body: readFileSync(join(folder, pathname === "/" ? "index.html" : pathname)) });
    } catch {
      await route.abort();
    }
  });
}

/** Nothing is wider than the window. */
export async function checkWidth(page, name) {
  const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  assert.ok(over <= 0, `${name} is ${over} pixels wider than the window`);
}

/** Nothing jumped since the page was loaded. */
export async function checkShift(page, name) {
  const { sum, worst } = await page.evaluate(() => ({
    sum: window.shifts.reduce((total, entry) => total + entry.value, 0),
    worst: window.shifts.flatMap((entry) => entry.sources.map((source) => source.node?.className ?? "?")).slice(0, 5),
  }));
  assert.ok(sum < SHIFT_MAX, `${name} jumps by ${sum.toFixed(3)}: ${worst.join(", ")}`);
}

/** No serious violation of accessibility. */
export async function checkAxe(page, name) {
  await page.evaluate(AXE);
  const violations = await page.evaluate(async () => {
    const found = await window.axe.run(document, { resultTypes: ["violations"] });
    return found.violations
      .filter((one) => ["serious", "critical"].includes(one.impact))
      .map((one) => `${one.id}: ${one.nodes.slice(0, 3).map((node) => `${node.target} ${node.failureSummary}`).join(" | ")}`);
  });
  assert.deepEqual(violations, [], `${name} is not accessible`);
}
