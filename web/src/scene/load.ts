// Loads the 3-D chunk on first use, again if the server was away.
import { RETRY_MS } from "../api/resource";

type Scene = typeof import("./scene");
let loaded: Promise<Scene> | undefined;

/** The 3-D chunk; waits until the server can give it. */
export function loadScene(): Promise<Scene> {
  loaded ??= load();
  return loaded;
}

async function load(): Promise<Scene> {
  try {
    return await import("./scene");
  } catch {
    // The server was away. Browsers remember a failed import, so each attempt has its own address.
    for (let attempt = 1; ; attempt += 1) {
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      try {
        const address = `/assets/scene.js?attempt=${attempt}`;
        return (await import(/* @vite-ignore */ address)) as Scene;
      } catch {
        // Still away.
      }
    }
  }
}
