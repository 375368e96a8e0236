// Export of the displayed plots as a picture.

import { saveFile } from "../../../ui/page/save-file";

const EDGE_PX = 16;
const LINE_PX = 24;

/** Download the charts within an element as one PNG. */
export function savePicture(element: HTMLElement, name: string): void {
  const style = getComputedStyle(document.documentElement);
  const colour = (variable: string) => style.getPropertyValue(variable).trim();
  const charts = [...element.querySelectorAll<HTMLElement>(".chart")].flatMap((chart) => {
    const canvas = chart.querySelector("canvas");
    return canvas ? [{ chart, canvas }] : [];
  });
  const scale = devicePixelRatio;
  const width = Math.max(0, ...charts.map(({ canvas }) => canvas.width)) + 2 * EDGE_PX * scale;
  const height = charts.reduce((sum, { canvas }) => sum + canvas.height + LINE_PX * scale, 2 * EDGE_PX * scale);
  const drawn = Object.assign(document.createElement("canvas"), { width, height });
  const context = drawn.getContext("2d");
  if (!context || charts.length === 0) return;
  context.fillStyle = colour("--surface");
  context.fillRect(0, 0, width, height);
  context.font = `${12 * scale}px system-ui, sans-serif`;
  context.textBaseline = "middle";
  let y = EDGE_PX * scale;
  for (const { chart, canvas } of charts) {
    let x = EDGE_PX * scale;
    const write = (text: string, fill: string) => {
      context.fillStyle = fill;
      context.fillText(text, x, y + (LINE_PX * scale) / 2);
      x += context.measureText(text).width + 12 * scale;
    };
    write(chart.dataset.unit ?? "", colour("--dim"));
    for (const each of chart.querySelectorAll<HTMLElement>(".legend > span:has(.curve)")) {
      const mark = each.querySelector(".curve");
      write(
        each.querySelector("[title]")?.textContent ?? "",
        mark ? getComputedStyle(mark).backgroundColor : colour("--text"),
      );
    }
    y += LINE_PX * scale;
    context.drawImage(canvas, EDGE_PX * scale, y);
    y += canvas.height;
  }
  drawn.toBlob((blob) => blob && saveFile(blob, name));
}
