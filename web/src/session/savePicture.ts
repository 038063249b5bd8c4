// Downloads what a 3-D view shows as a PNG file.
import type { Stage } from "../scene/stage";

export async function savePicture(stage: Stage | undefined, caption: string, name: string): Promise<void> {
  const picture = await stage?.picture(caption);
  if (!picture) return;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(picture);
  link.download = `${name}.png`;
  link.click();
  // The download has begun by the next turn of the event loop.
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
