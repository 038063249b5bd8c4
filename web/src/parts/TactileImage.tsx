// A tactile image: one square per taxel, on a common pressure scale.
import { useEffect, useRef } from "preact/hooks";
import { heat } from "../format";

export interface Image {
  rows: number;
  cols: number;
  /** Pascal, row by row in the sensor's frame; null where a taxel is missing. */
  values: (number | null)[];
}

export function TactileImage(props: { image: Image; most: number; label?: string }) {
  const { image, most } = props;
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (!context) return;
    const pixels = context.createImageData(image.cols, image.rows);
    for (let row = 0; row < image.rows; row += 1) {
      for (let col = 0; col < image.cols; col += 1) {
        // +y of the sensor points up on the page.
        const value = image.values[(image.rows - 1 - row) * image.cols + col];
        const [r, g, b] = typeof value === "number" ? heat(value / most) : [128, 128, 128];
        pixels.data.set([r, g, b, typeof value === "number" ? 255 : 60], (row * image.cols + col) * 4);
      }
    }
    context.putImageData(pixels, 0, 0);
  }, [image, most]);
  return (
    <canvas
      ref={canvas}
      class="tactile"
      width={image.cols}
      height={image.rows}
      {...(props.label ? { role: "img", "aria-label": props.label } : { "aria-hidden": "true" })}
    />
  );
}
