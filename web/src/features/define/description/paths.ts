// Paths of a robot's files.

/** Return a path's last step. */
export function fileName(path: string): string {
  return path.split("/").at(-1) ?? path;
}

/** Return a path's last step in lower case: drives differ in whether they keep the case. */
export function baseName(path: string): string {
  return fileName(path).toLowerCase();
}

/** Return the folder of a path with its "/"; "" at the top. */
export function folderOf(path: string): string {
  return path.replace(/\/$/, "").replace(/[^/]*$/, "");
}

/** Resolve a name in a file to a path. */
export function resolvePath(file: string, name: string): string {
  const steps = file.split("/").slice(0, -1);
  for (const step of name.replaceAll("\\", "/").split("/")) {
    if (step === "..") steps.pop();
    else if (step && step !== ".") steps.push(step);
  }
  return steps.join("/");
}
