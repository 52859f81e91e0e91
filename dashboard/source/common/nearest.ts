// Where two convex bodies are nearest to each other, for drawing only: nothing is decided by it.
import * as three from "three";

export interface Rounded {
  /** In the world. */
  vertices: three.Vector3[];
  radius: number;
}

const ROUNDS = 300;
const SMALL = 1e-9;

function mean(points: three.Vector3[]): three.Vector3 {
  return points.reduce((sum, point) => sum.add(point), new three.Vector3()).divideScalar(points.length);
}

/** The point farthest along a direction. */
function support(points: three.Vector3[], along: three.Vector3): three.Vector3 {
  return points.reduce((best, point) => (point.dot(along) > best.dot(along) ? point : best));
}

/** The middle between the nearest points of two bodies conv(vertices) + ball(radius); where they overlap, a point of both (Frank and Wolfe). */
export function between(a: Rounded, b: Rounded): three.Vector3 {
  const [x, y] = [mean(a.vertices), mean(b.vertices)];
  for (let round = 0; round < ROUNDS; round++) {
    const apart = x.clone().sub(y);
    const toX = support(a.vertices, apart.clone().negate()).clone().sub(x);
    const toY = support(b.vertices, apart).clone().sub(y);
    const move = toX.clone().sub(toY);
    const gain = -apart.dot(move);
    if (gain < SMALL) break;
    const step = Math.min(gain / move.lengthSq(), 1);
    x.addScaledVector(toX, step);
    y.addScaledVector(toY, step);
  }
  const middle = x.clone().add(y).divideScalar(2);
  const apart = x.sub(y);
  return apart.length() < SMALL ? middle : middle.addScaledVector(apart.normalize(), (b.radius - a.radius) / 2);
}
