// The part of papaparse that the page uses; its published types need those of Node.

declare module "papaparse" {
  interface Settings {
    delimiter: string;
    preview: number;
    skipEmptyLines: boolean;
  }
  export function parse<Row>(text: string, settings: Settings): { data: Row[] };
}
