// How the axes of every plot look, in the colours of the theme.

export interface PlotLook {
  /** The value of one of the theme's colours, by its name. */
  colour: (name: string) => string;
  axis: { stroke: string; grid: { stroke: string; width: number }; ticks: { show: boolean }; font: string };
}

export function plotLook(): PlotLook {
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
