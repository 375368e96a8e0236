// Pairs of links that are not checked against each other; the server finds out which by sampling.

import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { linkNames } from "./description";
import { draft, edit, identity, isOpen, seal } from "./draft";
import { ProblemWords } from "./fields";
import { collisions } from "./server";
import type { Pair } from "./server";
import { d } from "./texts";

const KINDS = ["adjacent", "always", "never", "sometimes"] as const;
// Pairs that never touched stay checked: so few positions do not prove it.
const TO_IGNORE = ["adjacent", "always"] as const;

/** What sampling found, until another is sampled. */
const found = signal<{ samples: number; pairs: readonly Pair[] } | null>(null);

export function forgetPairs(): void {
  found.value = null;
}

const isSame = (one: readonly [string, string], other: readonly [string, string]) =>
  one.every((link) => other.includes(link));

function setIgnored(pairs: readonly (readonly [string, string])[], ignored: boolean): void {
  seal();
  edit(({ description }) => {
    const others = description.collision.ignore.filter((pair) => !pairs.some((each) => isSame(each, pair)));
    description.collision.ignore = ignored ? [...others, ...pairs.map(([a, b]): [string, string] => [a, b])] : others;
  });
}

export function CollisionsTab() {
  const [sampling, setSampling] = useState(false);
  const [failed, setFailed] = useState("");
  const now = draft.value;
  if (!now) return null;
  const ignored = now.description.collision.ignore;
  const links = linkNames(now.description);
  const known = (found.value?.pairs ?? []).filter((pair) => pair.links.every((link) => links.includes(link)));
  const rows = [
    ...[...known].sort((one, other) => KINDS.indexOf(one.kind) - KINDS.indexOf(other.kind)),
    ...ignored.filter((pair) => !known.some((each) => isSame(each.links, pair))).map((pair) => ({ links: pair, kind: null })),
  ];
  const sample = async () => {
    setSampling(true);
    setFailed("");
    const of = identity.value;
    try {
      const answer = await collisions(now);
      if (isOpen(of)) found.value = answer;
    } catch (error) {
      if (isOpen(of)) setFailed(d("failed", { text: error instanceof Error ? error.message : String(error) }));
    }
    setSampling(false);
  };
  return (
    <>
      <div class="tab-intro">
        <p class="dim small">{d("collisions_words")}</p>
        <button class="action small-action" disabled={sampling} onClick={() => void sample()}>
          {d(sampling ? "sampling" : "sample")}
        </button>
      </div>
      {failed && (
        <p class="problem-word" role="alert">
          <span class="shape warning" aria-hidden="true" />
          {failed}
        </p>
      )}
      {found.value && (
        <div class="pair-tools">
          <span class="dim small">{d("sampled", { count: found.value.samples.toLocaleString("en") })}</span>
          {TO_IGNORE.filter((kind) => known.some((pair) => pair.kind === kind)).map((kind) => (
            <button
              key={kind}
              class="quiet"
              onClick={() => setIgnored(known.filter((pair) => pair.kind === kind).map((pair) => pair.links), true)}
            >
              {d("ignore_kind", { kind: d(`kind_${kind}`) })}
            </button>
          ))}
        </div>
      )}
      {rows.length === 0 ? (
        <p class="dim small tab-empty">{d("no_pairs")}</p>
      ) : (
        <table class="pairs">
          <thead>
            <tr>
              <th scope="col">{d("ignore")}</th>
              <th scope="col">{d("pair")}</th>
              <th scope="col">{d("touches")}</th>
            </tr>
          </thead>
          <tbody>
            {rows.map(({ links: [first, second], kind }, index) => (
              <tr key={`${first} ${second}`}>
                <td>
                  <input
                    type="checkbox"
                    data-path={`collision/ignore/${index}`}
                    aria-label={d("pair_label", { first, second })}
                    checked={ignored.some((pair) => isSame(pair, [first, second]))}
                    onChange={(event) => setIgnored([[first, second]], event.currentTarget.checked)}
                  />
                </td>
                <td>
                  {first} – {second}
                </td>
                <td class={`kind ${kind ?? "unknown"}`}>{d(`kind_${kind ?? "unknown"}`)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      <ProblemWords path="collision" />
    </>
  );
}
