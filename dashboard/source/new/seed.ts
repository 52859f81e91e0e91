// The seed beside a scene file that is uploaded: the configuration with which the form begins.
import { textIn } from "../common/zip";

const SEED = /^(?!__MACOSX)(.*\/)?([^/]+\.)?seed\.yaml$/;
const NUMBER = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?";
/** `q: [0, 0.5]`, or a line with a dash for each number. */
const LIST = new RegExp(`^q:\\s*(?:\\[\\s*((?:${NUMBER}[\\s,]*)+)\\]|((?:\\n\\s*- +${NUMBER}[ \\t]*)+))`, "m");

/** Joint positions in radians or metres, as the address has them, from the one seed file of a zip; null where it has none of numbers. */
export async function seedIn(zip: Blob): Promise<string | null> {
  const found = LIST.exec((await textIn(zip, SEED))?.replaceAll("\r\n", "\n") ?? "");
  const numbers = (found?.[1] ?? found?.[2])?.match(new RegExp(NUMBER, "g"));
  return numbers ? numbers.map(Number).join(",") : null;
}
