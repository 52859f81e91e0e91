// Poses as three.js has them.
import * as three from "three";
import type { Matrix } from "./kinematics";

export function toMatrix4(pose: Matrix): three.Matrix4 {
  return new three.Matrix4().set(...(pose as Parameters<three.Matrix4["set"]>));
}
