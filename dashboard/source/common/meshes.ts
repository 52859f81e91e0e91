// The meshes of a scene's models in 3D, grey and translucent: nothing is proved about them.
import * as three from "three";
import type { Matrix } from "./kinematics";
import { toMatrix4 } from "./matrix";
import type { DrawnMesh, SceneMeshes } from "./schema";

const OPACITY = 0.85;

function shapeOf({ vertices, triangles }: DrawnMesh): three.BufferGeometry {
  const corners = triangles.flatMap((triangle) => triangle.flatMap((i) => vertices[i]!));
  const shape = new three.BufferGeometry().setAttribute("position", new three.Float32BufferAttribute(corners, 3));
  shape.computeVertexNormals();
  return shape;
}

export class Meshes {
  private readonly material = new three.MeshStandardMaterial({ roughness: 0.9, flatShading: true, side: three.DoubleSide, transparent: true, opacity: OPACITY });
  private readonly drawn: { body: string; mesh: three.Mesh }[];

  /** Adds them to what is drawn. */
  constructor(private readonly scene: three.Scene, { meshes }: SceneMeshes) {
    this.drawn = meshes.map((one) => {
      const mesh = new three.Mesh(shapeOf(one), this.material);
      mesh.matrixAutoUpdate = false;
      mesh.renderOrder = -1; // before the bodies around them, through which they are seen
      scene.add(mesh);
      return { body: one.body, mesh };
    });
  }

  setPose(poses: Map<string, Matrix>): void {
    for (const { body, mesh } of this.drawn) {
      mesh.matrix.copy(toMatrix4(poses.get(body)!));
      mesh.matrixWorldNeedsUpdate = true;
    }
  }

  colour(colour: string): void {
    this.material.color.set(colour);
  }

  /** Leaves the meshes of these bodies out. */
  hide(bodies: Set<string>): void {
    for (const { body, mesh } of this.drawn) mesh.visible = !bodies.has(body);
  }

  /** Takes them out of what is drawn. */
  dispose(): void {
    for (const { mesh } of this.drawn) {
      this.scene.remove(mesh);
      mesh.geometry.dispose();
    }
    this.material.dispose();
  }
}
