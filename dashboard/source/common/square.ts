// The plane between two bodies as a translucent square, which stands between them and is as large as they need.
import * as three from "three";
import { PROVED } from "./colours";
import type { Matrix } from "./kinematics";
import { toMatrix4 } from "./matrix";

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

interface Body {
  mesh: three.Mesh;
  /** The mean of its vertices, a point of the body, in its own frame; and how far from it the vertices are at most. */
  middle: three.Vector3;
  radius: number;
}

function bodyOf(mesh: three.Mesh): Body {
  const places = mesh.geometry.getAttribute("position"), middle = new three.Vector3(), place = new three.Vector3();
  for (let i = 0; i < places.count; i++) middle.addScaledVector(place.fromBufferAttribute(places, i), 1 / places.count);
  let radius = 0;
  for (let i = 0; i < places.count; i++) radius = Math.max(radius, middle.distanceTo(place.fromBufferAttribute(places, i)));
  return { mesh, middle, radius };
}

export class Square {
  readonly mesh: three.Mesh<three.PlaneGeometry, three.MeshBasicMaterial>;
  private readonly edge: three.LineSegments<three.EdgesGeometry, three.LineBasicMaterial>;
  private plane: BodyPlane | null = null;
  private bodies: Body[] = [];

  constructor() {
    const shape = new three.PlaneGeometry(1, 1);
    this.mesh = new three.Mesh(shape, new three.MeshBasicMaterial({ color: PROVED, transparent: true, opacity: 0.35, side: three.DoubleSide, depthWrite: false }));
    this.edge = new three.LineSegments(new three.EdgesGeometry(shape), new three.LineBasicMaterial({ color: PROVED }));
    this.mesh.add(this.edge);
  }

  /** Shows a plane between two bodies, or none. */
  show(plane: BodyPlane | null, between: three.Mesh[]): void {
    this.plane = plane;
    this.mesh.visible = plane !== null;
    if (this.bodies.some(({ mesh }, i) => mesh !== between[i]) || this.bodies.length !== between.length) this.bodies = between.map(bodyOf);
  }

  /** Moves it to where the line between the middles of the two bodies, which stand where their meshes' matrices say, meets the plane. */
  setPose(poses: Map<string, Matrix>): void {
    if (!this.plane) return;
    const { frame, a, b } = this.plane;
    const normal = new three.Vector3(...(a as [number, number, number])), length = normal.length();
    const plane = new three.Plane(normal.divideScalar(length), b / length).applyMatrix4(toMatrix4(poses.get(frame)!));
    const [first, second] = this.bodies.map(({ mesh, middle }) => middle.clone().applyMatrix4(mesh.matrix)) as [three.Vector3, three.Vector3];
    const [before, behind] = [plane.distanceToPoint(first), -plane.distanceToPoint(second)];
    this.mesh.position.copy(first).lerp(second, before / (before + behind));
    this.mesh.quaternion.setFromUnitVectors(new three.Vector3(0, 0, 1), plane.normal);
    this.mesh.scale.setScalar(2.4 * Math.min(...this.bodies.map(({ radius }) => radius)));
  }

  dispose(): void {
    for (const part of [this.mesh, this.edge]) {
      part.geometry.dispose();
      part.material.dispose();
    }
  }
}
