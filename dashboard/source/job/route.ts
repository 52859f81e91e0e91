// The page's fragment says what is open: #pair=3, and in it the subtree that is zoomed into and the cell: #pair=3&in=40&cell=57.
import { useEffect, useState } from "preact/hooks";

export interface Route {
  pair: number | null;
  iteration: number | null;
  /** Number of the node that fills the view. */
  root: number;
  cell: number | null;
}

function parsed(): Route {
  const found = new URLSearchParams(location.hash.slice(1));
  const number = (name: string): number | null => (/^\d{1,9}$/.test(found.get(name) ?? "") ? Number(found.get(name)) : null);
  return { pair: number("pair"), iteration: number("iteration"), root: number("in") ?? 0, cell: number("cell") };
}

export function address(route: Partial<Route>): string {
  const parts = [
    ["pair", route.pair],
    ["iteration", route.iteration],
    ["in", route.root || null],
    ["cell", route.cell],
  ] as const;
  return `#${parts
    .filter(([, value]) => value != null)
    .map(([name, value]) => `${name}=${value}`)
    .join("&")}`;
}

/** Returns what is open; the browser's buttons back and forward change it. */
export function useRoute(): Route {
  const [route, setRoute] = useState(parsed);
  useEffect(() => {
    const changed = (): void => setRoute(parsed());
    addEventListener("hashchange", changed);
    return () => removeEventListener("hashchange", changed);
  }, []);
  return route;
}

/** Goes there; a cell replaces the one before, so that the button back leads out of the pair and not through its cells. */
export function go(route: Partial<Route>, replace = false): void {
  if (replace) location.replace(address(route));
  else location.hash = address(route);
}
