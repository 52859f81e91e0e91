// A free configuration beside one that is not free, with room around it.
import { post } from "./api";
import type { ContactsResponse, PlanResponse, SceneModel } from "./schema";

/** How many configurations on the line away from the contact are looked at, and how far it goes, as a part of the joints' half ranges. */
const STEPS = 30,
  REACH = 0.3;

/** Returns a free configuration near q; null where none was found, undefined where q is free.
 *
 *  The nearest one almost touches, and a region around it would be thin. So it is the middle of what is free beyond the nearest one. */
export async function nearby({ scene, q_lower, q_upper }: SceneModel, q: number[]): Promise<number[] | null | undefined> {
  const { collision } = await post<PlanResponse>("/v1/planning/plan", { scene, start: q, goal: q });
  if (!collision?.free) return collision?.free;
  const { free } = collision;
  const half = q.map((_, i) => (q_upper[i]! - q_lower[i]!) / 2);
  const away = free.map((value, i) => (value - q[i]!) / half[i]!);
  const length = Math.hypot(...away);
  const line = Array.from({ length: STEPS }, (_, k) => free.map((value, i) => value + ((REACH * (k + 1)) / STEPS) * (away[i]! / length) * half[i]!));
  const { contacts } = await post<ContactsResponse>("/v1/planning/contacts", { scene, q: line });
  const end = contacts.findIndex(({ pairs, trouble }) => pairs === null || trouble.length > 0);
  const room = end < 0 ? STEPS : end;
  return room > 1 ? line[Math.floor(room / 2) - 1]! : free;
}
