// Draws a robot and its surroundings with three.js: the bodies that are certified, without the padding, and beside them the models' own
// meshes. It draws only when something has changed.
import * as three from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { ConvexGeometry } from "three/examples/jsm/geometries/ConvexGeometry.js";
import { CONTACT, LINKS, onScheme, PROVED, token } from "./colours";
import { movingBodies, ofCondition, poses, type Matrix } from "./kinematics";
import { toMatrix4 } from "./matrix";
import { Limits } from "./limits";
import { pulled } from "./pull";
import { Meshes } from "./meshes";
import { between } from "./nearest";
import type { DrawnGeometry, SceneMeshes, SceneModel } from "./schema";
import { Square, type PlaneDrawn } from "./square";

const GHOST_OPACITY = 0.1;
const AROUND_OPACITY = 0.3; // of certified bodies with meshes in them
const MOST_GHOSTS = 300;
const FADED_OPACITY = 0.18;
const MOST_MARKS = 4; // of contacts
const TURN = 0.12; // radians a key press
const ZOOM = 1.15;

/** From where the view looks, in the world; null for where it looks from now. */
const DIRECTIONS = { front: [0, -1, 0], top: [0, -1e-3, 1], fit: null } as { front: [number, number, number]; top: [number, number, number]; fit: null };

function toVectors(rows: number[][]): three.Vector3[] {
  return rows.map((row) => new three.Vector3(...(row as [number, number, number])));
}

function capsule(a: three.Vector3, b: three.Vector3, radius: number): three.BufferGeometry {
  const along = b.clone().sub(a);
  const shape = new three.CapsuleGeometry(radius, along.length(), 8, 20);
  shape.applyQuaternion(new three.Quaternion().setFromUnitVectors(new three.Vector3(0, 1, 0), along.normalize()));
  return shape.translate((a.x + b.x) / 2, (a.y + b.y) / 2, (a.z + b.z) / 2);
}

function rounded(vertices: three.Vector3[], radius: number): three.BufferGeometry {
  const ball = new three.IcosahedronGeometry(radius, 2).getAttribute("position");
  const offsets = Array.from({ length: ball.count }, (_, i) => new three.Vector3().fromBufferAttribute(ball, i));
  return new ConvexGeometry(vertices.flatMap((vertex) => offsets.map((offset) => offset.clone().add(vertex))));
}

/** conv(vertices) + ball(radius), in the frame of its body. */
function shapeOf({ vertices: rows, triangles, radius }: DrawnGeometry): three.BufferGeometry {
  const vertices = toVectors(rows);
  if (vertices.length === 1) return new three.SphereGeometry(radius, 24, 16).translate(...vertices[0]!.toArray());
  if (vertices.length === 2 && radius > 0) return capsule(vertices[0]!, vertices[1]!, radius);
  if (radius > 0) return rounded(vertices, radius);
  const shape = new three.BufferGeometry().setFromPoints(triangles.flatMap((triangle) => triangle.map((i) => vertices[i]!)));
  shape.computeVertexNormals();
  return shape;
}

/** Whether a pair is one of bodies. What stands for a condition has none. */
export function haveBodies(model: SceneModel, pair: number[]): boolean {
  return pair.length === 2 && pair.every((i) => model.geometries[i]!.vertices.length > 0);
}

interface Drawn {
  geometry: DrawnGeometry;
  mesh: three.Mesh<three.BufferGeometry, three.MeshStandardMaterial>;
  colour: string | null; // of a link; null at rest, where the page's own grey is used
}

