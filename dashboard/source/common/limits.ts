// What conditions of a scene allow, as translucent bodies: zones in which geometries stay, and cones in which directions of bodies stay.
import * as three from "three";
import type { Matrix } from "./kinematics";
import { toMatrix4 } from "./matrix";
import type { DrawnCone, DrawnZone, SceneModel } from "./schema";

const Y = new three.Vector3(0, 1, 0);
const PART = 0.35; // of the robot's reach: how large a cone is drawn
const ARC = 8; // pieces

function toVector(row: number[]): three.Vector3 {
  return new three.Vector3(...(row as [number, number, number]));
}

function zoneOf({ vertices, triangles }: DrawnZone): three.BufferGeometry {
  return new three.BufferGeometry().setFromPoints(triangles.flatMap((triangle) => triangle.map((i) => toVector(vertices[i]!))));
}

/** All directions that are allowed, from the origin on, up to a sphere. */
function coneOf({ along, angle }: DrawnCone, size: number): three.BufferGeometry {
  const rounded = Array.from({ length: ARC + 1 }, (_, i) => (angle * (ARC - i)) / ARC);
  const outline = rounded.map((turn) => new three.Vector2(size * Math.sin(turn), size * Math.cos(turn)));
  const cone = new three.LatheGeometry([new three.Vector2(), ...outline], 48);
  return cone.applyQuaternion(new three.Quaternion().setFromUnitVectors(Y, toVector(along)));
}

interface Limit {
  condition: string;
  body: string; // in whose frame it is
  at: string; // the body at whose origin it is
  drawn: three.Group;
  surface: three.MeshBasicMaterial;
  edges: three.LineBasicMaterial;
}

export class Limits {
  private readonly all: Limit[];
  private readonly arrows: { condition: string; body: string; axis: three.Vector3; arrow: three.ArrowHelper }[];

  /** Adds what the conditions of a scene allow to what is drawn; reach is the size of the robot in metres. */
  constructor(scene: three.Scene, { zones, cones }: SceneModel, reach: number) {
    const size = PART * reach;
    this.all = [
      ...zones.map((zone) => limit(zone.condition, zone.of, zone.of, zoneOf(zone))),
      ...cones.map((cone) => limit(cone.condition, cone.of, cone.body, coneOf(cone, size))),
    ];
    this.arrows = cones.map(({ condition, body, axis }) => {
      return { condition, body, axis: toVector(axis), arrow: new three.ArrowHelper(Y, new three.Vector3(), size) };
    });
    for (const { drawn } of this.all) scene.add(drawn);
    for (const { arrow } of this.arrows) scene.add(arrow);
  }

  setPose(found: Map<string, Matrix>): void {
    const X = (body: string): three.Matrix4 => toMatrix4(found.get(body)!);
    for (const { body, at, drawn } of this.all) {
      drawn.matrix.copy(X(body)).setPosition(new three.Vector3().setFromMatrixPosition(X(at)));
      drawn.matrixWorldNeedsUpdate = true;
    }
    for (const { body, arrow, axis } of this.arrows) {
      arrow.position.setFromMatrixPosition(X(body));
      arrow.setDirection(axis.clone().transformDirection(X(body)));
    }
  }

  /** Paints the limits of these conditions as not kept, and all others as kept. */
  colour(broken: Set<string>, kept: string, notKept: string): void {
    const colour = (condition: string): string => (broken.has(condition) ? notKept : kept);
    for (const { condition, surface, edges } of this.all) {
      surface.color.set(colour(condition));
      edges.color.set(colour(condition));
    }
    for (const { condition, arrow } of this.arrows) arrow.setColor(colour(condition));
  }

  dispose(): void {
    for (const { drawn, surface, edges } of this.all) {
      drawn.traverse((part) => (part as Partial<three.Mesh>).geometry?.dispose());
      surface.dispose();
      edges.dispose();
    }
    for (const { arrow } of this.arrows) arrow.dispose();
  }
}

function limit(condition: string, body: string, at: string, shape: three.BufferGeometry): Limit {
  const surface = new three.MeshBasicMaterial({ transparent: true, opacity: 0.12, depthWrite: false, side: three.DoubleSide });
  const edges = new three.LineBasicMaterial();
  const drawn = new three.Group();
  drawn.add(new three.Mesh(shape, surface), new three.LineSegments(new three.EdgesGeometry(shape, 30), edges));
  drawn.matrixAutoUpdate = false;
  return { condition, body, at, drawn, surface, edges };
}
