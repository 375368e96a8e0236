// Numbers as a person types and reads them.

/** Format a number with its own digits and a true minus sign. */
export function numberText(value: number): string {
  return String(Math.round(value * 1e6) / 1e6).replace("-", "−");
}

/** Parse a whole text as a number; null: invalid. A comma is ambiguous, so it is invalid. */
export function readNumber(text: string): number | null {
  const plain = text.trim().replace("−", "-");
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(plain) && Number.isFinite(Number(plain)) ? Number(plain) : null;
}
