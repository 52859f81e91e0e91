// Makes a zip of files, uncompressed, so that a folder and a single model can be sent as the service takes scenes.

export interface Entry {
  path: string;
  data: Uint8Array<ArrayBuffer>;
}

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

function crc32(data: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of data) crc = TABLE[(crc ^ byte) & 255]! ^ (crc >>> 8);
  return ~crc >>> 0;
}

/** Numbers of two or four bytes, the lowest first. */
function bytes(...numbers: [number, 2 | 4][]): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(numbers.flatMap(([value, size]) => Array.from({ length: size }, (_, i) => (value >>> (8 * i)) & 255)));
}

const UTF8 = 0x800;
const FIRST_DAY = 0x21; // 1980-01-01

export function zip(entries: Entry[]): Blob {
  const parts: Uint8Array<ArrayBuffer>[] = [];
  const directory: Uint8Array<ArrayBuffer>[] = [];
  let at = 0;
  for (const { path, data } of entries) {
    const name = new TextEncoder().encode(path);
    const shared: [number, 2 | 4][] = [[20, 2], [UTF8, 2], [0, 2], [0, 2], [FIRST_DAY, 2], [crc32(data), 4], [data.length, 4], [data.length, 4], [name.length, 2], [0, 2]];
    directory.push(bytes([0x02014b50, 4], [20, 2], ...shared, [0, 2], [0, 2], [0, 2], [0, 4], [at, 4]), name);
    const head = bytes([0x04034b50, 4], ...shared);
    parts.push(head, name, data);
    at += head.length + name.length + data.length;
  }
  const size = directory.reduce((sum, part) => sum + part.length, 0);
  return new Blob([...parts, ...directory, bytes([0x06054b50, 4], [0, 2], [0, 2], [entries.length, 2], [entries.length, 2], [size, 4], [at, 4], [0, 2])]);
}

/** Little-endian numbers of a zip, at a place in its bytes. */
class Numbers {
  private readonly view: DataView;

  constructor(readonly bytes: Uint8Array<ArrayBuffer>) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  two(at: number): number {
    return this.view.getUint16(at, true);
  }

  four(at: number): number {
    return this.view.getUint32(at, true);
  }
}

const END = 0x06054b50;
const END_BYTES = 22;

/** Where the directory of a zip ends; its last record begins there. */
function endOf(data: Numbers): number {
  for (let at = data.bytes.length - END_BYTES; at >= 0; at--) if (data.four(at) === END) return at;
  return -1;
}

/** A file in a zip: its path, and where the directory of the zip describes it. */
interface Listed {
  path: string;
  at: number;
}

/** The files in a zip; none where it cannot be read. */
function listed(data: Numbers): Listed[] {
  const end = endOf(data);
  const found: Listed[] = [];
  for (let k = 0, at = end < 0 ? 0 : data.four(end + 16); end >= 0 && k < data.two(end + 10) && at + 46 <= end; k++) {
    const length = data.two(at + 28);
    found.push({ path: new TextDecoder().decode(data.bytes.subarray(at + 46, at + 46 + length)), at });
    at += 46 + length + data.two(at + 30) + data.two(at + 32);
  }
  return found;
}

/** The paths in a zip; none where it cannot be read. */
export async function pathsIn(file: Blob): Promise<string[]> {
  return listed(new Numbers(new Uint8Array(await file.arrayBuffer()))).map(({ path }) => path);
}

const DEFLATED = 8;

/** The text of the one file in a zip whose path fits; null where there is none, or several. */
export async function textIn(file: Blob, fits: RegExp): Promise<string | null> {
  const data = new Numbers(new Uint8Array(await file.arrayBuffer()));
  const [found, ...others] = listed(data).filter(({ path }) => fits.test(path));
  if (!found || others.length > 0) return null;
  const local = data.four(found.at + 42);
  const begin = local + 30 + data.two(local + 26) + data.two(local + 28);
  const part = new Blob([data.bytes.subarray(begin, begin + data.four(found.at + 20))]);
  return data.two(found.at + 10) === DEFLATED ? new Response(part.stream().pipeThrough(new DecompressionStream("deflate-raw"))).text() : part.text();
}

/** A zip with one more file, stored as it is. */
async function withFile(file: File, path: string, text: string): Promise<File> {
  const data = new Numbers(new Uint8Array(await file.arrayBuffer()));
  const end = endOf(data);
  const begin = data.four(end + 16);
  const more = new Uint8Array(await zip([{ path, data: new TextEncoder().encode(text) }]).arrayBuffer());
  const own = endOf(new Numbers(more));
  const cut = new Numbers(more).four(own + 16);
  // Its directory says where the file begins, and follows that of the zip.
  const entry = more.slice(cut, own);
  new DataView(entry.buffer).setUint32(42, begin, true);
  const count = data.two(end + 10) + 1;
  const last = bytes([END, 4], [0, 2], [0, 2], [count, 2], [count, 2], [end - begin + entry.length, 4], [begin + cut, 4], [0, 2]);
  return new File([data.bytes.subarray(0, begin), more.subarray(0, cut), data.bytes.subarray(begin, end), entry, last], file.name, { type: file.type });
}

/** The zip as one that says which of its files is the scene, or the robot's model. */
export function saying(file: File, scene: string): Promise<File> {
  return withFile(file, "bundle.json", JSON.stringify({ scene }));
}

/** A file with its path: below the folder that was chosen or dropped, if it was one. */
export interface Chosen {
  path: string;
  file: File;
}

/** What a field for files has. */
export function chosen(files: FileList | null): Chosen[] {
  return [...(files ?? [])].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

/** All files that were dropped, those below dropped folders too. */
export async function dropped(data: DataTransfer): Promise<Chosen[]> {
  // The entries can be taken only while the event is handled, before anything is waited for.
  const entries = [...data.items].flatMap((item) => item.webkitGetAsEntry() ?? []);
  return (await Promise.all(entries.map(below))).flat();
}

async function below(entry: FileSystemEntry): Promise<Chosen[]> {
  const path = entry.fullPath.slice(1);
  if (entry.isFile) return [{ path, file: await new Promise((done, fail) => (entry as FileSystemFileEntry).file(done, fail)) }];
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const found: FileSystemEntry[] = [];
  // A reader gives some entries at a time, and none at the end.
  for (let some = null; some === null || some.length > 0; found.push(...some)) some = await new Promise<FileSystemEntry[]>((done, fail) => reader.readEntries(done, fail));
  return (await Promise.all(found.map(below))).flat();
}

/** What somebody would call all of it: the name of the folder, or of the first file. */
export function nameOf([first]: Chosen[]): string {
  return first!.path.split("/")[0]!;
}

/** The file to send for what somebody has chosen: a zip as it is, and anything else in a zip. */
export async function packed(files: Chosen[]): Promise<File> {
  if (files.length === 1 && files[0]!.path.toLowerCase().endsWith(".zip")) return files[0]!.file;
  const entries = await Promise.all(files.map(async ({ path, file }) => ({ path, data: new Uint8Array(await file.arrayBuffer()) })));
  return new File([zip(entries)], `${nameOf(files)}.zip`, { type: "application/zip" });
}
