// The box with the claim stays at the top of the window. What else stays in view begins below it, so its height is known to ciris.css.
export function watchClaim(): void {
  const claim = document.querySelector<HTMLElement>(".claim");
  if (!claim) return;
  const tell = (): void => document.documentElement.style.setProperty("--claim", `${claim.offsetHeight}px`);
  new ResizeObserver(tell).observe(claim);
}
