// Joint positions as people read them: degrees and metres, or radians on request. The choice is kept in the browser, and stands in the
// address, so that whoever opens the address reads the same numbers.
export type Unit = "rad" | "m";

const KEY = "angles";
export const RADIANS = (new URLSearchParams(location.search).get(KEY) ?? localStorage.getItem(KEY)) === "rad";

/** How a unit is shown: `scale` radians or metres are one of what is shown, with this number of digits, this sign, and this word. */
export const SHOWN = {
  rad: RADIANS ? { scale: 1, digits: 4, sign: " rad", word: "radians" } : { scale: Math.PI / 180, digits: 1, sign: "°", word: "degrees" },
  m: { scale: 1, digits: 3, sign: " m", word: "metres" },
} as const;

export function shown(value: number, unit: Unit): string {
  return `${bare(value, unit)}${SHOWN[unit].sign}`;
}

/** A configuration as people read it: "12.3°, 0.250 m". */
export function inText(q: number[], units: Unit[]): string {
  return q.map((value, i) => shown(value, units[i]!)).join(", ");
}

/** A configuration as people type it: numbers without their units. */
export function asText(q: number[], units: Unit[]): string {
  return q.map((value, i) => bare(value, units[i]!)).join(", ");
}

/** Reads what people type, or null where that is not one number for each joint. */
export function typed(text: string, units: Unit[]): number[] | null {
  const numbers = text.split(/[\s,;]+/).filter(Boolean).map(Number);
  return numbers.length === units.length && numbers.every(Number.isFinite) ? numbers.map((value, i) => value * SHOWN[units[i]!].scale) : null;
}

/** The words of these units: "degrees and metres". */
export function inWords(units: Unit[]): string {
  return [...new Set(units.map((unit) => SHOWN[unit].word))].sort().join(" and ");
}

/** A position without its unit. What rounds to zero has no sign. */
export function bare(value: number, unit: Unit): string {
  return (value / SHOWN[unit].scale).toFixed(SHOWN[unit].digits).replace(/^-(?=[0.]*$)/, "");
}

/** Whether the page is being loaded again with another choice. Its address is that of the next page then. */
export let leaving = false;

/** The address with the choice, if it is not the usual one. */
export function withUnits(query: URLSearchParams): string {
  if (RADIANS) query.set(KEY, "rad");
  else query.delete(KEY);
  return `?${query}`.replaceAll("%2C", ",");
}

/** Shows the angles of a part that the server has written, which are in degrees. */
export function localAngles(root: ParentNode): void {
  if (!RADIANS) return;
  for (const angles of root.querySelectorAll<HTMLDataElement>("data.angles")) angles.textContent = angles.value.split(",").map((value) => shown(Number(value), "rad")).join(" to ");
}

/** Lets people choose, by the switch in the page's head. */
export function startUnits(): void {
  const button = document.getElementById("angles") as HTMLButtonElement | null;
  if (RADIANS) history.replaceState(null, "", withUnits(new URLSearchParams(location.search)) + location.hash);
  if (!button) return;
  button.textContent = RADIANS ? "Angles in radians" : "Angles in degrees";
  button.setAttribute("aria-pressed", String(RADIANS));
  button.addEventListener("click", () => {
    localStorage.setItem(KEY, RADIANS ? "deg" : "rad");
    const query = new URLSearchParams(location.search);
    query.delete(KEY);
    leaving = true;
    // A new address without a fragment loads the page; one that differs only there does not.
    history.replaceState(null, "", `${location.pathname}${query.size ? `?${query}` : ""}${location.hash}`);
    location.reload();
  });
}
