// Settings that this browser keeps.

/** Return a kept setting, or null. A frame in another site's page may have no access to them. */
export function readStored(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}
