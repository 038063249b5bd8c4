// The fragment of the address is the route.
import assert from "node:assert/strict";
import { test } from "node:test";
import { choose, go, link, query, route } from "../../src/router.ts";

function visit(hash) {
  location.hash = hash;
  dispatchEvent(new Event("hashchange"));
  return route.value;
}

test("a route is the decoded parts of the fragment", () => {
  assert.deepEqual(visit(""), []);
  assert.deepEqual(visit("#/sessions/7"), ["sessions", "7"]);
  assert.deepEqual(visit("#/models/a%20b%2Fc/1/"), ["models", "a b/c", "1"]);
});

test("a part that is not encoded rightly stays as it is", () => {
  assert.deepEqual(visit("#/objects/100%"), ["objects", "100%"]);
});

test("a link leads to the parts that it was made of", () => {
  const parts = ["models", "my catalogue/ü?#", 12];
  assert.deepEqual(visit(link(...parts)), parts.map(String));
});

test("what is chosen is behind a question mark, and stays when the route is replaced", () => {
  assert.deepEqual(visit("#/sessions?robot=arm%203&state=open"), ["sessions"]);
  assert.deepEqual(Object.fromEntries(query.value), { robot: "arm 3", state: "open" });
  choose({ state: "", object: "mug/ü?" });
  assert.deepEqual(Object.fromEntries(query.value), { robot: "arm 3", object: "mug/ü?" });
  assert.deepEqual(route.value, ["sessions"]);
  choose({ robot: "", object: "" });
  assert.equal(location.hash, "#/sessions");
});

test("going somewhere sets the fragment", () => {
  go("objects", "mug");
  assert.equal(location.hash, "#/objects/mug");
});
