// Servers of a story of its own, which freeze, stop and come back at the same address.
import { execFileSync, spawn } from "node:child_process";
import { once } from "node:events";

const { PALPATE, FOLDER } = process.env;
const servers = [];
process.on("exit", () => {
  for (const { child } of servers) child.kill("SIGKILL");
});

/** A server that can be stopped and started again at the same address. */
class Server {
  constructor(name, ...options) {
    Object.assign(this, { name, options, listen: "127.0.0.1:0" });
  }

  async start() {
    const args = ["serve", "--listen", this.listen, "--data", `${FOLDER}/${this.name}.data`, "--json", ...this.options];
    this.child = spawn(PALPATE, args, { stdio: ["ignore", "pipe", "ignore"] });
    const [said] = await once(this.child.stdout, "data");
    this.said = JSON.parse(said);
    this.address = this.said.server;
    this.listen = new URL(this.address).host;
  }

  async stop(signal = "SIGTERM") {
    this.child.kill(signal);
    await once(this.child, "exit");
  }

  freeze() {
    this.child.kill("SIGSTOP");
  }

  thaw() {
    this.child.kill("SIGCONT");
  }

  palpate(...args) {
    const env = { ...process.env, PALPATE_SERVER: this.address, ...(this.key ? { PALPATE_KEY: this.key } : {}) };
    return execFileSync(PALPATE, args.map(String), { stdio: ["ignore", "pipe", "pipe"], env }).toString();
  }

  async json(path, method = "GET", body = undefined) {
    const headers = body === undefined ? {} : { "content-type": "application/json" };
    const answer = await fetch(this.address + path, { method, headers, body: body === undefined ? null : JSON.stringify(body) });
    return answer.json();
  }

  touch(object, readings, seed) {
    this.palpate("touch", "--object", object, "--mesh", `${FOLDER}/meshes/${object}.stl`, "--readings", readings, "--seed", seed, "--pace", 0);
  }
}


export async function serve(name, ...options) {
  const server = new Server(name, ...options);
  await server.start();
  servers.push(server);
  return server;
}
