// Forward kinematics of the scene's tree, in JavaScript, for drawing only: nothing is certified with it.

import type { DrawnJoint, SceneModel } from "./schema";

export type Matrix = number[]; // 16 numbers, row by row

const IDENTITY: Matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

function times(a: Matrix, b: Matrix): Matrix {
  const product = new Array<number>(16);
  for (let i = 0; i < 4; i++) {
    for (let j = 0; j < 4; j++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * i + k]! * b[4 * k + j]!;
      product[4 * i + j] = sum;
    }
  }
  return product;
}

function inverse(pose: Matrix): Matrix {
  const [a, b, c, x, d, e, f, y, g, h, i, z] = pose as [number, number, number, number, number, number, number, number, number, number, number, number];
  return [a, d, g, -(a * x + d * y + g * z), b, e, h, -(b * x + e * y + h * z), c, f, i, -(c * x + f * y + i * z), 0, 0, 0, 1];
}

function turned(axis: number[], angle: number): Matrix {
  const [x, y, z] = axis as [number, number, number];
  const c = Math.cos(angle), s = Math.sin(angle), t = 1 - c;
  return [
    t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0,
    t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0,
    t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0,
    0, 0, 0, 1,
  ];
}

function moved(joint: DrawnJoint, q: number): Matrix {
  if (joint.kind === "revolute") return turned(joint.axis, q);
  if (joint.kind === "weld") return IDENTITY;
  const [x, y, z] = joint.axis as [number, number, number];
  return [1, 0, 0, q * x, 0, 1, 0, q * y, 0, 0, 1, q * z, 0, 0, 0, 1];
}

/** Returns a function from joint positions to the poses of all bodies in the world, X_WB = X_WP X_PF X_FM(q) X_BM^-1. */
export function poses(model: SceneModel): (q: number[]) => Map<string, Matrix> {
  const above = new Map(model.joints.map((joint) => [joint.child, joint]));
  const order: { joint: DrawnJoint; before: Matrix; after: Matrix }[] = [];
  const known = new Set(model.bodies.filter((body) => !above.has(body)));
  const add = (body: string): void => {
    if (known.has(body)) return;
    const joint = above.get(body)!;
    add(joint.parent);
    known.add(body);
    order.push({ joint, before: joint.X_PF.flat(), after: inverse(joint.X_BM.flat()) });
  };
  model.bodies.forEach(add);
  return (q) => {
    const found = new Map<string, Matrix>(model.bodies.filter((body) => !above.has(body)).map((body) => [body, IDENTITY]));
    for (const { joint, before, after } of order) {
      const X_FM = moved(joint, joint.index === null ? 0 : q[joint.index]!);
      found.set(joint.child, times(times(found.get(joint.parent)!, before), times(X_FM, after)));
    }
    return found;
  };
}

/** The bodies that some joint moves, from the world outwards. */
export function movingBodies(model: SceneModel): string[] {
  const above = new Map(model.joints.map((joint) => [joint.child, joint]));
  const moves = (body: string): boolean => {
    const joint = above.get(body);
    return joint !== undefined && (joint.kind !== "weld" || moves(joint.parent));
  };
  return model.bodies.filter(moves);
}

/** Where a body's frame is in the world: its origin in metres, and roll, pitch and yaw in radians, turns about the world's x, then y, then z. */
export function poseAt(model: SceneModel, body: string, q: number[]): { position: number[]; rpy: number[] } {
  const [a, , , x, d, e, f, y, g, h, i, z] = poses(model)(q).get(body)! as [number, number, number, number, number, number, number, number, number, number, number, number];
  const level = Math.hypot(a, d);
  // Where the frame's x points straight up or down, roll and yaw turn about the same line: yaw is 0 there.
  const [roll, yaw] = level > 1e-9 ? [Math.atan2(h, i), Math.atan2(d, a)] : [Math.atan2(-f, e), 0];
  return { position: [x, y, z], rpy: [roll, Math.atan2(-g, level), yaw] };
}

/** The joint's name without its model's, where that is the same for all. */
export function shortNames(names: string[]): string[] {
  const models = new Set(names.map((name) => name.slice(0, name.lastIndexOf("/") + 1)));
  return models.size > 1 ? names : names.map((name) => name.slice(name.lastIndexOf("/") + 1));
}

/** The names of the joints that have a position of their own, in position order. */
export function positions(model: SceneModel): string[] {
  const moving = model.joints.filter((joint) => joint.index !== null && !joint.follows);
  return moving.sort((a, b) => a.index! - b.index!).map((joint) => joint.name);
}

/** Whether a geometry stands for a condition of the scene. */
export function ofCondition(name: string): boolean {
  return name.startsWith("conditions/");
}
