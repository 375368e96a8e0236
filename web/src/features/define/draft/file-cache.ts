// Contents of dropped files, kept in the browser to upload again if the server has dropped them.

const DATABASE = "robomesh.define";
const STORE = "files";

function openDatabase(): Promise<IDBDatabase> {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(DATABASE, 1);
    request.onupgradeneeded = () => request.result.createObjectStore(STORE);
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error ?? new Error(DATABASE));
  });
}

async function inTransaction<T>(mode: IDBTransactionMode, work: (store: IDBObjectStore) => IDBRequest<T>): Promise<T> {
  const database = await openDatabase();
  try {
    return await new Promise<T>((resolve, reject) => {
      const request = work(database.transaction(STORE, mode).objectStore(STORE));
      request.onsuccess = () => resolve(request.result);
      request.onerror = () => reject(request.error ?? new Error(STORE));
    });
  } finally {
    database.close();
  }
}

/** Keep a file, unless the browser has no space or is in private mode. */
export async function cacheFile(sha: string, bytes: Blob): Promise<void> {
  await inTransaction("readwrite", (store) => store.put(bytes, sha)).catch(() => undefined);
}

export async function cachedFile(sha: string): Promise<Blob | undefined> {
  return inTransaction("readonly", (store) => store.get(sha) as IDBRequest<Blob | undefined>).catch(() => undefined);
}

/** Delete every file that is no longer needed. */
export async function deleteOtherFiles(wanted: ReadonlySet<string>): Promise<void> {
  const keys = await inTransaction("readonly", (store) => store.getAllKeys()).catch(() => []);
  for (const key of keys) {
    if (!wanted.has(String(key))) await inTransaction("readwrite", (store) => store.delete(key)).catch(() => undefined);
  }
}
