// The unit of a number.

/** A unit after its number: the degree sign close and as large, words smaller and apart. */
export function Unit({ of: unit }: { of: string }) {
  return <span class={unit === "°" ? "unit degree" : "unit"}>{unit}</span>;
}
