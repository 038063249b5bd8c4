// What a comparison of two versions on recorded sessions found.
import type { ShadowAnswer, ShadowReport } from "../api/types";
import { duration, percent, plural, shortId } from "../format";
import { Panel } from "../parts/Panel";
import { type Column, Table } from "../parts/Table";
import { link } from "../router";
import { NONE_OF_THESE } from "../belief";

export function ShadowPanels({ catalogue, report }: { catalogue: string; report: ShadowReport }) {
  const { old, new: tried } = report;
  const share = (n: number) => `${n} of ${report.n_sessions}`;
  const rows: [string, string, string][] = [
    ["Decided", share(old.n_decided), share(tried.n_decided)],
    ["Touches until the decision", touches(old.touches), touches(tried.touches)],
    ["Decided wrongly", String(old.n_decided_wrongly), String(tried.n_decided_wrongly)],
    ["Right at the end", accuracy(old.accuracy), accuracy(tried.accuracy)],
    ["None of these", percent(old.unknown), percent(tried.unknown)],
    ["Time for a touch", `${old.touch_ms.toFixed(1)} ms`, `${tried.touch_ms.toFixed(1)} ms`],
  ];
  const versionHead = (version: number): Column => [<a key={version} href={link("models", catalogue, version)}>Version {version}</a>, "num"];
  return (
    <>
      <Panel title="Both versions on the same sessions" aside={`took ${duration(report.seconds)}`}>
        <p>
          {plural(report.n_sessions, "session")}, {report.n_with_truth === 0 ? "none with a known truth" : `${report.n_with_truth} with a known truth`}
          {report.n_left_out > 0 && `; ${report.n_left_out} could not be replayed`}. A session is decided when the risk of a wrong answer is at most {percent(report.risk)}.
        </p>
        <Table label="Figures of both versions" columns={[["Figure", "hidden"], ...[report.against, report.version].map(versionHead)]}>
          {rows.map(([name, before, after]) => (
            <tr key={name}><th scope="row">{name}</th><td class="num">{before}</td><td class="num">{after}</td></tr>
          ))}
        </Table>
      </Panel>
      <Panel title="Sessions with another answer" aside={plural(report.n_changed, "session")}>
        {report.changed.length === 0 ? <p class="faint">None: both versions end with the same answer everywhere.</p> : (
          <Table label="Sessions with another answer" columns={["Session", "Truth", `Version ${report.against}`, `Version ${report.version}`, ["Readings", "num"]]}>
            {report.changed.map((one) => (
              <tr key={one.session}>
                <th scope="row"><a href={link("sessions", one.session)}>{shortId(one.session)}</a></th>
                <td>{one.truth ?? <span class="faint">–</span>}</td>
                <td>{answer(one.old)}</td>
                <td>{answer(one.new)}</td>
                <td class="num">{one.n_readings}</td>
              </tr>
            ))}
          </Table>
        )}
      </Panel>
    </>
  );
}

function touches(mean: number | null | undefined): string {
  return typeof mean === "number" ? mean.toFixed(1) : "–";
}

function accuracy(share: number | null | undefined): string {
  return typeof share === "number" ? percent(share) : "–";
}

function answer(of: ShadowAnswer): string {
  const decided = typeof of.decided_after === "number" ? `, decided after ${of.decided_after}` : "";
  return `${of.name ?? NONE_OF_THESE} ${percent(of.probability)}${decided}`;
}