export class View {
  /** Called with the joint positions while a link is dragged; null where links cannot be dragged. */
  onDrag: ((q: number[]) => void) | null = null;
  private readonly renderer: three.WebGLRenderer;
  private readonly scene = new three.Scene();
  private readonly camera = new three.PerspectiveCamera(40, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly drawn: Drawn[];
  private readonly posesOf: (q: number[]) => Map<string, Matrix>;
  private readonly grid: three.GridHelper;
  private readonly observer: ResizeObserver;
  private readonly forgetScheme: () => void;
  private limits: Limits | null = null; // until the size of the robot is known
  private reach = 1; // metres
  private ghosts: three.InstancedMesh[] = [];
  private home = { position: new three.Vector3(), target: new three.Vector3() };
  /** Where the robot has been so far: all of it is to be seen from home. */
  private been = new three.Box3();
  /** Whether somebody has chosen from where to look. Then the view stays there. */
  private chosen = false;
  private grabbed = false;
  private asked = 0;
  private touching: number[][] = [];
  private readonly marks: three.Mesh<three.SphereGeometry, three.MeshBasicMaterial>[] = [];
  private hidden = new Set<string>();
  private faded = new Set<string>();
  /** The body that somebody points at, in the list of bodies. */
  private pointed: string | null = null;
  private axes: Map<string, three.AxesHelper> | null = null;
  private pair: number[] = [];
  private square: Square | null = null; // once a plane has been drawn
  private meshes: Meshes | null = null; // while they are shown
  private certified = true;
  private q: number[];

  /** Throws where the browser cannot draw with WebGL. */
  constructor(canvas: HTMLCanvasElement, private readonly model: SceneModel) {
    this.q = model.q_star;
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.posesOf = poses(model);
    const links = movingBodies(model);
    this.drawn = model.geometries.map((geometry) => {
      const link = links.indexOf(geometry.body);
      const colour = link < 0 ? null : LINKS[link % LINKS.length]!;
      // A little farther away than they are: where a mesh has the same face, the mesh is seen.
      const material = new three.MeshStandardMaterial({ roughness: 0.65, metalness: 0.05, flatShading: geometry.radius === 0, side: three.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
      const mesh = new three.Mesh(shapeOf(geometry), material);
      mesh.matrixAutoUpdate = false;
      this.scene.add(mesh);
      return { geometry, mesh, colour };
    });
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => (this.chosen = true));
    canvas.addEventListener("pointerdown", (event) => this.grab(event), { capture: true }); // before the controls, which turn the view
    this.scene.add(new three.HemisphereLight("#ffffff", "#8a8f98", 1.7));
    const sun = new three.DirectionalLight("#ffffff", 1.8);
    sun.position.set(2, -3, 5);
    this.scene.add(sun);
    this.setPose(model.q_star);
    this.grid = this.frame();
    this.limits = new Limits(this.scene, model, this.reach);
    this.setPose(model.q_star);
    this.colour([]);
    this.forgetScheme = onScheme(() => this.colour(this.touching));
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement ?? canvas);
    this.resize();
  }

  /** Puts the camera where it sees the robot, and a grid under it. */
  private frame(): three.GridHelper {
    const box = this.been.copy(this.links());
    const sphere = box.getBoundingSphere(new three.Sphere());
    const reach = (this.reach = Math.max(sphere.radius, 0.1));
    this.settle();
    this.camera.near = reach / 100;
    this.camera.far = reach * 60;
    this.reset();
    const grid = new three.GridHelper(8 * reach, 16);
    grid.rotateX(Math.PI / 2);
    grid.position.set(sphere.center.x, sphere.center.y, Math.min(box.min.z, 0));
    (grid.material as three.Material).transparent = true;
    (grid.material as three.Material).opacity = 0.25;
    this.scene.add(grid);
    return grid;
  }

  /** A box around the links. */
  private links(): three.Box3 {
    const box = new three.Box3();
    for (const { mesh, colour } of this.drawn) if (colour !== null) box.expandByObject(mesh);
    return box;
  }

  /** Puts home where all places are seen in which the robot has been. */
  private settle(): void {
    const { center, radius } = this.been.getBoundingSphere(new three.Sphere());
    this.home.target.copy(center);
    this.home.position.copy(center).add(new three.Vector3(1.6, -2.4, 1.3).multiplyScalar(1.25 * Math.max(radius, 0.1)));
  }

  /** Keeps the robot in view where it moves, unless somebody looks from elsewhere, or pulls it. */
  private follow(): void {
    const links = this.links();
    if (!this.limits || links.isEmpty() || this.been.containsBox(links)) return;
    this.been.union(links);
    this.settle();
    if (!this.chosen && !this.grabbed) this.reset();
  }

  /** Looks at all bodies in view from a direction of the world, or from the present one, from as far as they need. */
  look(from: keyof typeof DIRECTIONS): void {
    const box = new three.Box3();
    for (const { geometry, mesh } of this.drawn) if (!this.hidden.has(geometry.body)) box.expandByObject(mesh);
    if (box.isEmpty()) return;
    this.see(box.getBoundingSphere(new three.Sphere()), DIRECTIONS[from] ? new three.Vector3(...DIRECTIONS[from]) : this.line());
  }

  /** Looks at the first contact, from where the view looks, so near that the smaller of the two bodies is seen whole. */
  frameContact(): void {
    const mark = this.marks[0];
    if (!mark?.visible) return;
    const first = this.touching.find((pair) => haveBodies(this.model, pair))!;
    const radii = first.map((i) => new three.Box3().setFromObject(this.drawn[i]!.mesh).getBoundingSphere(new three.Sphere()).radius);
    this.see(new three.Sphere(mark.position.clone(), Math.min(...radii, this.reach) + 0.4 * this.reach), this.line());
  }

  /** From what the view looks at to the camera. */
  private line(): three.Vector3 {
    return this.camera.position.clone().sub(this.controls.target);
  }

  /** Has a ball fill the view, seen from a direction. */
  private see({ center, radius }: three.Sphere, direction: three.Vector3): void {
    this.chosen = true;
    const half = (this.camera.fov * Math.PI) / 360;
    const distance = radius / Math.sin(Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect)));
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(direction.normalize(), distance);
    this.camera.far = Math.max(this.camera.far, 4 * distance);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }

  /** Lets these bodies be seen through. */
  setFaded(bodies: Set<string>): void {
    this.faded = bodies;
    this.show();
  }

  /** Leaves the geometries of these bodies out. */
  setHidden(bodies: Set<string>): void {
    this.hidden = bodies;
    for (const ghost of this.ghosts) ghost.visible = !bodies.has(ghost.name);
    this.show();
  }

  /** Draws the certified bodies or not, and the models' own meshes; null draws none. Bodies that have meshes in them can be seen through. */
  setShown(certified: boolean, meshes: SceneMeshes | null): void {
    this.certified = certified;
    this.meshes?.dispose();
    this.meshes = meshes && new Meshes(this.scene, meshes);
    this.meshes?.colour(token("--rest"));
    this.show();
    this.setPose(this.q);
  }

  private show(): void {
    for (const { geometry, mesh } of this.drawn) {
      const opacity = this.faded.has(geometry.body) ? FADED_OPACITY : this.meshes ? AROUND_OPACITY : 1;
      mesh.visible = this.certified && !this.hidden.has(geometry.body);
      mesh.material.transparent = opacity < 1;
      mesh.material.opacity = opacity;
      mesh.material.depthWrite = opacity === 1;
      mesh.material.needsUpdate = true;
    }
    this.meshes?.hide(this.hidden);
    this.draw();
  }

  /** Lights a body up; none for null. */
  point(body: string | null): void {
    this.pointed = body;
    this.colour(this.touching);
  }

  /** Draws the plane between the geometries of a pair, by index, which light up; null draws none. It moves with the robot. */
  setPlane(drawn: PlaneDrawn | null): void {
    if (drawn && !this.square) this.scene.add((this.square = new Square()).mesh);
    this.pair = drawn?.pair ?? [];
    this.square?.show(drawn?.plane ?? null, this.pair.map((i) => this.drawn[i]!.mesh));
    this.colour(this.touching);
    this.setPose(this.q);
  }

  /** Draws the frames of the bodies: x red, y green, z blue. */
  setFrames(on: boolean): void {
    for (const axes of this.axes?.values() ?? []) {
      this.scene.remove(axes);
      axes.dispose();
    }
    this.axes = null;
    if (on) {
      this.axes = new Map(this.model.bodies.map((body) => [body, new three.AxesHelper(0.25 * this.reach)]));
      for (const axes of this.axes.values()) {
        axes.matrixAutoUpdate = false;
        (axes.material as three.Material).depthTest = false;
        axes.renderOrder = 1;
        this.scene.add(axes);
      }
    }
    this.setPose(this.q);
  }

  /** Looks from where the view began. */
  reset(): void {
    this.chosen = false;
    this.camera.position.copy(this.home.position);
    this.controls.target.copy(this.home.target);
    this.controls.update();
    this.draw();
  }

  /** Turns the camera about what it looks at, and comes nearer for zoom > 1. */
  turn(left: number, up: number, zoom: number): void {
    this.chosen = true;
    const offset = this.camera.position.clone().sub(this.controls.target);
    const at = new three.Spherical().setFromVector3(new three.Vector3(offset.x, offset.z, -offset.y));
    at.theta -= left;
    at.phi = Math.min(Math.max(at.phi - up, 0.05), Math.PI - 0.05);
    at.radius /= zoom;
    const turned = new three.Vector3().setFromSpherical(at);
    this.camera.position.copy(this.controls.target).add(new three.Vector3(turned.x, -turned.z, turned.y));
    this.controls.update();
    this.draw();
  }

  /** Answers a key: the arrows turn, + and - zoom, 0 goes back. Returns whether it did anything. */
  key(key: string): boolean {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-TURN, 0, 1], ArrowRight: [TURN, 0, 1], ArrowUp: [0, TURN, 1], ArrowDown: [0, -TURN, 1], "+": [0, 0, ZOOM], "=": [0, 0, ZOOM], "-": [0, 0, 1 / ZOOM],
    };
    if (key === "0") this.reset();
    else if (turns[key]) this.turn(...turns[key]);
    else return false;
    return true;
  }

  /** Where a link is grabbed, the pointer pulls its point along, in a plane across the line of sight. */
  private grab(down: PointerEvent): void {
    if (!this.onDrag || down.button !== 0) return;
    const canvas = this.renderer.domElement;
    const ray = new three.Raycaster();
    const aim = (event: PointerEvent): three.Raycaster => {
      const { left, top, width, height } = canvas.getBoundingClientRect();
      ray.setFromCamera(new three.Vector2((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height), this.camera);
      return ray;
    };
    const [hit] = aim(down).intersectObjects(this.drawn.filter(({ geometry }) => !this.hidden.has(geometry.body)).map(({ mesh }) => mesh));
    const link = this.drawn.find(({ mesh, colour }) => colour !== null && mesh === hit?.object);
    if (!hit || !link) return;
    down.stopImmediatePropagation();
    canvas.setPointerCapture(down.pointerId);
    const local = link.mesh.worldToLocal(hit.point.clone());
    const pointAt = (q: number[]): three.Vector3 => local.clone().applyMatrix4(toMatrix4(this.posesOf(q).get(link.geometry.body)!));
    const plane = new three.Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new three.Vector3()), hit.point);
    const drag = (event: PointerEvent): void => {
      const target = aim(event).ray.intersectPlane(plane, new three.Vector3());
      if (target) this.onDrag?.(pulled(pointAt, this.q, target, this.model.q_lower, this.model.q_upper));
    };
    canvas.addEventListener("pointermove", drag);
    this.grabbed = true;
    const released = (): void => {
      canvas.removeEventListener("pointermove", drag);
      this.grabbed = false;
    };
    canvas.addEventListener("lostpointercapture", released, { once: true });
  }

  setPose(q: number[]): void {
    this.q = q;
    const found = this.posesOf(q);
    for (const { geometry, mesh } of this.drawn) {
      mesh.matrix.copy(toMatrix4(found.get(geometry.body)!));
      mesh.matrixWorldNeedsUpdate = true;
    }
    for (const [body, axes] of this.axes ?? []) {
      axes.matrix.copy(toMatrix4(found.get(body)!));
      axes.matrixWorldNeedsUpdate = true;
    }
    this.limits?.setPose(found);
    this.meshes?.setPose(found);
    this.square?.setPose(found);
    this.follow();
    this.mark();
    this.draw();
  }

  /** Marks where bodies touch, or are nearest to each other, through all that is before it. */
  private mark(): void {
    const shown = this.touching.filter((pair) => haveBodies(this.model, pair)).slice(0, MOST_MARKS);
    while (this.marks.length < shown.length) {
      const mark = new three.Mesh(new three.SphereGeometry(0.02 * this.reach, 16, 12), new three.MeshBasicMaterial({ depthTest: false, transparent: true }));
      mark.renderOrder = 2;
      this.marks.push(mark);
      this.scene.add(mark);
    }
    this.marks.forEach((mark, k) => {
      const pair = shown[k];
      mark.visible = pair !== undefined;
      mark.material.color.set(token("--ink"));
      if (!pair) return;
      const [a, b] = pair.map((i) => {
        const { geometry, mesh } = this.drawn[i]!;
        return { vertices: toVectors(geometry.vertices).map((vertex) => vertex.applyMatrix4(mesh.matrix)), radius: geometry.radius };
      });
      mark.position.copy(between(a!, b!));
    });
  }

  /** Paints the geometries of these pairs, by index, as what touches, and marks where; all others have their own colour. */
  colour(touching: number[][]): void {
    this.touching = touching;
    const are = new Set(touching.flat());
    this.drawn.forEach(({ geometry, mesh, colour }, i) => {
      const lit = are.has(i) ? CONTACT : this.pair.includes(i) ? PROVED : geometry.body === this.pointed ? token("--ink") : null;
      mesh.material.color.set(are.has(i) ? CONTACT : (colour ?? token("--rest")));
      mesh.material.emissive.set(lit ?? "#000000");
      mesh.material.emissiveIntensity = lit ? 0.35 : 0;
    });
    this.meshes?.colour(token("--rest"));
    const names = touching.flat().map((i) => this.model.geometries[i]!.name).filter(ofCondition);
    this.limits?.colour(new Set(names.map((name) => name.split("/")[1]!)), token("--good"), CONTACT);
    this.mark();
    this.draw();
  }

  /** Draws the links faintly at each of these configurations as well; at most 300 of them. */
  setGhosts(configurations: number[][]): void {
    for (const ghost of this.ghosts) {
      this.scene.remove(ghost);
      ghost.dispose();
      (ghost.material as three.Material).dispose();
    }
    const all = configurations.slice(0, MOST_GHOSTS).map((q) => this.posesOf(q));
    this.ghosts = all.length === 0 ? [] : this.drawn.filter(({ colour }) => colour !== null).map(({ geometry, mesh, colour }) => {
      const material = new three.MeshStandardMaterial({ color: colour!, transparent: true, opacity: GHOST_OPACITY, depthWrite: false });
      const ghost = new three.InstancedMesh(mesh.geometry, material, all.length);
      ghost.name = geometry.body;
      ghost.visible = !this.hidden.has(geometry.body);
      all.forEach((found, i) => ghost.setMatrixAt(i, toMatrix4(found.get(geometry.body)!)));
      this.scene.add(ghost);
      return ghost;
    });
    this.draw();
  }

  private resize(): void {
    const canvas = this.renderer.domElement;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private draw(): void {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.renderer.render(this.scene, this.camera);
    });
  }

  dispose(): void {
    cancelAnimationFrame(this.asked);
    this.observer.disconnect();
    this.forgetScheme();
    this.setGhosts([]);
    this.setFrames(false);
    cancelAnimationFrame(this.asked);
    this.controls.dispose();
    this.grid.dispose();
    this.limits?.dispose();
    this.square?.dispose();
    this.meshes?.dispose();
    for (const mesh of [...this.drawn.map(({ mesh }) => mesh), ...this.marks]) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    this.renderer.dispose();
  }
}
