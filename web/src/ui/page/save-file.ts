// Let the browser save a file.

/** @param name Its file name. */
export function saveFile(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  // A download that begins late still needs the address.
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
