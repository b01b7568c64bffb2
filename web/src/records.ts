/** Records of live readings, in the browser's own storage as they come: a cable that is pulled or a tab that is closed leaves them. */

const DATABASE = "ohmstrain";
const STORE = "records";

/** A piece of a record. */
interface Piece {
  record: string;
  text: string;
}

function request<T>(asked: IDBRequest<T>): Promise<T> {
  return new Promise((resolve, reject) => {
    asked.onsuccess = () => resolve(asked.result);
    asked.onerror = () => reject(asked.error ?? new Error("the browser's storage failed"));
  });
}

async function database(): Promise<IDBDatabase> {
  const asked = indexedDB.open(DATABASE, 1);
  asked.onupgradeneeded = () => {
    asked.result.createObjectStore(STORE, { autoIncrement: true }).createIndex("record", "record");
  };
  return request(asked);
}

/** Appends text to a record. It is stored once this returns. */
export async function append(record: string, text: string): Promise<void> {
  const open = await database();
  const transaction = open.transaction(STORE, "readwrite", { durability: "strict" });
  transaction.objectStore(STORE).add({ record, text } satisfies Piece);
  await new Promise<void>((resolve, reject) => {
    transaction.oncomplete = () => resolve();
    transaction.onerror = () => reject(transaction.error ?? new Error("the browser's storage failed"));
  });
  open.close();
}

/** Names of the records that are kept, the oldest first. */
export async function records(): Promise<string[]> {
  const open = await database();
  const pieces = (await request(open.transaction(STORE).objectStore(STORE).getAll())) as Piece[];
  open.close();
  return [...new Set(pieces.map((piece) => piece.record))];
}

/** The text of a record. */
export async function text(record: string): Promise<string> {
  const open = await database();
  const pieces = (await request(open.transaction(STORE).objectStore(STORE).index("record").getAll(record))) as Piece[];
  open.close();
  return pieces.map((piece) => piece.text).join("");
}

/** Removes a record. */
export async function remove(record: string): Promise<void> {
  const open = await database();
  const store = open.transaction(STORE, "readwrite").objectStore(STORE);
  for (const key of await request(store.index("record").getAllKeys(record))) store.delete(key);
  open.close();
}
