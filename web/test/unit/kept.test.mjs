// What is kept so as not to be loaded again: bounded, the least recently used leaves first.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Kept } from "../../src/scene/kept.ts";
import { shapeOf } from "../../src/session/shapes.ts";

test("the least recently used leaves first", () => {
  const dropped = [];
  const kept = new Kept(30, (value) => dropped.push(value));
  kept.set("a", "A", 10);
  kept.set("b", "B", 10);
  kept.set("c", "C", 10);
  assert.equal(kept.get("a"), "A");
  kept.set("d", "D", 10);
  assert.deepEqual(dropped, ["B"]);
  assert.equal(kept.get("b"), undefined);
  assert.equal(kept.get("a"), "A");
});

test("as many leave as the new one needs", () => {
  const dropped = [];
  const kept = new Kept(30, (value) => dropped.push(value));
  for (const id of ["a", "b", "c"]) kept.set(id, id, 10);
  kept.set("large", "large", 25);
  assert.deepEqual(dropped, ["a", "b", "c"]);
  assert.equal(kept.size, 1);
});

test("the newest stays, however large", () => {
  const kept = new Kept(30);
  kept.set("huge", 1, 1000);
  assert.equal(kept.get("huge"), 1);
  kept.set("small", 2, 1);
  assert.equal(kept.get("huge"), undefined);
  assert.equal(kept.get("small"), 2);
});

test("a value that is set again counts once, with its new size", () => {
  const kept = new Kept(30);
  kept.set("a", 1, 0);
  kept.set("b", 2, 10);
  kept.set("a", 1, 20);
  assert.equal(kept.size, 2);
  kept.set("c", 3, 1);
  assert.equal(kept.get("b"), undefined);
  assert.equal(kept.get("a"), 1);
});

test("what is forgotten needs no room", () => {
  const dropped = [];
  const kept = new Kept(20, (value) => dropped.push(value));
  kept.set("a", 1, 15);
  kept.forget("a");
  kept.set("b", 2, 15);
  assert.deepEqual(dropped, []);
});

/** Answers of a server with one object, and what was asked. */
function serve(answers) {
  const asked = [];
  globalThis.fetch = async (path) => {
    asked.push(String(path));
    const answer = answers(String(path));
    if (answer === undefined) return new Response('{"title":"no","status":404}', { status: 404 });
    return answer instanceof ArrayBuffer ? new Response(answer) : Response.json(answer);
  };
  return asked;
}

const version = (catalogue) => ({ catalogue, version: 1, report: { objects: [{ id: "mug", origin_in_mesh: [1, 2, 3] }] } });
const meshed = (path) => (path.endsWith("/mesh") ? new ArrayBuffer(84) : { id: "mug", n_readings: 0, mesh: { format: "stl", unit: "mm", hash: "h" } });

test("a shape is loaded once, with its unit and its origin", async () => {
  const asked = serve(meshed);
  const [first, second] = await Promise.all([shapeOf(version("once"), "mug"), shapeOf(version("once"), "mug")]);
  assert.equal(first, second);
  assert.equal(first.mesh.metresPerUnit, 0.001);
  assert.deepEqual(first.mesh.origin, [1, 2, 3]);
  assert.deepEqual(asked, ["/v1/objects/mug", "/v1/objects/mug/mesh"]);
});

test("a shape that could not be loaded is asked for again", async () => {
  globalThis.fetch = async () => {
    throw new TypeError("away");
  };
  await assert.rejects(shapeOf(version("again"), "mug"));
  serve(meshed);
  assert.equal((await shapeOf(version("again"), "mug")).mesh.format, "stl");
});

test("large meshes leave: what is kept is bounded", async () => {
  const asked = serve((path) => (path.endsWith("/mesh") ? new ArrayBuffer(40e6) : meshed(path)));
  await shapeOf(version("large"), "mug");
  await shapeOf(version("larger"), "mug");
  const before = asked.length;
  await shapeOf(version("larger"), "mug");
  assert.equal(asked.length, before);
  await shapeOf(version("large"), "mug");
  assert.equal(asked.length, before + 2);
});
