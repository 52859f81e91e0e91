// What the steps of a job are called.

/** Says what a step does; of the job's subject, such as the region or the map. */
export function stepOf(kind: string, subject: string): string {
  return STEPS[kind]?.(subject) ?? kind;
}

/** The label of an iteration in words; the other labels are terms of the papers. */
export function stageOf(label: string): string {
  return STAGES[label] ?? label;
}

const STAGES: Record<string, string> = { given: "the given polytope", box: "a box around the seed", cells: "cell by cell" };
const starting = (): string => "Looking for a starting region around the seed";
const STEPS: Record<string, (subject: string) => string> = {
  propose: starting,
  seed: starting,
  decide: () => "Deciding what comes next",
  step: () => "Moving the faces of the region",
  accept: (subject) => `Putting the proof of ${subject} together and verifying it`,
  scout: () => "Looking at what is covered",
  move: () => "Looking for motions between regions",
  motion: () => "Certifying the motion",
  map: () => "Choosing which cells of the map to prove",
  piece: () => "Proving cells of the map",
};
