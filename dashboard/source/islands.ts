// An island is a part of a page that is drawn in the browser: <div data-island="NAME" data-props='{...}'>. Its code is fetched where it is needed.
import type { ComponentType } from "preact";

const ISLANDS: Record<string, () => Promise<ComponentType<any>>> = {
  "compare-jobs": async () => (await import("./compare/jobs")).CompareJobsIsland,
  "compare-regions": async () => (await import("./compare/regions")).CompareRegionsIsland,
  copies: async () => (await import("./common/copies")).CopiesIsland,
  job: async () => (await import("./job/job")).JobIsland,
  library: async () => (await import("./library/library")).LibraryIsland,
  new: async () => (await import("./new/new")).NewIsland,
  region: async () => (await import("./region/region")).RegionIsland,
};

export function startIslands(root: ParentNode): void {
  for (const place of root.querySelectorAll<HTMLElement>("[data-island]")) void start(place);
}

async function start(place: HTMLElement): Promise<void> {
  const load = ISLANDS[place.dataset.island!];
  if (!load) throw new Error(`no island is called ${place.dataset.island}`);
  const parts = Promise.all([import("preact"), load()]);
  const [{ createElement, render }, component] = await parts.catch((reason: unknown) => {
    place.textContent = "This part of the page could not be fetched. Load the page again.";
    throw reason;
  });
  place.replaceChildren();
  render(createElement(component, JSON.parse(place.dataset.props ?? "{}")), place);
}
