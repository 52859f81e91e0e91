// The colours of drawings. They are those of Okabe and Ito, which colour-blind people tell apart; pages have the same ones in ciris.css.

export const LINKS = ["#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#0072b2", "#f0e442", "#d55e00"];
export const CONTACT = "#d55e00";
export const PROVED = "#009e73";

/** The value of a custom property of ciris.css, such as "--ink", as it is now: light or dark. */
export function token(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Calls when the reader's system changes between light and dark; returns a function that ends it. */
export function onScheme(call: () => void): () => void {
  const query = matchMedia("(prefers-color-scheme: dark)");
  query.addEventListener("change", call);
  return () => query.removeEventListener("change", call);
}
