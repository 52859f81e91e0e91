// Shares over time, in one picture: the curve of a job, or those of two.
import type { Known } from "./curve";
import { duration } from "./outcomes";

const WIDTH = 600,
  HEIGHT = 170;
const LEFT = 64,
  RIGHT = 14,
  TOP = 12,
  BOTTOM = 26;
const GRID = 4;
const MARK = 4;
/** A curve of more points than these is drawn without marks. */
const MARKED = 60;

export interface Curve {
  name: string;
  points: Known[];
}

export function percent(share: number): string {
  return `${Number((100 * share).toPrecision(3))} %`;
}

/** The next number above that people like to read on an axis. */
function round(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 4, 5, 6, 8, 10].map((step) => step * power).find((step) => step >= value * (1 - 1e-9)) ?? value;
}

/** Each curve has a colour, a stroke and a mark of its own. `what` says what the shares are of, to who does not see the picture. */
export function Chart({ curves, what }: { curves: Curve[]; what: string }) {
  const all = curves.flatMap(({ points }) => points);
  const end = Math.max(...all.map(({ seconds }) => seconds)) || 1,
    top = Math.min(1, round(Math.max(...all.map(({ share }) => share)) || 1));
  const x = (seconds: number): number => LEFT + ((WIDTH - LEFT - RIGHT) * seconds) / end;
  const y = (share: number): number => HEIGHT - BOTTOM - ((HEIGHT - TOP - BOTTOM) * share) / top;
  const steps = (points: Known[]): string => points.map(({ seconds, share }, i) => (i === 0 ? `M${x(seconds)},${y(share)}` : `H${x(seconds)}V${y(share)}`)).join("");
  const parts = Array.from({ length: GRID + 1 }, (_, i) => i / GRID);
  return (
    <figure class="share">
      {curves.length > 1 && (
        <figcaption class="legend">
          {curves.map(({ name }, which) => (
            <span key={name}>
              <svg class="chart swatch" viewBox="0 0 34 12" aria-hidden="true">
                <path class={`of-${which}`} d="M2,6H32" />
                <Mark which={which} x={17} y={6} />
              </svg>{" "}
              <code>{name.slice(0, 8)}</code>
            </span>
          ))}
        </figcaption>
      )}
      <svg class="chart" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={`${what}. The table below has the numbers.`}>
        {parts.map((part) => (
          <g key={part}>
            <line x1={LEFT} x2={WIDTH - RIGHT} y1={y(part * top)} y2={y(part * top)} />
            {(part * GRID) % 2 === 0 && (
              <text x={LEFT - 8} y={y(part * top) + 4} text-anchor="end">
                {percent(part * top)}
              </text>
            )}
            {(part * GRID) % 2 === 0 && (
              <text x={x(part * end)} y={HEIGHT - 7} text-anchor={part === 0 ? "start" : part === 1 ? "end" : "middle"}>
                {duration(part * end)}
              </text>
            )}
          </g>
        ))}
        {curves.map(({ name, points }, which) => (
          <g key={name}>
            {curves.length === 1 && <path class="under" d={`${steps(points)}V${y(0)}H${x(points[0]!.seconds)}Z`} />}
            <path class={`of-${which}`} d={steps(points)} />
            {points.length <= MARKED &&
              points.map((point) => (
                <Mark which={which} x={x(point.seconds)} y={y(point.share)} key={point.seconds}>
                  {`${percent(point.share)} after ${duration(point.seconds)}`}
                </Mark>
              ))}
          </g>
        ))}
      </svg>
    </figure>
  );
}

function Mark({ which, x, y, children }: { which: number; x: number; y: number; children?: string }) {
  const title = children && <title>{children}</title>;
  if (which === 0) return <circle class="of-0" cx={x} cy={y} r={MARK}>{title}</circle>;
  return <rect class="of-1" x={x - MARK} y={y - MARK} width={2 * MARK} height={2 * MARK}>{title}</rect>;
}
