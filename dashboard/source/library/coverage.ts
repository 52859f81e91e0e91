// How much of the free space the regions cover, estimated from random configurations.
import { post } from "../common/api";
import type { ContactsResponse, ContainsResponse, SceneModel } from "../common/schema";

const SAMPLES = 400;
const AT_ONCE = 100;

export interface Coverage {
  value: number;
  stderr: number;
  free: number;
  samples: number;
}

/** Numbers in [0, 1) that are the same every time (a 32-bit xorshift). */
function numbers(): () => number {
  let state = 0x9e3779b9;
  return () => {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    return (state >>> 0) / 2 ** 32;
  };
}

export async function coverage(model: SceneModel): Promise<Coverage> {
  const random = numbers();
  const q = Array.from({ length: SAMPLES }, () => model.q_lower.map((low, i) => low + (model.q_upper[i]! - low) * random()));
  const free: number[][] = [];
  for (let begin = 0; begin < SAMPLES; begin += AT_ONCE) {
    const asked = q.slice(begin, begin + AT_ONCE);
    const { contacts } = await post<ContactsResponse>("/v1/planning/contacts", { scene: model.scene, q: asked });
    contacts.forEach(({ pairs, outside }, i) => {
      if (pairs?.length === 0 && outside.length === 0) free.push(asked[i]!);
    });
  }
  if (free.length === 0) return { value: 0, stderr: 0, free: 0, samples: SAMPLES };
  const { points } = await post<ContainsResponse>("/v1/planning/contains", { scene: model.scene, q: free });
  const value = points.filter(({ regions }) => regions.length > 0).length / free.length;
  // Where all of them are inside, or none is, one of them more is what nobody knows.
  return { value, stderr: Math.max(Math.sqrt((value * (1 - value)) / free.length), 1 / free.length), free: free.length, samples: SAMPLES };
}
