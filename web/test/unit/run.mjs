// Runs the unit tests: bundles each with the source that it imports, because Node 20 reads no TypeScript.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { build } from "vite";

const folder = import.meta.dirname;
const names = readdirSync(folder).filter((name) => name.endsWith(".test.mjs"));
const outDir = mkdtempSync(join(tmpdir(), "palpate-unit-"));
let status = 1;
try {
  await build({
    configFile: false,
    logLevel: "warn",
    oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
    ssr: { noExternal: true },
    build: {
      ssr: true,
      outDir,
      emptyOutDir: true,
      minify: false,
      rollupOptions: { input: names.map((name) => join(folder, name)), output: { entryFileNames: "[name].mjs", chunkFileNames: "chunks/[name].mjs" } },
    },
  });
  const built = names.map((name) => join(outDir, name));
  // The page's clock would keep the process alive.
  const args = ["--import", join(folder, "globals.mjs"), "--test", "--test-force-exit", "--test-reporter=dot", ...built];
  status = spawnSync(process.execPath, args, { stdio: "inherit", env: { ...process.env, TZ: "Asia/Kolkata" } }).status ?? 1;
} finally {
  rmSync(outDir, { recursive: true });
}
process.exit(status);
