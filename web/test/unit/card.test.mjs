// The extent of a mesh, read from the text of its small picture.
import assert from "node:assert/strict";
import { test } from "node:test";
import { sizeWords } from "../../src/objects/ObjectCard.tsx";

/** A file of chunks, of which only lengths and types are right. */
function png(...chunks) {
  const parts = [Buffer.alloc(8)];
  for (const [type, content] of chunks) {
    const length = Buffer.alloc(4);
    length.writeUInt32BE(content.length);
    parts.push(length, Buffer.from(type + content, "latin1"), Buffer.alloc(4));
  }
  return Uint8Array.from(Buffer.concat(parts)).buffer;
}

test("a picture states the size of its object", () => {
  const size = "size_m\0" + "0.080000 0.058140 0.068473";
  assert.equal(sizeWords(png(["IHDR", "x".repeat(13)], ["tEXt", size], ["IDAT", "123"])), "80.0 × 58.1 × 68.5 mm");
  assert.equal(sizeWords(png(["IHDR", "x"], ["tEXt", "other\0text"], ["IEND", ""])), undefined);
  assert.equal(sizeWords(new ArrayBuffer(3)), undefined);
});
