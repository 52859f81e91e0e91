// Moves a robot so that a point of it follows a pointer. It is for choosing a configuration by hand: nothing is certified with it.
import * as three from "three";

const STEPS = 8;
const TINY = 1e-6; // radians or metres, for differences
/** Damping as a part of the largest square that a step can have, so that a stretched arm stays calm. */
const DAMPING = 1e-2;

/**
 * Returns joint positions within the limits at which the point is near the target: damped least squares (Wampler 1986), begun at q.
 *
 * @param pointAt where the point is in the world at joint positions.
 */
export function pulled(pointAt: (q: number[]) => three.Vector3, q: number[], target: three.Vector3, lower: number[], upper: number[]): number[] {
  let at = q;
  for (let step = 0; step < STEPS; step++) {
    const point = pointAt(at);
    const columns = at.map((_, i) => pointAt(at.map((value, j) => (i === j ? value + TINY : value))).sub(point).divideScalar(TINY));
    const size = columns.reduce((sum, column) => sum + column.lengthSq(), 0);
    if (size === 0) return at;
    const square = (a: "x" | "y" | "z", b: "x" | "y" | "z"): number => columns.reduce((sum, column) => sum + column[a] * column[b], a === b ? DAMPING * size : 0);
    const [xy, xz, yz] = [square("x", "y"), square("x", "z"), square("y", "z")];
    const push = target.clone().sub(point).applyMatrix3(new three.Matrix3(square("x", "x"), xy, xz, xy, square("y", "y"), yz, xz, yz, square("z", "z")).invert());
    at = at.map((value, i) => Math.min(Math.max(value + columns[i]!.dot(push), lower[i]!), upper[i]!));
  }
  return at;
}
