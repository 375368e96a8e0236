// Program files of the operator's machine.

const LARGEST = 64 * 1024; // the longest text of a program

/** Read a program's file, with the line ends of the page; or return why it is not a program. */
export async function readProgramFile(
  file: File,
): Promise<{ name: string; text: string } | { problem: "too_large" | "no_text" }> {
  if (file.size > LARGEST) return { problem: "too_large" };
  const text = await file.text();
  if (text.includes("\0")) return { problem: "no_text" };
  return { name: file.name.replace(/\.[^.]*$/, ""), text: text.replace(/\r\n?/g, "\n") };
}
