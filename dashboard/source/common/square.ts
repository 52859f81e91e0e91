// The plane between two bodies as a translucent square, which stands between them and is as large as they need.
import * as three from "three";
import { PROVED } from "./colours";
import type { Matrix } from "./kinematics";

/** a'p + b = 0 for the points p of the plane, in the frame of a body, in metres. */
export interface BodyPlane {
  frame: string;
  a: number[];
  b: number;
}

export interface PlaneDrawn {
  plane: BodyPlane;
  /** Indices of the two geometries that it separates. */
  pair: [number, number];
}

export class Square {
  plane: BodyPlane | null = null;
  readonly mesh: three.Mesh<three.PlaneGeometry, three.MeshBasicMaterial>;
  private readonly edge: three.LineSegments<three.EdgesGeometry, three.LineBasicMaterial>;

  constructor() {
    const shape = new three.PlaneGeometry(1, 1);
    this.mesh = new three.Mesh(shape, new three.MeshBasicMaterial({ color: PROVED, transparent: true, opacity: 0.35, side: three.DoubleSide, depthWrite: false }));
    this.edge = new three.LineSegments(new three.EdgesGeometry(shape), new three.LineBasicMaterial({ color: PROVED }));
    this.mesh.add(this.edge);
    this.mesh.visible = false;
  }

  /** Moves it to where the plane is between two bodies, which stand where their meshes' matrices say. */
  setPose(poses: Map<string, Matrix>, bodies: three.Mesh[]): void {
    this.mesh.visible = this.plane !== null;
    if (!this.plane) return;
    const { frame, a, b } = this.plane;
    const normal = new three.Vector3(...(a as [number, number, number])), length = normal.length();
    const X = new three.Matrix4().set(...(poses.get(frame)! as Parameters<three.Matrix4["set"]>));
    const plane = new three.Plane(normal.divideScalar(length), b / length).applyMatrix4(X);
    const [first, second] = bodies.map((mesh) => {
      mesh.geometry.computeBoundingSphere();
      return mesh.geometry.boundingSphere!.clone().applyMatrix4(mesh.matrix);
    }) as [three.Sphere, three.Sphere];
    // It stands where the line between the middles of the two meets it.
    const [before, behind] = [plane.distanceToPoint(first.center), -plane.distanceToPoint(second.center)];
    const middle = plane.projectPoint(first.center.clone().lerp(second.center, before / (before + behind)), new three.Vector3());
    this.mesh.position.copy(middle);
    this.mesh.quaternion.setFromUnitVectors(new three.Vector3(0, 0, 1), plane.normal);
    this.mesh.scale.setScalar(2.4 * Math.min(first.radius, second.radius));
  }

  dispose(): void {
    for (const part of [this.mesh, this.edge]) {
      part.geometry.dispose();
      part.material.dispose();
    }
  }
}
