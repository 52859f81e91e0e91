// Places the nodes of a graph on a sheet: neighbours attract each other, all repel each other. The same graph comes out the same.

export interface Point {
  x: number;
  y: number;
}

const ROUNDS = 220;

/** Returns a place in [0, 1]^2 for each node. Nodes of one component stay together. */
export function layout(count: number, edges: [number, number][]): Point[] {
  const golden = Math.PI * (3 - Math.sqrt(5));
  const places = Array.from({ length: count }, (_, i) => {
    const radius = Math.sqrt((i + 0.5) / Math.max(count, 1));
    return { x: radius * Math.cos(i * golden), y: radius * Math.sin(i * golden) };
  });
  const ideal = 1.6 / Math.sqrt(Math.max(count, 1));
  for (let round = 0; round < ROUNDS; round++) {
    const moves = places.map(({ x, y }) => ({ x: -0.02 * x, y: -0.02 * y }));
    for (let i = 0; i < count; i++) {
      for (let j = 0; j < i; j++) {
        const dx = places[i]!.x - places[j]!.x;
        const dy = places[i]!.y - places[j]!.y;
        const squared = Math.max(dx * dx + dy * dy, 1e-6);
        const push = (0.35 * ideal * ideal) / squared;
        moves[i]!.x += push * dx;
        moves[i]!.y += push * dy;
        moves[j]!.x -= push * dx;
        moves[j]!.y -= push * dy;
      }
    }
    for (const [i, j] of edges) {
      const dx = places[j]!.x - places[i]!.x;
      const dy = places[j]!.y - places[i]!.y;
      const pull = 0.06 * (Math.hypot(dx, dy) / ideal);
      moves[i]!.x += pull * dx;
      moves[i]!.y += pull * dy;
      moves[j]!.x -= pull * dx;
      moves[j]!.y -= pull * dy;
    }
    const most = 0.2 * (1 - round / ROUNDS) + 0.005;
    places.forEach((place, i) => {
      const { x, y } = moves[i]!;
      const by = Math.min(most / Math.max(Math.hypot(x, y), 1e-9), 1);
      place.x += by * x;
      place.y += by * y;
    });
  }
  const xs = places.map(({ x }) => x);
  const ys = places.map(({ y }) => y);
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const span = Math.max(Math.max(...xs) - left, Math.max(...ys) - top, 1e-9);
  const [spareX, spareY] = [(span - Math.max(...xs) + left) / 2, (span - Math.max(...ys) + top) / 2];
  return places.map(({ x, y }) => ({ x: (x - left + spareX) / span, y: (y - top + spareY) / span }));
}
