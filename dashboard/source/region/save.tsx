// A region's page as one file, which opens without the service and without a network.
import { useState } from "preact/hooks";
import { said } from "../common/api";
import type { Faces, Space } from "../common/polytope";
import type { SceneModel } from "../common/schema";

/** What the program in the file reads. */
export interface Saved {
  model: SceneModel;
  space: Space;
  faces: Faces;
  /** The configuration that it shows first. */
  q: number[];
  /** What is proved where the robot is inside the region, in a sentence. */
  proved: string;
}

/** Lets nothing in from elsewhere, whatever the file holds. */
const POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'";

async function text(address: URL | string): Promise<string> {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`${address} answers ${answer.status}`);
  return answer.text();
}

function escaped(words: string): string {
  return words.replaceAll("&", "&amp;").replaceAll("<", "&lt;");
}

/** The claim as the server wrote it, without what is said of the robot at this moment. */
function claim(): string {
  const copy = document.querySelector(".claim")!.cloneNode(true) as HTMLElement;
  for (const place of copy.querySelectorAll("#claim-now, #claim-motion")) place.replaceChildren();
  return copy.outerHTML;
}

async function written(region: string, saved: Saved): Promise<string> {
  const [program, licences, style] = await Promise.all([text(new URL("./standalone.js", import.meta.url)), text("/static/built/licences.txt"), text("/static/ciris.css")]);
  const title = `Region of ${escaped(saved.model.name)}`;
  return `<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="${POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>${title} · ciris</title>
<style>${style}</style>
</head>
<body>
<main>
<h1>${title}</h1>
${claim()}
<div id="robot"></div>
<p class="quiet">Saved ${new Date().toISOString().slice(0, 16).replace("T", " ")} UTC. This file shows the region ${region}, and is no proof. Check its proof file with <code>ciris verify ${region}.proof</code>.</p>
<details><summary>Licences of the programs in this file</summary><pre>${escaped(licences)}</pre></details>
</main>
<script type="application/json" id="saved">${JSON.stringify({ ...saved, model: { ...saved.model, has_meshes: false } }).replaceAll("<", "\\u003c")}</script>
<script type="module">${program.replaceAll("</script", "<\\/script")}</script>
</body>
</html>
`;
}

export function SaveAsHtml({ region, saved }: { region: string; saved: Saved }) {
  const [problem, setProblem] = useState<string | null>(null);
  const save = async (): Promise<void> => {
    setProblem(null);
    try {
      const address = URL.createObjectURL(new Blob([await written(region, saved)], { type: "text/html" }));
      Object.assign(document.createElement("a"), { href: address, download: `${region}.html` }).click();
      setTimeout(() => URL.revokeObjectURL(address), 60_000);
    } catch (reason) {
      setProblem(said(reason));
    }
  };
  return (
    <>
      <button type="button" onClick={() => void save()}>Save as HTML</button>
      {problem && <span role="alert" class="inside not">The file cannot be written: {problem}</span>}
    </>
  );
}
