// How the dashboard is built: few files with fixed names, which the server embeds one by one.
import { readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";

const SERVER = process.env.PALPATE_SERVER ?? "http://127.0.0.1:7411";
// The server refuses pages of other origins, so the proxy asks in its own name.
const proxy = {
  target: SERVER,
  changeOrigin: true,
  headers: { origin: SERVER },
};

/** What the built files contain of others; their licences want to be passed on. */
const OTHERS = ["preact", "@preact/signals", "@preact/signals-core", "uplot", "three"];

function licences(): Plugin {
  const notice = (name: string) => `${name}\n\n${readFileSync(`node_modules/${name}/LICENSE`, "utf8").trim()}\n`;
  return {
    name: "licences",
    generateBundle() {
      const source = OTHERS.map(notice).join(`\n${"-".repeat(72)}\n\n`);
      this.emitFile({ type: "asset", fileName: "assets/licences.txt", source });
    },
  };
}

export default defineConfig({
  plugins: [licences()],
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    outDir: "../server/dashboard",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    cssCodeSplit: false,
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 900,
    reportCompressedSize: false,
    rollupOptions: {
      output: {
        entryFileNames: "assets/app.js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/app[extname]",
      },
    },
  },
  server: {
    proxy: {
      "/v1": proxy,
      "/livez": proxy,
      "/readyz": proxy,
      "/version": proxy,
      "/metrics": proxy,
      "/docs": proxy,
    },
  },
});
