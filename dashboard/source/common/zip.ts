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

/** The file to send for what somebody has chosen: a zip as it is, and anything else in a zip. */
export async function packed(files: File[]): Promise<File> {
  const [first] = files;
  if (files.length === 1 && first!.name.toLowerCase().endsWith(".zip")) return first!;
  const entries = await Promise.all(files.map(async (file) => ({ path: file.webkitRelativePath || file.name, data: new Uint8Array(await file.arrayBuffer()) })));
  return new File([zip(entries)], `${first!.webkitRelativePath.split("/")[0] || first!.name}.zip`, { type: "application/zip" });
}
