// Counts as sentences have them.

/** "1 pair", "2 pairs": a number and what it counts. `many` is for a plural that does not only add an s. */
export function plural(count: number, one: string, many = `${one}s`): string {
  return `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
}
