// Axes and curves of every plot, in the colours of the theme.

/** The number of colours. */
export const CURVES = 7;

/** Return the name of a curve's colour. */
export const curveColour = (index: number): string => `--curve-${(index % CURVES) + 1}`;

export interface PlotAppearance {
  /** Return a colour of the theme by its name. */
  colour: (name: string) => string;
  axis: { stroke: string; grid: { stroke: string; width: number }; ticks: { show: boolean }; font: string };
}

export function plotAppearance(): PlotAppearance {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  return {
    colour,
    axis: {
      stroke: colour("--dim"),
      grid: { stroke: colour("--line"), width: 1 },
      ticks: { show: false },
      font: "12px system-ui, sans-serif",
    },
  };
}
